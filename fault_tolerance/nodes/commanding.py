# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Commands to the drives, as JointGroupVelocityController takes them."""

from __future__ import annotations

from struct import Struct

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.messages import array_to_msg, twist_to_msg
from fault_tolerance.nodes.timeline import TimeLine

_FAREWELL_PATIENCE = 0.5
_STAMP = Struct('<iI')


class SerialisedArray:
    """Makes messages of ``count`` numbers each, serialised where that can be done by hand.

    All that comes before the numbers is the same every time; the middleware says what it is.
    """

    def __init__(self, count: int) -> None:
        # Numbers that could not come about by accident.
        probe = np.pi * np.arange(1.0, count + 1.0)
        raw = serialize_message(array_to_msg(probe))
        self._before: bytes | None = raw[: len(raw) - 8 * count]
        if not count or self._before + probe.tobytes() != raw:
            self._before = None

    def message(self, values: FloatArray) -> bytes | Float64MultiArray:
        """Return a message of ``values`` (count,), as `Publisher.publish` takes it."""
        if self._before is None:
            return array_to_msg(values)
        return self._before + values.tobytes()


class SerialisedTwist:
    """Makes stamped twists in one frame, serialised where that can be done by hand."""

    def __init__(self, frame: str) -> None:
        self._frame = frame
        probe, stamp = np.pi * np.arange(1.0, 7.0), Time(sec=123_456_789, nanosec=987_654_321)
        raw = serialize_message(twist_to_msg(stamp, frame, probe))
        self._begin, self._middle = raw[:4], raw[4 + _STAMP.size : len(raw) - probe.nbytes]
        self._known = self._serialised(stamp.sec, stamp.nanosec, probe) == raw

    def message(self, nanoseconds: int, twist: FloatArray) -> bytes | TwistStamped:
        """Return the message for a twist ``[w; v]`` (6,), as `Publisher.publish` takes it."""
        sec, nanosec = divmod(nanoseconds, 1_000_000_000)
        if self._known:
            return self._serialised(sec, nanosec, twist)
        return twist_to_msg(Time(sec=sec, nanosec=nanosec), self._frame, twist)

    def _serialised(self, sec: int, nanosec: int, twist: FloatArray) -> bytes:
        # Messages have v before w.
        numbers = twist[3:].tobytes() + twist[:3].tobytes()
        return self._begin + _STAMP.pack(sec, nanosec) + self._middle + numbers


class CommandPublisher:
    """Publishes the rates of all actuators, and what they will do to the platform.

    Parameters
    ----------
    node : Node
    mechanism : Mechanism
    base_frame : str
    line : TimeLine
    """

    def __init__(
        self, node: Node, mechanism: Mechanism, base_frame: str, line: TimeLine
    ) -> None:
        self._line = line
        count = len(mechanism.actuators)
        self._array = SerialisedArray(count)
        self._rates = np.zeros(count)
        self._signs = mechanism.rates_from_readings(np.ones(count))
        self._plain = bool((self._signs == 1.0).all())
        self._commands = node.create_publisher(
            Float64MultiArray, 'velocity_controller/commands', 10
        )
        self._achieved = node.create_publisher(TwistStamped, '~/achieved_velocity', 10)
        self._twist = SerialisedTwist(base_frame)
        self._heard = False

    def look_for_listeners(self) -> None:
        """Find out whether anybody hears of the achieved velocity; takes longer than a command."""
        self._heard = self._achieved.get_subscription_count() > 0

    def send(self, rates: FloatArray, achieved: FloatArray) -> None:
        """Publish joint rates (N,), in the units and signs of the drives, and the twist (6,)."""
        # Adding zero turns the -0.0 of a resting drive into 0.0.
        self._rates = rates if self._plain else self._signs * rates + 0.0
        self._commands.publish(self._array.message(self._rates))
        if self._heard:
            self._achieved.publish(self._twist.message(self._line.wall(), achieved))

    @property
    def moving(self) -> bool:
        """Whether the command sent last moves anything."""
        return bool(self._rates.any())

    def rest(self) -> None:
        """Publish zeros, and wait until they have arrived."""
        self._rates = np.zeros(len(self._rates))
        self._commands.publish(self._array.message(self._rates))
        self._commands.wait_for_all_acked(Duration(seconds=_FAREWELL_PATIENCE))
