# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""State and metrics, told after the command they go with."""

from __future__ import annotations

from collections.abc import Iterator
from time import monotonic

from rclpy.node import Node

from fault_tolerance.control.metrics import Metrics
from fault_tolerance.control.output import Output
from fault_tolerance.control.recovery import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.nodes.idle import Job
from fault_tolerance.nodes.messages import decimal
from fault_tolerance.nodes.publishing import MetricsPublisher

DISCOVERY = 2.0
"""Seconds after the start for which nothing is said of waiting.

Publishers that are there already may take that long to be discovered (the middleware repeats
itself every three seconds): until then that nothing has arrived means nothing.
"""


_NO_MORE = object()


class Teller:
    """Publishes and logs what has changed, and the metrics.

    Parameters
    ----------
    node : Node
    supervisor : Supervisor
    metrics : MetricsPublisher

    Attributes
    ----------
    changes : Job
        Tells of a new state or new failures, at once.
    measures : Job
        Works out the metrics, and then publishes them: as soon as there is time for each.
    report_stamp : str
        Stamp of the last report that changed anything.
    """

    def __init__(self, node: Node, supervisor: Supervisor, metrics: MetricsPublisher) -> None:
        self.changes = Job(self._tell, urgent=True)
        self.measures = Job(self._measure)
        self.report_stamp = ''
        self._node = node
        self._supervisor = supervisor
        self._metrics = metrics
        self._told: tuple[object, ...] = ()
        self._pieces: Iterator[Metrics | None] | None = None
        self._worked_out: Metrics | None = None
        self._publishing: Iterator[None] | None = None
        self._discovered = monotonic() + DISCOVERY

    @property
    def discovering(self) -> bool:
        """Whether what has not been heard of yet may be there all the same."""
        return monotonic() < self._discovered

    def note(self, output: Output) -> None:
        """See whether there is anything to tell."""
        if (output.state, output.failures) == self._told:
            return
        if output.state is not State.WAITING or not self.discovering:
            self.changes.due = True

    def no_longer_wait(self) -> None:
        """Tell what is due, or do a piece of it: there has been no idle time for so long."""
        if self.changes.due:
            self.changes.do()
        elif self.measures.due:
            self.measures.do()

    def next_metrics(self) -> None:
        """Have the metrics published; those of the last time now, if they are still due."""
        self._metrics.look_for_listeners()
        while self.measures.due:
            self.measures.do()
        self.measures.due = True

    def _tell(self) -> bool:
        output = self._supervisor.output
        if (output.state, output.failures) != self._told:
            if output.state not in self._told:
                self._metrics.publish_state(output.state.value)
            self._told = (output.state, output.failures)
            self._node.get_logger().info(f'{output.state.value}: {output.reason}')
            self._metrics.look_for_listeners()
            self._pieces = self._worked_out = self._publishing = None
            self.measures.due = True
        return False

    def _measure(self) -> bool:
        if not self._metrics.heard:
            return False
        if self._publishing is not None:
            if next(self._publishing, _NO_MORE) is None:
                return True
            self._publishing = None
            return False
        if self._pieces is None:
            self._pieces = self._supervisor.metrics_by_pieces()
        if self._worked_out is None:
            self._worked_out = next(self._pieces)
            return True
        residual = ', '.join(map(decimal, self._supervisor.output.residual.tolist()))
        further = {'residual': residual, 'report_stamp': self.report_stamp}
        stamp = self._node.get_clock().now().to_msg()
        self._publishing = self._metrics.publishing(stamp, self._worked_out, further)
        self._pieces = self._worked_out = None
        return True
