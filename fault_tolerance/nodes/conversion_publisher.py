# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Publishes brake and release commands, and what readings show of a brake."""

from __future__ import annotations

from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Float64MultiArray

from fault_tolerance.control.step_output import Output
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.messages import (
    FAILURE_MODE_KEY,
    diagnostics_to_msg,
    labelled_array_to_msg,
    status_to_msg,
)

PERIOD = 1.0
"""Seconds between two publications."""


class ConversionPublisher:
    """Publishes ``~/brake_commands`` and ``~/release_commands`` on change and once a second.

    They have the parts of the mechanism file that have a brake or can be released, 1 where it is
    to be engaged. A mechanism without such parts has no such topics.

    Parameters
    ----------
    node : Node
    supervisor : Supervisor
        Whose failures are looked at.
    health : Health
        Tells of what nobody confirms.
    prefix : str
        Begins the hardware ids, if there is one.
    """

    def __init__(self, node: Node, supervisor: Supervisor, health: Health, prefix: str) -> None:
        self._node, self._supervisor, self._health = node, supervisor, health
        self._converter = converter = supervisor.converter
        parts = {'brake_commands': converter.brakes, 'release_commands': converter.releases}
        self._publishers: list[tuple[Publisher, tuple[str, ...]]] = [
            (node.create_publisher(Float64MultiArray, f'~/{topic}', 10), names)
            for topic, names in parts.items() if names
        ]
        self._prefix = f'{prefix}/' if prefix else ''
        if self._publishers:
            topic = node.get_parameter('diagnostics_topic').value
            self._reports = node.create_publisher(DiagnosticArray, topic, 10)
            node.create_timer(PERIOD, self._repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def update(self) -> None:
        """Look at the failures of the last step, if they have changed: takes milliseconds."""
        if self._converter.consider(self._supervisor.output, monotonic()):
            self._node.get_logger().warning(f'conversion: {self._converter}')
            self._publish()

    def observe(self, output: Output) -> None:
        """Report what the readings of an ``output`` show about a brake, if they do.

        It goes the way of all reports, and comes back: so a recording has it too.
        """
        shown = self._converter.observe(output, monotonic()) if self._publishers else None
        if shown is not None:
            held = 'holds' if shown.mode == 'position' else 'does not hold after all'
            text = f'readings show that the brake of {shown.target} {held}'
            self._node.get_logger().warning(f'conversion: {text}')
            self._reports.publish(diagnostics_to_msg(
                self._node.get_clock().now().to_msg(), [status_to_msg(
                    shown.source[0], f'{self._prefix}{shown.target}', shown.level, text,
                    {FAILURE_MODE_KEY: shown.mode})]))

    def _repeat(self) -> None:
        self.update()
        self._health.warn(self._converter.overdue(monotonic()))
        self._publish()

    def _publish(self) -> None:
        engaged = self._converter.engaged
        for publisher, names in self._publishers:
            publisher.publish(labelled_array_to_msg({
                name: 1.0 if name in engaged else 0.0 for name in names
            }))
