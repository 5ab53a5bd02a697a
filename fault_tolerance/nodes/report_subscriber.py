# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller's subscription to diagnostics: from serialised messages to failure reports."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from fault_tolerance.control.failure_reports import (
    ERROR,
    Report,
    part_names,
    report_of,
    target_of,
)
from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.detection.suspicion import DETECTION
from fault_tolerance.kinematics.failures import FailureMode
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.cdr import UNDECODABLE
from fault_tolerance.nodes.diagnostics_queue import DiagnosticsQueue
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.messages import (
    FAILURE_MODE_KEY,
    diagnostics_to_msg,
    modes_from_msg,
    status_to_msg,
)
from fault_tolerance.nodes.serialised_diagnostics import StampedModes, modes_in
from fault_tolerance.nodes.timeline import TimeLine


class Batch(NamedTuple):
    """The failure reports of one message, and its stamp or time of receipt."""

    reports: list[Report]
    stamp: Time | StampedModes


class ReportSubscriber:
    """Reads the failure reports on one mechanism from everybody's diagnostics.

    Reports count whose hardware id begins with ``prefix``; empty: any. ``health`` counts and logs
    messages that could not be read. ``apply`` is called with every `Batch`; its time counts
    towards the share that reading may take, see `MAX_COMMAND_DEBT`.
    """

    def __init__(
        self, node: Node, mechanism: Mechanism, topic: str, prefix: str,
        timeline: TimeLine, health: Health, apply: Callable[[Batch], None],
    ) -> None:
        self._names = part_names(mechanism)
        self._prefix = prefix
        self._timeline = timeline
        self._health = health
        self._apply = apply
        self._queue = DiagnosticsQueue(self._names)
        values = {FAILURE_MODE_KEY: FailureMode.POSITION.value}
        status = status_to_msg('rehearsal', mechanism.actuator_names[0], ERROR, '', values)
        self._sample = serialize_message(diagnostics_to_msg(timeline.stamp(), [status]))
        _decoded(self._sample)  # the first message loads the type support
        node.create_subscription(DiagnosticArray, topic, self.on_diagnostics, 100, raw=True)

    def on_diagnostics(self, raw: bytes) -> None:
        """Queue a serialised DiagnosticArray, ``raw``, and read what there is time for."""
        dropped = self._queue.dropped
        self._queue.put(raw, self._timeline.now())
        if self._queue.dropped > dropped:
            text = 'more diagnostics with failure reports than can be read: some are dropped'
            self._health.warn(Notice('flood', text))
        self.read()

    def forget_repeats(self) -> None:
        """Read the next message even if it repeats an earlier one."""
        self._queue.forget_repeats()

    def rehearsal(self) -> Batch:
        """Return what is read from a made-up report: see `Supervisor.rehearse`."""
        queue, now = DiagnosticsQueue(self._names), self._timeline.now()
        queue.put(self._sample, now)
        raw = queue.pop(now) or self._sample
        return self._batch(modes_in(raw) or _decoded(raw))

    def read(self) -> None:
        """Read queued messages while the time budget lasts."""
        begin = self._timeline.now()
        while (raw := self._queue.pop(begin)) is not None:
            batch = None
            try:
                message = modes_in(raw) or _decoded(raw)
            except UNDECODABLE as error:
                text = f'diagnostics that cannot be decoded: {error}'
                self._health.warn(Notice('undecodable', text))
            else:
                batch = self._batch(message)
            read = self._timeline.now()
            if batch and batch.reports:
                self._apply(batch)
            end = self._timeline.now()
            self._queue.charge(read - begin, end - read)
            begin = end

    def _batch(self, message: StampedModes) -> Batch:
        seconds, reports = self._timeline.monotonic(message), []
        for name, hardware_id, level, mode in message.modes:
            if mode is None:
                self._warn_of_no_mode(name, hardware_id)
            elif name != DETECTION:  # what the controller has found itself it knows already
                report = report_of(
                    name, hardware_id, level, mode, seconds, prefix=self._prefix,
                    names=self._names,
                )
                if report is not None:
                    reports.append(report)
        return Batch(reports, message if seconds is not None else self._timeline.stamp())

    def _warn_of_no_mode(self, name: str, hardware_id: str) -> None:
        """Tell once of each part whose ERROR cannot be a failure report."""
        part = target_of(hardware_id, self._prefix, self._names)
        if part is not None:
            text = (
                f'{part}: {clean(name)!r} reports an ERROR without the key failure_mode '
                '(position, torque, hard or none): no failure is assumed'
            )
            self._health.warn_once('no_failure_mode', text, part)


def _decoded(raw: bytes) -> StampedModes:
    message = deserialize_message(raw, DiagnosticArray)
    stamp = message.header.stamp
    return StampedModes(stamp.sec, stamp.nanosec, list(modes_from_msg(message)))
