# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A run in phases: during each the failures stay the same."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import groupby
from math import nan

import numpy as np

from fault_tolerance.analysis.recorded_data import Found, Recording
from fault_tolerance.analysis.recorded_verdicts import Health
from fault_tolerance.analysis.series import Series
from fault_tolerance.analysis.snapshot import WORDS
from fault_tolerance.kinematics.conversion import best_conversion
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

LISTENING = 0.5
"""Seconds before a phase over which the preload of the struts is taken."""

_SHORTEST = 0.3
# Nanoseconds; a note that says to be older was written by another clock.
_SAME_CLOCK = 1_000_000_000
TOLERANCES = ('position_tolerance', 'torque_tolerance', 'hard_tolerance')
"""The metrics with the worst p, t and h of a next failure."""

MEASURES = (*TOLERANCES, 'retained_manipulability')
"""The columns of `PhaseRecord.course`."""


@dataclass(frozen=True)
class Phase:
    """A set of ``failures`` (mode, name) present for some time; its ``name`` is for the table.

    Of ``silent`` ones the drives report nothing. Where it ``converts``, brakes and releases make
    the best of them (the second pass of a demonstration, without recovery, has none).
    """

    name: str
    failures: tuple[tuple[str, str], ...] = ()
    silent: bool = False
    converts: bool = False

    @property
    def words(self) -> tuple[str, ...]:
        """The same in the words of the fault injection topic."""
        silent = 'silent ' if self.silent else ''
        return tuple(f'{silent}{mode} {name}' for mode, name in self.failures)

    @property
    def mending(self) -> tuple[str, ...]:
        """The words that repair all of it."""
        return tuple(f'ok {name}' for _, name in self.failures)

    def is_tolerable(self, mechanism: Mechanism) -> bool:
        """Return what the theory says of ``mechanism``, at home."""
        failures, rows = failure_set(mechanism, self.failures), home_rows(mechanism)
        if self.converts:
            return best_conversion(rows, failures).best.verdict.tolerable
        return reconfigured(rows, failures).verdict.tolerable


@dataclass(frozen=True, eq=False)
class PhaseRecord:
    """The recorded data of one phase; times in seconds from its beginning.

    It begins when the operator injects the failures.

    ``state`` and ``measures`` are the controller's state and metrics at its end. Errors count
    after ``settled`` seconds. ``error`` and ``reference`` are angles about x and y (k, 2),
    radians, ``rates`` those commanded, ``efforts`` the forces of the actuators, newtons, and
    ``preload`` (N,) their mean before the phase, or where nothing is before, at its beginning.
    ``course`` has the columns `MEASURES`: the worst p, t and h of a next failure, and the
    manipulability retained. ``found`` is what detection
    said first, acted on if it acts, its time from where the failure began: the beginning of the
    phase, or in a run without notes where detection thinks that it was. ``setpoints`` are the
    rates commanded with the controller's stamps, from some time before the phase.
    """

    phase: Phase
    state: str
    duration: float
    settled: float
    error: Series
    reference: Series
    rates: Series
    efforts: Series
    preload: FloatArray
    course: Series
    measures: dict[str, float]
    setpoints: Series
    found: Found | None = None

    @property
    def path(self) -> Series:
        """Where the mirror pointed, radians about x and y."""
        return self.reference.minus(self.error)

    @property
    def forces(self) -> Series:
        """The largest of the forces beyond the preload, newtons, one column.

        Without rows where there is nothing that measures forces: all are zero, or not a number.
        """
        if not (np.isfinite(self.efforts.values) & (self.efforts.values != 0.0)).any():
            return Series(np.zeros(0), np.zeros((0, 1)))
        beyond = np.abs(self.efforts.values - self.preload)
        return Series(self.efforts.time, np.fmax.reduce(beyond, axis=1)[:, None])

    def error_rms(self, period: float | None) -> float:
        """Return the median over whole periods of the rms error, radians.

        ``period`` (s) is that of the reference; without it: the rms of all that counts.
        """
        squares = np.sum(self.error.values**2, axis=1)
        since = self.error.time - self.settled
        if period is None:
            counted = squares[since >= 0.0]
            return float(np.sqrt(counted.mean())) if counted.size else nan
        counts = range(int(np.floor((since.max(initial=-1.0) + 0.05 * period) / period)))
        windows = [(since >= n * period) & (since < (n + 1) * period) for n in counts]
        values = [np.sqrt(np.mean(squares[window])) for window in windows if window.any()]
        return float(np.median(values)) if values else nan

    @property
    def peak_force(self) -> float:
        """The largest force beyond the preload, newtons."""
        values = self.forces.values
        known = values[np.isfinite(values)]
        return float(known.max()) if known.size else nan


@dataclass(frozen=True)
class Note:
    """The operator's note at the beginning of a ``phase``.

    Errors count after ``settled`` seconds; ``period`` is the seconds that the reference takes.
    ``stamp`` is when it was written, nanoseconds; 0 if not known.
    """

    phase: Phase
    settled: float
    period: float
    stamp: int = 0


def note_as_text(note: Note) -> str:
    """Return the text of ``note`` that `note_from_text` understands."""
    timing = {'settled': note.settled, 'period': note.period, 'stamp': note.stamp}
    return json.dumps({**asdict(note.phase), **timing})


def note_from_text(text: str) -> Note | None:
    """Return the note in ``text``; None for the end of a phase, and for text that is no note."""
    try:
        content = json.loads(text)
        failures = tuple((str(mode), str(name)) for mode, name in content['failures'])
        how = (bool(content.get(key)) for key in ('silent', 'converts'))
        phase = Phase(str(content['name']), failures, *how)
        stamp = int(content.get('stamp', 0))
        return Note(phase, float(content['settled']), float(content['period']), stamp)
    except (ValueError, KeyError, TypeError):
        return None


def phase_records(recording: Recording) -> tuple[list[PhaseRecord], float | None]:
    """Return the phases of ``recording``, and the period (s) of its reference where it was noted.

    The operator's notes tell where phases begin and end; in a run without them a phase lasts as
    long as the controller's failures and verdict stay the same.
    """
    noted = list(_noted(recording))
    if noted:
        records = [
            _record(recording, note.phase, begin, end, note.settled, begin)
            for note, begin, end in noted
        ]
        return records, noted[0][0].period
    return [
        _record(recording, _phase_of(health), begin, end, 0.0)
        for health, begin, end in _unchanged(recording)
    ], None


def _noted(recording: Recording) -> Iterator[tuple[Note, float, float]]:
    """Yield every noted phase with its beginning and end."""
    ends = [*(text.time for text in recording.phases), recording.end]
    for text, end in zip(recording.phases, ends[1:], strict=False):
        note = note_from_text(text.text)
        if note is not None:
            late = recording.origin + round(1e9 * text.time) - note.stamp
            yield note, text.time - (1e-9 * late if 0 < late < _SAME_CLOCK else 0.0), end


def _unchanged(recording: Recording) -> Iterator[tuple[Health, float, float]]:
    """Yield every stretch in which the controller's verdict stayed the same.

    What lasts too short to be seen is no phase, and does not end the one around it.
    """
    ends = [*(one.time for one in recording.healths[1:]), recording.end]
    together = zip(recording.healths, ends, strict=True)
    alike = [list(group) for _, group in groupby(together, key=_verdict)]
    lasting = [group for group in alike if group[-1][1] - group[0][0].time >= _SHORTEST]
    for _, groups in groupby(lasting, key=lambda group: _verdict(group[0])):
        found = list(groups)
        health = found[0][0][0]
        yield health, health.time, found[-1][-1][1]


def _verdict(stretch: tuple[Health, float]) -> tuple[str, tuple[str, ...]]:
    return stretch[0].state, stretch[0].failures


def _phase_of(health: Health) -> Phase:
    parts = [text.partition(':') for text in health.failures]
    failures = tuple((mode, name) for mode, _, name in parts)
    words = ', '.join(f'{name} {WORDS.get(mode, mode)}' for mode, name in failures)
    return Phase(words or health.state or 'all of it', failures)


def _record(
    recording: Recording, phase: Phase, begin: float, end: float, settled: float,
    injected: float | None = None,
) -> PhaseRecord:
    setpoints = recording.setpoints.since(begin - LISTENING, end)
    before = recording.efforts.since(begin - LISTENING, begin).values
    if not len(before):  # the recording begins with this phase
        before = recording.efforts.since(begin, begin + LISTENING).values
    # At the end of a phase; of its own without notes, where it is that of the verdict.
    state = [one.text for one in recording.states if one.time < end]
    if injected is None or not state:
        state = [one.state for one in recording.healths if one.time < end]
    measures = {name: one.since(0.0, end).values for name, one in recording.scalars.items()}
    return PhaseRecord(
        phase=phase,
        state=state[-1] if state else '',
        duration=end - begin,
        settled=settled,
        error=recording.error.since(begin, end),
        reference=recording.reference.since(begin, end),
        rates=recording.rates.since(begin, end),
        efforts=recording.efforts.since(begin, end),
        preload=before.mean(axis=0) if before.size else np.zeros(before.shape[1]),
        course=_course(recording.scalars, begin, end),
        measures={name: float(one[-1, 0]) for name, one in measures.items() if len(one)},
        setpoints=Series(setpoints.time - LISTENING, setpoints.values),
        found=_first_found(recording.found, begin, end, injected),
    )


def _first_found(
    found: tuple[Found, ...], begin: float, end: float, injected: float | None
) -> Found | None:
    """Return what was found first between ``begin`` and ``end``, acted on if any was.

    Where it is not known when a failure was ``injected`` it may have been found just before a
    phase begins: the phase begins with the verdict.
    """
    since = begin - (LISTENING if injected is None else 0.0)
    inside = [one for one in found if since <= one.time < end]
    if not inside:
        return None
    one = min(inside, key=lambda one: (not one.acted, one.time))
    start = one.onset if injected is None else injected
    return one._replace(time=one.time - start, onset=one.onset - start)


def _course(scalars: Mapping[str, Series], begin: float, end: float) -> Series:
    """Return the measures over time; the controller publishes all of them at a time."""
    chosen = [scalars[name].since(begin, end) for name in MEASURES]
    count = min(len(one) for one in chosen)
    return Series(chosen[0].time[:count], np.hstack([one.values[:count] for one in chosen]))
