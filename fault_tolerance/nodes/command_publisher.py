# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Commands to the drives, as JointGroupVelocityController takes them."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.messages import array_to_msg, twist_to_msg
from fault_tolerance.nodes.timeline import TimeLine

_ACKNOWLEDGEMENT_TIMEOUT = 0.5
RIVAL_PATIENCE = 30.0
"""Seconds after which another publisher of commands is no controller that was killed: the
middleware forgets such a one within 20 s."""


class CommandPublisher:
    """Publishes the rates of all actuators, and the platform velocity they produce.

    Parameters
    ----------
    node : Node
    mechanism : Mechanism
    base_frame : str
        ``frame_id`` of the platform velocity.
    timeline : TimeLine
    """

    def __init__(
        self, node: Node, mechanism: Mechanism, base_frame: str, timeline: TimeLine
    ) -> None:
        self._node, self._timeline = node, timeline
        self._alone_at = timeline.now()
        self._frame = base_frame
        self._signs = mechanism.rates_from_readings(np.ones(len(mechanism.actuators)))
        self._rates = np.zeros(len(self._signs))
        self._head = _head_of(len(self._signs))
        self._commands = node.create_publisher(
            Float64MultiArray, 'velocity_controller/commands', 10
        )
        self._achieved = node.create_publisher(TwistStamped, '~/achieved_velocity', 10)

    @property
    def moving(self) -> bool:
        """Whether the last command moves anything."""
        return bool(self._rates.any())

    def publish(self, rates: FloatArray, achieved: FloatArray) -> None:
        """Publish joint ``rates`` (N,) in the mechanism's order, rad/s or m/s.

        ``achieved`` (6,) is the twist ``[w; v]`` of the platform that they produce.
        """
        np.multiply(self._signs, rates, out=self._rates)
        # Turn the -0.0 of a resting drive into 0.0.
        self._rates += 0.0
        self._commands.publish(self._head + self._rates.tobytes())
        if self._achieved.get_subscription_count():
            stamp = self._timeline.stamp()
            self._achieved.publish(twist_to_msg(stamp, self._frame, achieved))

    def check_publishers(self, health: Health) -> None:
        """Warn once, by ``health``, if another node could command the same drives, and remains."""
        topic, now = self._commands.topic_name, self._timeline.now()
        count = self._node.count_publishers(topic)
        if count < 2:
            self._alone_at = now
        if now - self._alone_at > RIVAL_PATIENCE:
            text = f'{count} publishers on {topic}: the drives follow whichever is the last'
            health.warn_once('several_controllers', text)

    def stop(self) -> None:
        """Publish zeros, and wait until they are acknowledged."""
        self._rates[:] = 0.0
        self._commands.publish(self._head + self._rates.tobytes())
        self._commands.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGEMENT_TIMEOUT))


def _head_of(count: int) -> bytes:
    """Return what stands before ``count`` rates in a serialised command.

    Such a message ends with its data; what comes before is always the same. ValueError where the
    middleware does it in another way.
    """
    zeros, told = np.zeros(count), np.arange(1.0, count + 1.0)
    head: bytes = serialize_message(array_to_msg(zeros))[: -zeros.nbytes]
    if list(deserialize_message(head + told.tobytes(), Float64MultiArray).data) != told.tolist():
        raise ValueError('this middleware does not serialise commands as plain CDR')
    return head
