# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""State, log lines and metrics of the controller, published after the command they belong to."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from fault_tolerance.control.output import Output
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.arrays import decimal
from fault_tolerance.nodes.metrics_publisher import MetricsPublisher
from fault_tolerance.nodes.spinning import Deferred

DISCOVERY = 2.0
"""Seconds after start-up during which the state ``waiting`` is not published.

Discovery of publishers that already run may take that long (the middleware repeats its
announcement every three seconds): until then, silence is no symptom.
"""


class StatusPublisher:
    """Publishes ``~/state`` and logs on change, and publishes the metrics.

    A ``prefix`` begins the hardware ids. ``deferred`` gets work that must not delay a command.
    ``further`` returns what else belongs into the metrics, texts by key. ``report_stamp`` is the
    stamp of the last report that changed anything, seconds as text.
    """

    def __init__(
        self, node: Node, supervisor: Supervisor, prefix: str, deferred: Deferred,
        further: Callable[[], dict[str, str]],
    ) -> None:
        self.report_stamp = ''
        self._node = node
        self._supervisor = supervisor
        self._deferred, self._further = deferred, further
        self._metrics = MetricsPublisher(node, supervisor.mechanism, prefix)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._state = node.create_publisher(String, '~/state', latched)
        self._published: tuple[object, ...] = ()
        self._discovered = monotonic() + DISCOVERY

    @property
    def discovering(self) -> bool:
        """Whether publishers may exist that are not discovered yet."""
        return monotonic() < self._discovered

    def update(self, output: Output) -> None:
        """Defer a publication if state or failures have changed in the ``output`` of a cycle."""
        if (output.state, output.failures) == self._published:
            return
        if output.state is not State.WAITING or not self.discovering:
            self._deferred.add(self._publish_change)

    def _publish_change(self) -> None:
        output = self._supervisor.output
        if (output.state, output.failures) == self._published:
            return
        if output.state not in self._published:
            self._state.publish(String(data=output.state.value))
        self._published = (output.state, output.failures)
        self._node.get_logger().info(f'{output.state.value}: {output.reason}')
        self._deferred.add(self.publish_metrics)

    def publish_metrics(self) -> None:
        """Compute and publish the metrics of the last cycle, if anybody subscribes to them."""
        if self._metrics.subscribed:
            residual = ', '.join(map(decimal, self._supervisor.output.residual.tolist()))
            self._metrics.publish(
                self._node.get_clock().now().to_msg(),
                self._supervisor.metrics(),
                {'residual': residual, 'report_stamp': self.report_stamp, **self._further()},
            )
