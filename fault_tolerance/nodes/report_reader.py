# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From serialised diagnostics to the failure reports in them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message

from fault_tolerance.control.notices import Notice
from fault_tolerance.control.reports import Report, report_of
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.inbox import ReportInbox
from fault_tolerance.nodes.messages import modes_from_msg
from fault_tolerance.nodes.serialised_diagnostics import StampedModes, modes_in
from fault_tolerance.nodes.timeline import TimeLine


class Batch(NamedTuple):
    """The failure reports of one message, and its stamp (or the time of receipt)."""

    reports: list[Report]
    sec: int
    nanosec: int

    @property
    def stamp(self) -> str:
        """The stamp as text."""
        return f'{self.sec}.{self.nanosec:09d}'


class ReportReader:
    """Reads failure reports on one mechanism from the diagnostics of everybody.

    Parameters
    ----------
    mechanism : Mechanism
    prefix : str
        Of the hardware ids meant for it; empty: any.
    line : TimeLine
    health : Health
        Is told what could not be read.
    """

    def __init__(
        self, mechanism: Mechanism, prefix: str, line: TimeLine, health: Health
    ) -> None:
        self._names = frozenset((*mechanism.actuator_names, *mechanism.strut_names))
        self._prefix = prefix
        self._line = line
        self._health = health
        self._inbox = ReportInbox(self._names)
        # The first message takes long, as code is loaded for it: so that is not a failure report.
        first = serialize_message(DiagnosticArray(status=[DiagnosticStatus()]))
        modes_in(first)
        _decoded(first)

    def put(self, raw: bytes) -> None:
        """Take a serialised message."""
        dropped = self._inbox.dropped
        self._inbox.put(raw, self._line.now())
        if self._inbox.dropped > dropped:
            text = 'more diagnostics with failure reports than can be read: some are left aside'
            self._health.remark(Notice('flood', text))

    def forget_repeats(self) -> None:
        """Read the next message even if it is a repeat: something has changed."""
        self._inbox.forget()

    def batches(self) -> Iterator[Batch]:
        """Yield the reports of the messages whose turn it is.

        What is done with one before the next is asked for counts as time spent on it.
        """
        begin = self._line.now()
        while (raw := self._inbox.next(begin)) is not None:
            try:
                found = modes_in(raw) or _decoded(raw)
            except Exception as error:  # the middleware's own, for bytes that are no such message
                text = f'diagnostics that cannot be decoded: {error}'
                self._health.remark(Notice('undecodable', text))
            else:
                batch = self._batch(found)
                if batch.reports:
                    yield batch
            end = self._line.now()
            self._inbox.spent(end - begin)
            begin = end

    def _batch(self, message: StampedModes) -> Batch:
        placed = self._line.placed(message)
        stamp = message if placed is not None else self._line.stamp()
        reports = []
        for mode in message.modes:
            report = report_of(*mode, placed, prefix=self._prefix, names=self._names)
            if report is not None:
                reports.append(report)
        return Batch(reports, stamp.sec, stamp.nanosec)


def _decoded(raw: bytes) -> StampedModes:
    message = deserialize_message(raw, DiagnosticArray)
    stamp = message.header.stamp
    return StampedModes(stamp.sec, stamp.nanosec, list(modes_from_msg(message)))
