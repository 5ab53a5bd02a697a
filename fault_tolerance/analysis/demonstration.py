# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: what is broken in which order, and what comes out of its recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

RECOVERED_FACTOR = 1.5
RECOVERED_MARGIN = 5e-6
"""A phase counts as recovered with an error of so many times the healthy one plus so many rad:
wide enough for a busy machine, far from what an unrecovered strut costs."""


@dataclass(frozen=True)
class Phase:
    """One act of the demonstration.

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


PHASES = (
    Phase('healthy'),
    Phase('theta_4 stuck', (('position', 'theta_4'),)),
    Phase('theta_2 free', (('torque', 'theta_2'),)),
    Phase('strut_3 lost', (('hard', 'strut_3'),)),
    Phase('theta_1 stuck, theta_3 free', (('position', 'theta_1'), ('torque', 'theta_3'))),
    Phase('theta_1, theta_2 stuck', (('position', 'theta_1'), ('position', 'theta_2'))),
)
"""The acts, with everything mended and cleared between two of them."""


@dataclass(frozen=True, eq=False)
class PhaseRecord:
    """What was seen of one phase.

    Attributes
    ----------
    phase : Phase
    state : str
        The controller's, at its end.
    time : (k,) array
        Seconds since the phase began.
    error : (k, 2) array
        Pointing error about x and y, radians.
    reference : (k, 2) array
        Where the mirror was to point, rotation vector about x and y, radians.
    efforts : (j, N) array
        Actuator forces from the moment of the failure on, newtons.
    preload : (N,) array
        Mean forces before it.
    measures : dict of str to float
        The controller's metrics by name.
    settled : float
        Seconds after which the error counts.
    """

    phase: Phase
    state: str
    time: FloatArray
    error: FloatArray
    reference: FloatArray
    efforts: FloatArray
    preload: FloatArray
    measures: dict[str, float]
    settled: float

    def error_rms(self, period: float) -> float:
        """Return the median over whole periods (s) of the rms error, radians."""
        squares = np.sum(self.error**2, axis=1)
        since = self.time - self.settled
        counts = range(int(np.floor((since.max(initial=-1.0) + 0.05 * period) / period)))
        windows = [(since >= n * period) & (since < (n + 1) * period) for n in counts]
        values = [np.sqrt(np.mean(squares[window])) for window in windows if window.any()]
        return float(np.median(values)) if values else nan

    @property
    def peak_force(self) -> float:
        """The largest force beyond the preload, newtons."""
        return float(np.abs(self.efforts - self.preload).max()) if self.efforts.size else nan


def summary(
    mechanism: Mechanism,
    passes: dict[str, Sequence[PhaseRecord]],
    period: float,
) -> dict[str, Any]:
    """Return what the demonstration showed, as plain data for JSON.

    Parameters
    ----------
    mechanism : Mechanism
    passes : dict of str to sequence of PhaseRecord
        The records 'recovered' and 'unrecovered', of the same phases.
    period : float
        Seconds the reference takes.
    """
    phases = []
    for records in zip(*passes.values(), strict=True):
        by_pass = dict(zip(passes, records, strict=True))
        first = by_pass['recovered']
        phases.append(
            {
                'name': first.phase.name,
                'failures': [
                    {'name': name, 'mode': mode} for mode, name in first.phase.failures
                ],
                'state': first.state,
                'tolerable': first.phase.is_tolerable(mechanism),
                'error_rms_urad': {
                    name: _plain(1e6 * record.error_rms(period))
                    for name, record in by_pass.items()
                },
                'peak_force': {
                    name: _plain(record.peak_force) for name, record in by_pass.items()
                },
                'measures': {name: _plain(value) for name, value in first.measures.items()},
            }
        )
    return {'mechanism': mechanism.name, 'period': period, 'phases': phases}


def unrecovered_phases(result: dict[str, Any]) -> list[str]:
    """Return what is wrong with the phases of ``result``; empty if all went as the theory says."""
    phases = result['phases']
    healthy = phases[0]['error_rms_urad']['recovered']
    wrong = []
    for phase in phases:
        wanted = 'stopped'
        if phase['tolerable']:
            wanted = 'degraded' if phase['failures'] else 'nominal'
            error = phase['error_rms_urad']['recovered']
            limit = RECOVERED_FACTOR * (healthy or 0.0) + 1e6 * RECOVERED_MARGIN
            if error is None or error > limit:
                wrong.append(f'{phase["name"]}: pointing error {error} urad, limit {limit:.1f}')
        if phase['state'] != wanted:
            wrong.append(f'{phase["name"]}: state {phase["state"]}, expected {wanted}')
    return wrong


def summary_table(result: dict[str, Any]) -> Table:
    """Return the summary for people, to be printed with rich."""
    table = Table(box=box.SIMPLE_HEAD, title='With recovery, and without (in brackets)')
    table.add_column('phase')
    table.add_column('state')
    for heading in ('p', 't', 'h', 'error rms, urad', 'largest force, N'):
        table.add_column(heading, justify='right')
    for phase in result['phases']:
        measures = phase['measures']
        table.add_row(
            phase['name'],
            phase['state'],
            *(
                _number(measures.get(name), '.3f')
                for name in ('position_tolerance', 'torque_tolerance', 'hard_tolerance')
            ),
            _both(phase['error_rms_urad'], '.1f'),
            _both(phase['peak_force'], '.2f'),
        )
    table.caption = 'p, t, h: measure of the worst single failure that could come next'
    return table


def _both(values: dict[str, float | None], form: str) -> str:
    return f'{_number(values["recovered"], form)} ({_number(values["unrecovered"], form)})'


def _number(value: float | None, form: str) -> str:
    return '-' if value is None else format(value, form)


def _plain(value: float) -> float | None:
    """Return None for a number JSON cannot hold."""
    return float(value) if np.isfinite(value) else None
