# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether the controller lives, for nodes beside it: by the liveliness that it offers.

A timer of the controller asserts it, without a message, in the executor that answers joint states.
So it ends with the process, however that ends, and where a callback hangs.
"""

from __future__ import annotations

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile

from fault_tolerance.analysis import topics
from fault_tolerance.control.failure_reports import ERROR, WARN

LEASE = 0.6
"""Seconds after which a controller that does not assert its liveliness is taken for dead."""

ALIVE = QoSProfile(
    depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL,
    liveliness=LivelinessPolicy.MANUAL_BY_TOPIC, liveliness_lease_duration=Duration(seconds=LEASE),
)
"""The quality of ``~/status``."""


def living_publisher(node: Node) -> Publisher:
    """Return the publisher of ``~/status``, alive while the ``node`` is spun."""
    publisher = node.create_publisher(DiagnosticStatus, '~/status', ALIVE)
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    node.create_timer(LEASE / 6.0, publisher.assert_liveliness, clock=steady)
    return publisher


class Heartbeat:
    """Notices when the controller in the namespace of ``node`` ends, dies or hangs.

    `on_change` is called when the controller disappears or returns; the owner sets it.
    """

    def __init__(self, node: Node) -> None:
        self.on_change = lambda: None
        self._name = node.resolve_topic_name(topics.STATUS).rpartition('/')[0]
        self._gone: tuple[int, str] | None = None
        events = SubscriptionEventCallbacks(liveliness=self._on_liveliness)
        node.create_subscription(
            DiagnosticStatus, topics.STATUS, lambda _: None, ALIVE, event_callbacks=events
        )

    def told(self, level: int, text: str) -> tuple[int, str]:
        """Return ``level`` and ``text`` of a status, or that the controller is gone."""
        return self._gone or (level, text)

    def _on_liveliness(self, event: Any) -> None:
        before = self._gone
        if event.alive_count:
            self._gone = None
        elif event.not_alive_count_change > 0:
            self._gone = ERROR, f'the controller {self._name} has died or hangs'
        elif event.alive_count_change < 0:
            self._gone = WARN, f'the controller {self._name} has ended'
        if self._gone != before:
            self.on_change()
