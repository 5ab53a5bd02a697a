# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A run cut into phases: in each of them the same things are broken."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import nan

import numpy as np

from fault_tolerance.analysis.recording import Health, Recording
from fault_tolerance.analysis.series import Series
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

LISTENING = 0.5
"""Seconds before a phase over which the preload of the struts is taken."""

_SHORTEST = 0.3
MEASURES = (
    'position_tolerance',
    'torque_tolerance',
    'hard_tolerance',
    'retained_manipulability',
)
"""The columns of `PhaseRecord.course`."""

_WORDS = {'position': 'stuck', 'torque': 'free', 'hard': 'lost'}


@dataclass(frozen=True)
class Phase:
    """What is broken for a while.

    Attributes
    ----------
    name : str
        For the table.
    failures : tuple of (str, str)
        Mode and name of everything broken in it.
    """

    name: str
    failures: tuple[tuple[str, str], ...] = ()

    @property
    def words(self) -> tuple[str, ...]:
        """The same in the words of the fault injection topic."""
        return tuple(f'{mode} {name}' for mode, name in self.failures)

    def failure_set(self, mechanism: Mechanism) -> FailureSet:
        """Return the failures as a set."""
        return failure_set(mechanism, self.failures)

    def is_tolerable(self, mechanism: Mechanism) -> bool:
        """Return what the theory says, at home."""
        state = reconfigured(home_rows(mechanism), self.failure_set(mechanism))
        return state.verdict.tolerable


@dataclass(frozen=True, eq=False)
class PhaseRecord:
    """What was seen of one phase; times in seconds from its beginning.

    Attributes
    ----------
    phase : Phase
    state : str
        The controller's, at its end.
    duration : float
        Seconds.
    settled : float
        Seconds after which the error counts.
    error, reference : Series
        Pointing error and reference about x and y, radians, at the same times.
    rates : Series
        Commanded rates of the actuators.
    efforts : Series
        Actuator forces, newtons.
    preload : (N,) array
        Mean forces before it.
    course : Series
        The worst p, t and h of a next failure, and the manipulability retained.
    measures : dict of str to float
        The controller's metrics by name, at its end.
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

    @property
    def path(self) -> Series:
        """Where the mirror pointed, radians about x and y."""
        return self.reference.minus(self.error)

    @property
    def forces(self) -> Series:
        """The largest of the forces beyond the preload, newtons, one column."""
        beyond = np.abs(self.efforts.values - self.preload)
        return Series(self.efforts.time, beyond.max(axis=1, initial=0.0)[:, None])

    def error_rms(self, period: float | None) -> float:
        """Return the median over whole periods (s) of the rms error, radians.

        Without a period: the rms of all that counts.
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
        return float(values.max()) if values.size and self.preload.size else nan


@dataclass(frozen=True)
class Note:
    """What an operator notes at the beginning of a phase.

    Attributes
    ----------
    phase : Phase
    settled : float
        Seconds after which the error counts.
    period : float
        Seconds the reference takes.
    """

    phase: Phase
    settled: float
    period: float


def note_as_text(note: Note) -> str:
    """Return the text that `note_from_text` understands."""
    content = {
        'name': note.phase.name,
        'failures': [list(failure) for failure in note.phase.failures],
        'settled': note.settled,
        'period': note.period,
    }
    return json.dumps(content)


def note_from_text(text: str) -> Note | None:
    """Return what was noted; None for the end of a phase, and for what nobody can read."""
    try:
        content = json.loads(text)
        failures = tuple((str(mode), str(name)) for mode, name in content['failures'])
        phase = Phase(str(content['name']), failures)
        return Note(phase, float(content['settled']), float(content['period']))
    except (ValueError, KeyError, TypeError):
        return None


def phase_records(recording: Recording) -> tuple[list[PhaseRecord], float | None]:
    """Return the phases of a run, and the period of its reference where that was noted.

    The operator's notes tell where phases begin and end; in a run without them a phase lasts as
    long as the controller's failures and verdict stay the same.
    """
    noted = list(_noted(recording))
    if noted:
        records = [
            _record(recording, note.phase, begin, end, note.settled) for note, begin, end in noted
        ]
        return records, noted[0][0].period
    return [
        _record(recording, _phase_of(health), begin, end, 0.0)
        for health, begin, end in _unchanged(recording)
        if end - begin >= _SHORTEST
    ], None


def _noted(recording: Recording) -> Iterator[tuple[Note, float, float]]:
    """Yield every noted phase with its beginning and end."""
    ends = [*(text.time for text in recording.phases), recording.end]
    for text, end in zip(recording.phases, ends[1:], strict=False):
        note = note_from_text(text.text)
        if note is not None:
            yield note, text.time, end


def _unchanged(recording: Recording) -> Iterator[tuple[Health, float, float]]:
    """Yield every stretch in which the controller's verdict stayed the same."""
    health, begin = None, 0.0
    for one in recording.healths:
        if health is None or (one.state, one.failures) != (health.state, health.failures):
            if health is not None:
                yield health, begin, one.time
            health, begin = one, one.time
    if health is not None:
        yield health, begin, recording.end


def _phase_of(health: Health) -> Phase:
    failures = tuple(
        (mode, name) for mode, _, name in (text.partition(':') for text in health.failures)
    )
    words = ', '.join(f'{name} {_WORDS.get(mode, mode)}' for mode, name in failures)
    return Phase(words or health.state, failures)


def _record(
    recording: Recording, phase: Phase, begin: float, end: float, settled: float
) -> PhaseRecord:
    before = recording.efforts.since(begin - LISTENING, begin).values
    error = recording.error.since(begin, end)
    state = [one.text for one in recording.states if one.time < end]
    measures = {name: _last(one.since(0.0, end)) for name, one in recording.scalars.items()}
    return PhaseRecord(
        phase=phase,
        state=state[-1] if state else '',
        duration=end - begin,
        settled=settled,
        error=error,
        reference=recording.reference.since(begin, end),
        rates=recording.rates.since(begin, end),
        efforts=recording.efforts.since(begin, end),
        preload=before.mean(axis=0) if before.size else np.zeros(before.shape[1]),
        course=_course(recording.scalars, begin, end),
        measures={name: value for name, value in measures.items() if value is not None},
    )


def _last(series: Series) -> float | None:
    return float(series.values[-1, 0]) if len(series) else None


def _course(scalars: Mapping[str, Series], begin: float, end: float) -> Series:
    """Return the measures over time; the controller publishes all of them at a time."""
    chosen = [scalars[name].since(begin, end) for name in MEASURES]
    count = min(len(one) for one in chosen)
    return Series(chosen[0].time[:count], np.hstack([one.values[:count] for one in chosen]))
