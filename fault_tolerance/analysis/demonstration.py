# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: what is broken in which order, and what comes out of its recordings."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from fault_tolerance.analysis.phases import Phase
from fault_tolerance.analysis.runs import RECOVERED, UNRECOVERED, Run

RECOVERED_FACTOR = 1.5
RECOVERED_MARGIN = 20e-6
"""A phase counts as recovered with an error of so many times the healthy one plus so many rad.

Every millisecond by which a busy machine delays the loop costs 5 urad, in one phase and not in
another; an unrecovered strut costs 350 urad and more."""


PHASES = (
    Phase('healthy'),
    Phase('theta_4 stuck', (('position', 'theta_4'),)),
    Phase('theta_2 free', (('torque', 'theta_2'),)),
    Phase('strut_3 lost', (('hard', 'strut_3'),)),
    Phase('theta_1 stuck, theta_3 free', (('position', 'theta_1'), ('torque', 'theta_3'))),
    Phase('theta_1, theta_2 stuck', (('position', 'theta_1'), ('position', 'theta_2'))),
)
"""The acts, with everything mended and cleared between two of them."""


def summary(run: Run) -> dict[str, Any]:
    """Return what a run showed, as plain data for JSON.

    ``tolerable`` is what the theory says, and null for a mechanism that is not known here.
    """
    phases = []
    for records in zip(*run.passes.values(), strict=True):
        by_pass = dict(zip(run.passes, records, strict=True))
        first = records[0]
        phases.append(
            {
                'name': first.phase.name,
                'failures': [
                    {'name': name, 'mode': mode} for mode, name in first.phase.failures
                ],
                'state': first.state,
                'tolerable': run.is_tolerable(first.phase),
                'error_rms_urad': {
                    name: _plain(1e6 * record.error_rms(run.period))
                    for name, record in by_pass.items()
                },
                'peak_force': {
                    name: _plain(record.peak_force) for name, record in by_pass.items()
                },
                'measures': {name: _plain(value) for name, value in first.measures.items()},
            }
        )
    return {'mechanism': run.mechanism_name, 'period': run.period, 'phases': phases}


def unrecovered_phases(result: dict[str, Any]) -> list[str]:
    """Return what is wrong with the phases of ``result``; empty if all went as the theory says."""
    phases = result['phases']
    healthy = phases[0]['error_rms_urad'][RECOVERED]
    wrong = []
    for phase in phases:
        wanted = 'stopped'
        if phase['tolerable']:
            wanted = 'degraded' if phase['failures'] else 'nominal'
            error = phase['error_rms_urad'][RECOVERED]
            limit = RECOVERED_FACTOR * (healthy or 0.0) + 1e6 * RECOVERED_MARGIN
            if error is None or error > limit:
                wrong.append(f'{phase["name"]}: pointing error {error} urad, limit {limit:.1f}')
        if phase['state'] != wanted:
            wrong.append(f'{phase["name"]}: state {phase["state"]}, expected {wanted}')
    return wrong


def summary_table(result: dict[str, Any]) -> Table:
    """Return the summary for people, to be printed with rich."""
    phases = result['phases']
    both = any(UNRECOVERED in phase['error_rms_urad'] for phase in phases)
    title = 'With recovery, and without (in brackets)' if both else None
    table = Table(box=box.SIMPLE_HEAD, title=title)
    table.add_column('phase')
    table.add_column('state')
    for heading in ('p', 't', 'h', 'error rms, urad', 'largest force, N'):
        table.add_column(heading, justify='right')
    for phase in phases:
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
    """Return the value of the first pass, and that without recovery in brackets."""
    first = _number(next(iter(values.values())), form)
    if UNRECOVERED not in values or len(values) == 1:
        return first
    return f'{first} ({_number(values[UNRECOVERED], form)})'


def _number(value: float | None, form: str) -> str:
    return '-' if value is None else format(value, form)


def _plain(value: float) -> float | None:
    """Return None for a number JSON cannot hold."""
    return float(value) if np.isfinite(value) else None
