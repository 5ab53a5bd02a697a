# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The ledger of failures: what each source has reported, latched until it is cleared.

A failure stays when its reporter falls silent. Different sources add up; the same source (status
name and hardware id) replaces what it said before. One message counts as one statement: where a
source contradicts itself in it, the worse mode holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.control.reports import (
    STALE,
    Report,
    Statement,
    of_every_mode,
    taken_at_its_word,
    understood,
)
from fault_tolerance.kinematics.failures import (
    FailureMode,
    FailureSet,
    actuators_named,
    failure_set,
    strut_named,
)
from fault_tolerance.mechanism.description import Mechanism

REPEAT_WINDOW = 1.5
"""Seconds after a clear during which reports stamped before it are taken for late arrivals."""

CAPACITY = 256
"""Sources told apart; what further ones report adds up, but cannot be replaced any more."""


class LedgerUpdate(NamedTuple):
    """What a message of reports did; true if anything changed.

    Attributes
    ----------
    changed : bool
        Whether the failures in force, or the demand to stop, changed.
    notices : tuple of Notice
    """

    changed: bool
    notices: tuple[Notice, ...] = ()

    def __bool__(self) -> bool:
        return self.changed


@dataclass(frozen=True)
class LedgerClear:
    """What a clear did.

    Attributes
    ----------
    released : tuple of str
        Failures that are gone, as text.
    remaining : tuple of str
        Failures that are still reported.
    """

    released: tuple[str, ...]
    remaining: tuple[str, ...]


class _Entry(NamedTuple):
    """A latched statement, when it was last made, and whether it was taken back since."""

    statement: Statement
    heard: float
    healed: bool = False


_Source = tuple[str, str]


class FailureLedger:
    """Latches failure reports and gives the failures in force.

    Parameters
    ----------
    mechanism : Mechanism
    auto_clear : bool
        Whether a source's word that its part is healthy releases its failure.
    stop_on_unknown_mode : bool
        Whether a mode nobody understands, at level ERROR or above, demands a stop.
    report_timeout : float
        Seconds for which a failure counts as still reported.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        *,
        auto_clear: bool = False,
        stop_on_unknown_mode: bool = True,
        report_timeout: float = 3.0,
    ) -> None:
        self._mechanism = mechanism
        self._parts = of_every_mode(mechanism)
        self._auto_clear = auto_clear
        self._stop_on_unknown_mode = stop_on_unknown_mode
        self._report_timeout = report_timeout
        self._entries: dict[_Source, _Entry] = {}
        self._cleared_at: float | None = None
        self._failures = failure_set(mechanism, [])
        self._stop_reason = ''

    @property
    def failures(self) -> FailureSet:
        """The failures in force."""
        return self._failures

    @property
    def stop_reason(self) -> str:
        """Why the reports demand a stop by themselves; empty if they do not."""
        return self._stop_reason

    def apply(self, reports: Sequence[Report], now: float) -> LedgerUpdate:
        """Take in the reports of one message, received at ``now``."""
        before = (self._failures, self._stop_reason)
        notices: list[Notice] = []
        message = self._statements(reports, now, notices)
        news = [source for source, said in message.items() if self._latch(source, *said, notices)]
        if news:
            self._refresh()
            if len(message) > 1:
                notices.extend(self._conflicts(statement for _, statement in message.values()))
        return LedgerUpdate((self._failures, self._stop_reason) != before, tuple(notices))

    def clear(self, now: float) -> LedgerClear:
        """Release every failure that is not still reported."""
        self._cleared_at = now
        kept = {
            source: entry
            for source, entry in self._entries.items()
            if not entry.healed and now - entry.heard < self._report_timeout
        }
        remaining = _texts(kept.values())
        released = tuple(text for text in _texts(self._entries.values()) if text not in remaining)
        self._entries = kept
        self._refresh()
        return LedgerClear(released, remaining)

    def restart_clock(self, now: float) -> None:
        """Forget times later than ``now``: the clock was set back."""
        self._cleared_at = None
        for source, entry in self._entries.items():
            self._entries[source] = entry._replace(heard=min(entry.heard, now))

    def _statements(
        self, reports: Sequence[Report], now: float, notices: list[Notice]
    ) -> dict[_Source, tuple[float, Statement]]:
        """Return what each source states in one message, and since when."""
        message: dict[_Source, tuple[float, Statement]] = {}
        for report in reports:
            given = report.stamp if report.stamp is not None and isfinite(report.stamp) else now
            # A source whose clock runs ahead must not look as if it went on reporting.
            stamp = min(given, now)
            entry = self._entries.get(report.source)
            statement = _repeated(report, entry) if entry else None
            if statement is None:
                statement = taken_at_its_word(report, self._parts)
            if statement is None:
                statement, remarks = understood(
                    report, self._mechanism, stop_on_unknown_mode=self._stop_on_unknown_mode
                )
                notices.extend(remarks)
            if statement is None:
                continue
            # Good news that comes late is still true.
            if statement.mode is not FailureMode.NONE and self._came_late(stamp, now):
                text = f'{report.target} {report.mode}: reported before the last clear'
                notices.append(Notice('before_clear', clean(text)))
                continue
            source = self._place(report.source, statement)
            earlier = message.get(source)
            if earlier and earlier[0] == stamp and earlier[1].severity > statement.severity:
                continue
            message[source] = (stamp, statement)
        return message

    def _came_late(self, stamp: float, now: float) -> bool:
        """Return whether a failure was reported before the last clear, and may be gone."""
        cleared_at = self._cleared_at
        return cleared_at is not None and stamp < cleared_at and now - cleared_at <= REPEAT_WINDOW

    def _place(self, source: _Source, statement: Statement) -> _Source:
        """Return the key a statement is kept under; past the capacity, one per failure."""
        if source in self._entries or len(self._entries) < CAPACITY:
            return source
        return ('', f'{statement.target} {statement.severity}')

    def _latch(
        self, source: _Source, stamp: float, statement: Statement, notices: list[Notice]
    ) -> bool:
        """Keep a statement; return whether it is news."""
        entry = self._entries.get(source)
        if statement.mode is not FailureMode.NONE:
            self._entries[source] = _Entry(statement, stamp)
            return entry is None or entry.statement != statement
        if entry is None:
            return False
        if self._auto_clear:
            del self._entries[source]
            return True
        if not entry.healed:
            self._entries[source] = entry._replace(healed=True)
            text = f'{entry.statement.text} is reported healthy, but stays until it is cleared'
            notices.append(Notice('latched', text, rejected=False))
        return False

    def _refresh(self) -> None:
        """Derive what follows from the entries."""
        statements = [entry.statement for entry in self._entries.values()]
        known = [(said.mode, said.target) for said in statements if said.mode is not None]
        unknown = [said.text for said in statements if said.mode is None]
        self._failures = failure_set(self._mechanism, known)
        self._stop_reason = f'unknown failure mode of {", ".join(unknown)}' if unknown else ''

    def _conflicts(self, statements: Iterable[Statement]) -> Iterator[Notice]:
        """Warn of actuators that one message gives several modes."""
        modes: dict[str, set[FailureMode]] = {}
        for said in statements:
            if said.mode is not None and said.mode is not FailureMode.NONE:
                for name in self._meant(said):
                    modes.setdefault(name, set()).add(said.mode)
        for name, found in modes.items():
            if len(found) > 1:
                words = ' and '.join(sorted(mode.value for mode in found))
                used = self._failures.mode_of(self._mechanism, name).value
                text = f'{name} is reported as {words} in one message: {used} is used'
                yield Notice('conflicting_modes', text, rejected=False)

    def _meant(self, statement: Statement) -> tuple[str, ...]:
        """Return the actuators a statement is about."""
        if statement.mode is FailureMode.HARD:
            return self._mechanism.actuators_of(strut_named(self._mechanism, statement.target))
        return actuators_named(self._mechanism, statement.target)


def _repeated(report: Report, entry: _Entry) -> Statement | None:
    """Return the latched statement that a report says over again: nothing new, no remarks."""
    if report.level == STALE:
        return None
    same = (entry.statement.target, entry.statement.word) == (report.target, report.mode)
    return entry.statement if same and not entry.healed else None


def _texts(entries: Iterable[_Entry]) -> tuple[str, ...]:
    """Return each failure once, as text."""
    return tuple(dict.fromkeys(entry.statement.text for entry in entries))
