# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Commands to the drives, as JointGroupVelocityController takes them."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.messages import array_to_msg, fill_twist

_FAREWELL_PATIENCE = 0.5


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


class CommandPublisher:
    """Publishes the rates of all actuators, and what they will do to the platform.

    Parameters
    ----------
    node : Node
    mechanism : Mechanism
    base_frame : str
    """

    def __init__(self, node: Node, mechanism: Mechanism, base_frame: str) -> None:
        self._clock = node.get_clock()
        count = len(mechanism.actuators)
        self._array = SerialisedArray(count)
        self._rates = np.zeros(count)
        self._signs = mechanism.rates_from_readings(np.ones(count))
        self._plain = bool((self._signs == 1.0).all())
        self._commands = node.create_publisher(
            Float64MultiArray, 'velocity_controller/commands', 10
        )
        self._achieved = node.create_publisher(TwistStamped, '~/achieved_velocity', 10)
        self._twist = TwistStamped()
        self._twist.header.frame_id = base_frame
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
            self._twist.header.stamp = self._clock.now().to_msg()
            fill_twist(self._twist.twist, achieved)
            self._achieved.publish(self._twist)

    @property
    def moving(self) -> bool:
        """Whether the command sent last moves anything."""
        return bool(self._rates.any())

    def rest(self) -> None:
        """Publish zeros, and wait until they have arrived."""
        self._rates = np.zeros(len(self._rates))
        self._commands.publish(self._array.message(self._rates))
        self._commands.wait_for_all_acked(Duration(seconds=_FAREWELL_PATIENCE))
