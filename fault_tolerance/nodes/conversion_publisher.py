# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Brakes and releases that the controller asks for, as messages."""

from __future__ import annotations

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Float64MultiArray

from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.messages import labelled_array_to_msg
from fault_tolerance.nodes.spinning import Deferred
from fault_tolerance.nodes.timeline import TimeLine

PERIOD = 1.0
"""Seconds between two publications."""

BRAKES, RELEASES = 'brake_commands', 'release_commands'


class ConversionPublisher:
    """Publishes ``~/brake_commands`` and ``~/release_commands`` on change and once a second.

    They have the parts of the mechanism file that have a brake or can be released, 1 where it is
    to be engaged. A mechanism without such parts has no such topics.

    Parameters
    ----------
    node : Node
    supervisor : Supervisor
        Whose failures are looked at, each time they have changed.
    deferred : Deferred
        Gets that work: it must not delay a command.
    timeline : TimeLine
    health : Health
        Tells of what nobody confirms.
    """

    def __init__(
        self,
        node: Node,
        supervisor: Supervisor,
        deferred: Deferred,
        timeline: TimeLine,
        health: Health,
    ) -> None:
        self._node, self._supervisor, self._deferred = node, supervisor, deferred
        self._timeline, self._health = timeline, health
        self._converter = converter = supervisor.converter
        parts = {BRAKES: converter.brakes, RELEASES: converter.releases}
        self._publishers: list[tuple[Publisher, tuple[str, ...]]] = [
            (node.create_publisher(Float64MultiArray, f'~/{topic}', 10), names)
            for topic, names in parts.items() if names
        ]
        self._judged: object = None
        if self._publishers:
            node.create_timer(PERIOD, self._repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def update(self) -> None:
        """Look at the failures of the last step, later, if they have changed."""
        if self._publishers and self._supervisor.output.failures is not self._judged:
            self._judged = self._supervisor.output.failures
            self._deferred.add(self._consider)

    def _consider(self) -> None:
        if self._converter.consider(self._supervisor.output, self._timeline.now()):
            self._node.get_logger().warning(f'conversion: {self._converter}')
            self._publish()

    def _repeat(self) -> None:
        self._health.warn(self._converter.overdue(self._timeline.now()))
        self._publish()

    def _publish(self) -> None:
        engaged = self._converter.engaged
        for publisher, names in self._publishers:
            publisher.publish(labelled_array_to_msg({
                name: 1.0 if name in engaged else 0.0 for name in names
            }))
