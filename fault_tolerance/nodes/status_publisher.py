# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""State, status, log lines and metrics of the controller, published after their command."""

from __future__ import annotations

import gc
from collections.abc import Callable
from functools import partial
from time import monotonic

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from fault_tolerance.control.failure_reports import ERROR, OK
from fault_tolerance.control.metrics import Metrics
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.step_output import Output
from fault_tolerance.control.supervisor import WAITING, Supervisor
from fault_tolerance.mechanism.arrays import decimal
from fault_tolerance.nodes.conversion_publisher import ConversionPublisher
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.heartbeat import living_publisher
from fault_tolerance.nodes.messages import status_name, status_to_msg
from fault_tolerance.nodes.metrics_publisher import MetricsPublisher
from fault_tolerance.nodes.spinning import Deferred

COUNTED = {State.STOPPED: 'stops', State.HOLD: 'holds'}
"""States whose beginnings are counted on the diagnostics, beside failures."""

METRICS_PERIOD, COLLECTION_PERIOD = 0.2, 5.0
"""Seconds from metrics to metrics, and from one collection of garbage to the next."""

DISCOVERY = 2.0
"""Seconds after start-up during which the state ``waiting`` is not published.

Discovery of publishers that already run may take that long (the middleware repeats its
announcement every three seconds): until then, silence is no symptom.
"""


class StatusPublisher:
    """Publishes ``~/state`` and ``~/status`` and logs on change, and publishes the metrics.

    Level and text are those that ``health`` tells on the diagnostics. A ``prefix`` begins the
    hardware ids. ``deferred`` gets work that must not delay a command. ``suspected`` returns
    what detection suspects, as text, ``further`` what else belongs into the metrics, texts by key,
    ``missing`` what a waiting controller lacks.
    ``report_stamp`` is the stamp of the last report that changed anything, seconds as text.
    """

    def __init__(
        self, node: Node, supervisor: Supervisor, prefix: str, deferred: Deferred,
        health: Health, suspected: Callable[[], str], further: Callable[[], dict[str, str]],
        missing: Callable[[], str],
    ) -> None:
        self.report_stamp = ''
        self._node = node
        self._supervisor = supervisor
        self._health = health
        self._deferred, self._suspected = deferred, suspected
        self._further, self._missing = further, missing
        self._conversions = ConversionPublisher(node, supervisor, health, prefix)
        self._metrics = MetricsPublisher(node, supervisor.mechanism, prefix)
        self._names = status_name(node, 'status'), '/'.join(
            filter(None, (prefix, supervisor.mechanism.name))
        )
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._state = node.create_publisher(String, '~/state', latched)
        self._status = living_publisher(node)
        self._published: tuple[object, ...] = ()
        self._counted = supervisor.output
        self._told: DiagnosticStatus | None = None
        self._metrics_due = self._collection_due = monotonic()
        self._discovered = self._metrics_due + DISCOVERY

    def present(self) -> tuple[int, str]:
        """Return level and text of the controller's own status."""
        output = self._supervisor.output
        return output.level, self._completed(f'{output.state.value}: {output.reason}')

    def _completed(self, text: str) -> str:
        """Return the ``text`` of a status, of a waiting controller with what it lacks."""
        waits = self._supervisor.output.state is State.WAITING
        return text.replace(WAITING, self._missing(), 1) if waits else text

    def update(self, output: Output, now: float) -> None:
        """Defer what the ``output`` of a cycle ``now`` (monotonic seconds) has to be followed by.

        That is a change of state, failures or park move, and what is done periodically: right
        after a command, when most of the period is still ahead.
        """
        self._count(output)
        self._conversions.observe(output)
        changed = (output.state, output.failures, output.parking) != self._published
        if changed and (output.state is not State.WAITING or monotonic() >= self._discovered):
            self._deferred.add(self._publish_change)
        if now >= self._metrics_due:
            self._metrics_due = max(self._metrics_due + METRICS_PERIOD, now)
            self._deferred.add(self._publish_metrics)
        if now >= self._collection_due:
            self._collection_due = now + COLLECTION_PERIOD
            self._deferred.add(gc.collect)

    def _count(self, output: Output) -> None:
        """Count failures, stops and holds that have begun with this ``output``."""
        before, self._counted = self._counted, output
        if output.failures is not before.failures:
            for one in output.failures.failures:
                if one not in before.failures.failures:
                    self._health.count('failures')
        if output.state is not before.state and output.state in COUNTED:
            self._health.count(COUNTED[output.state])

    def _publish_change(self) -> None:
        output = self._supervisor.output
        if (output.state, output.failures, output.parking) == self._published:
            return
        if output.state not in self._published:
            self._state.publish(String(data=output.state.value))
        self._published = (output.state, output.failures, output.parking)
        logger, (level, text) = self._node.get_logger(), self._health.present()
        # Each a line of its own: rclpy knows a logging call by its place.
        if level == ERROR:
            logger.error(text)
        elif level == OK:
            logger.info(text)
        else:
            logger.warning(text)
        self._conversions.update()
        self._deferred.add(self._publish_metrics)

    def _publish_metrics(self) -> None:
        """Publish the status if it has changed, and the metrics if anybody subscribes to them.

        In pieces, so that no joint state is lost for them.
        """
        output = self._supervisor.output
        if self._published:
            self._publish_status(output)
        if self._metrics.subscribed:
            self._deferred.add(partial(self._judge, output))

    def _judge(self, output: Output) -> None:
        self._deferred.add(partial(self._complete, output, self._supervisor.metrics(output)))

    def _complete(self, output: Output, metrics: Metrics) -> None:
        further = self._further() | {
            'residual': ', '.join(map(decimal, output.residual.tolist())),
            'report_stamp': self.report_stamp,
            'conversion': str(self._supervisor.converter),
        }
        self._deferred.add(lambda: self._metrics.publish(
            self._node.get_clock().now().to_msg(), metrics,
            self._health.with_notices(metrics.level, self._completed(metrics.message)), further,
        ))

    def _publish_status(self, output: Output) -> None:
        level, text = self._health.told()
        status = status_to_msg(
            *self._names, level, text.removeprefix(f'{output.state.value}: '),
            {
                'state': output.state.value,
                'failures': ', '.join(map(str, output.failures.failures)),
                'suspected': self._suspected(),
            },
        )
        if status != self._told:
            self._told = status
            self._status.publish(status)
