# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The failures in force: what each source has reported, latched until it is cleared.

A failure stays when its reporter falls silent. Different sources add up; the same source (status
name and hardware id) replaces what it said before. One message counts as one statement: where a
source contradicts itself in it, the worse mode holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple

from fault_tolerance.control.failure_reports import STALE, Report, Statement, interpret
from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.control.settings import Settings
from fault_tolerance.kinematics.failures import (
    FailureMode,
    FailureSet,
    actuators_hit,
    failure_set,
)
from fault_tolerance.mechanism.description import Mechanism

REPEAT_WINDOW = 1.5
"""Seconds after a clear during which reports stamped before it are taken for late arrivals."""

CAPACITY = 256
"""Sources told apart. What further ones report adds up, but is not replaced by later reports."""


class LedgerUpdate(NamedTuple):
    """What a message of reports did; true if anything changed."""

    changed: bool
    """Whether the failures in force, or the demand to stop, changed."""
    notices: tuple[Notice, ...] = ()

    def __bool__(self) -> bool:
        return self.changed


@dataclass(frozen=True)
class ClearOutcome:
    """What clearing the failures did."""

    released: tuple[str, ...]
    """Failures that are gone, as text."""
    remaining: tuple[str, ...]
    """Failures that are still reported, or seen by detection."""
    stop_lifted: bool = False
    state: str = ''
    """The state of the controller now."""

    @property
    def success(self) -> bool:
        """Whether anything was released."""
        return bool(self.released) or self.stop_lifted

    @property
    def message(self) -> str:
        """What was released, what is still reported, and the state now."""
        parts = [f'released {", ".join(self.released)}'] if self.released else []
        if self.remaining:
            parts.append(f'still reported: {", ".join(self.remaining)}')
        if not parts:
            parts.append('stop lifted' if self.stop_lifted else 'nothing to release')
        return f'{"; ".join(parts)}; now {self.state}'


class _Entry(NamedTuple):
    """A latched statement, when it was last made, and whether it was taken back since."""

    statement: Statement
    heard: float
    healed: bool = False


_Source = tuple[str, str]


class FailureLedger:
    """Latches failure reports on ``mechanism`` and gives the failures in force.

    Of the ``settings`` it goes by `auto_clear`, `unknown_mode` and `report_timeout`.
    """

    def __init__(self, mechanism: Mechanism, settings: Settings) -> None:
        self._mechanism, self.settings = mechanism, settings
        self._entries: dict[_Source, _Entry] = {}
        self._cleared_at: float | None = None
        self.heard = -inf
        """When a part of the mechanism was last reported on, seconds."""
        self.failures = FailureSet()
        self.stop_reason = ''
        """Why the reports demand a stop by themselves; empty if they do not."""

    def apply(self, reports: Sequence[Report], now: float) -> LedgerUpdate:
        """Take the ``reports`` of one message, received at ``now`` (s); return what they did."""
        failures, stop_reason = self.failures, self.stop_reason
        notices: list[Notice] = []
        message = self._statements(reports, now, notices)
        if message:
            self.heard = now
        changes = False
        for source, (stamp, statement) in message.items():
            changes |= self._latch(source, stamp, statement, notices)
        if changes:
            self._refresh()
            if len(message) > 1:
                notices.extend(self._conflicts(statement for _, statement in message.values()))
        changed = self.failures is not failures or self.stop_reason != stop_reason
        return LedgerUpdate(changed, tuple(notices))

    def clear(self, now: float, seen: Sequence[str] = ()) -> ClearOutcome:
        """Release every failure not still reported at ``now`` (s); return which they are.

        Failures that detection has still ``seen``, as text, are among the remaining ones.
        """
        self._cleared_at = now
        kept = self._reported(now)
        remaining = _texts(kept.values())
        released = tuple(text for text in _texts(self._entries.values()) if text not in remaining)
        self._entries = kept
        self._refresh()
        return ClearOutcome(released, tuple(dict.fromkeys([*remaining, *seen])))

    def still_reported(self, now: float) -> bool:
        """Return whether clearing at ``now`` (s) would leave a failure in force."""
        return bool(self._reported(now))

    def restart_clock(self, now: float) -> None:
        """Forget times later than ``now`` (s): the clock was set back."""
        self._cleared_at, self.heard = None, min(self.heard, now)
        for source, entry in self._entries.items():
            self._entries[source] = entry._replace(heard=min(entry.heard, now))

    def _reported(self, now: float) -> dict[_Source, _Entry]:
        return {
            source: entry
            for source, entry in self._entries.items()
            if not entry.healed and now - entry.heard < self.settings.report_timeout
        }

    def _statements(
        self, reports: Sequence[Report], now: float, notices: list[Notice]
    ) -> dict[_Source, tuple[float, Statement]]:
        """Return what each source states in one message, and since when."""
        message: dict[_Source, tuple[float, Statement]] = {}
        for report in reports:
            given = report.stamp if report.stamp is not None and isfinite(report.stamp) else now
            # A source whose clock is ahead must not count as reporting for longer.
            stamp = min(given, now)
            entry = self._entries.get(report.source)
            statement = _repeated(report, entry) if entry else None
            if statement is None:
                statement, remarks = interpret(
                    report, self._mechanism, self.settings.unknown_mode == 'stop'
                )
                notices.extend(remarks)
            if statement is None:
                continue
            # A late report that a part is healthy is still true.
            if statement.mode is not FailureMode.NONE and self._came_late(stamp, now):
                text = f'{report.target} {report.mode}: reported before the last clear'
                notices.append(Notice('before_clear', clean(text), part=report.target or ''))
                continue
            source = self._key(report.source, statement)
            earlier = message.get(source)
            if earlier and earlier[0] == stamp and earlier[1].severity > statement.severity:
                continue
            message[source] = (stamp, statement)
        return message

    def _came_late(self, stamp: float, now: float) -> bool:
        """Return whether a failure was reported before the last clear, and may be gone."""
        cleared_at = self._cleared_at
        return cleared_at is not None and stamp < cleared_at and now - cleared_at <= REPEAT_WINDOW

    def _key(self, source: _Source, statement: Statement) -> _Source:
        """Return the key of a statement; in a full table sources share one per part and mode."""
        if source in self._entries or len(self._entries) < CAPACITY:
            return source
        return ('', f'{statement.target} {statement.severity}')

    def _latch(
        self, source: _Source, stamp: float, statement: Statement, notices: list[Notice]
    ) -> bool:
        """Keep a statement; return whether it changes anything."""
        entry = self._entries.get(source)
        if statement.mode is not FailureMode.NONE:
            self._entries[source] = _Entry(statement, stamp)
            return entry is None or entry.statement != statement
        if entry and self.settings.auto_clear:
            del self._entries[source]
            return True
        if entry and not entry.healed:
            self._entries[source] = entry._replace(healed=True)
            text = f'{entry.statement.text} is reported healthy, but stays until it is cleared'
            notices.append(Notice('latched', text, False, statement.target))
        return False

    def _refresh(self) -> None:
        """Derive what follows from the entries."""
        known, unknown = [], []
        for entry in self._entries.values():
            target, mode, _ = entry.statement
            if mode is None:
                unknown.append(entry.statement.text)
            else:
                known.append((mode, target))
        failures = failure_set(self._mechanism, known)
        if failures != self.failures:  # others compare it by identity
            self.failures = failures
        self.stop_reason = f'unknown failure mode of {", ".join(unknown)}' if unknown else ''

    def _conflicts(self, statements: Iterable[Statement]) -> Iterator[Notice]:
        """Warn of actuators that one message gives several modes."""
        modes: dict[str, set[FailureMode]] = {}
        for said in statements:
            if said.mode is not None and said.mode is not FailureMode.NONE:
                for name in actuators_hit(self._mechanism, said.mode, said.target):
                    modes.setdefault(name, set()).add(said.mode)
        for name, found in modes.items():
            if len(found) > 1:
                words = ' and '.join(sorted(mode.value for mode in found))
                used = self.failures.mode_of(self._mechanism, name).value
                text = f'{name} is reported as {words} in one message: {used} is used'
                yield Notice('conflicting_modes', text, False, name)


def _repeated(report: Report, entry: _Entry) -> Statement | None:
    """Return the latched statement that a report repeats, if it does."""
    if report.level == STALE:
        return None
    same = (entry.statement.target, entry.statement.word) == (report.target, report.mode)
    return entry.statement if same and not entry.healed else None


def _texts(entries: Iterable[_Entry]) -> tuple[str, ...]:
    """Return each failure once, as text."""
    return tuple(dict.fromkeys(entry.statement.text for entry in entries))
