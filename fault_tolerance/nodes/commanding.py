# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Commands to the drives, as JointGroupVelocityController takes them."""

from __future__ import annotations

from array import array

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.messages import fill_twist

_FAREWELL_PATIENCE = 0.5


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
        # One message, written into through numpy: the command waits for nothing it need not.
        self._message = Float64MultiArray(data=array('d', [0.0] * count))
        self._rates = np.frombuffer(self._message.data)
        self._signs = mechanism.rates_from_readings(np.ones(count))
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
        np.multiply(self._signs, rates, out=self._rates)
        # Adding zero turns the -0.0 of a resting drive with sign -1 into 0.0.
        self._rates += 0.0
        self._commands.publish(self._message)
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
        self._rates[:] = 0.0
        self._commands.publish(self._message)
        self._commands.wait_for_all_acked(Duration(seconds=_FAREWELL_PATIENCE))
