# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: its phases, and the summary of a recorded run."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.table import Table

from fault_tolerance.analysis.delays import detected, milliseconds
from fault_tolerance.analysis.phases import TOLERANCES, Phase
from fault_tolerance.analysis.runs import RECOVERED, UNRECOVERED, Run
from fault_tolerance.analysis.terminal import number, plain_table

RECOVERED_FACTOR = 1.5
RECOVERED_MARGIN = 20e-6
"""A phase counts as recovered with an error of so many times the healthy one plus so many rad.

Every millisecond by which a busy machine delays the loop costs 5 urad, in one phase and not in
another; an unrecovered strut costs 350 urad and more."""


PHASES = (
    Phase('healthy'),
    Phase('theta_4 stuck, unreported', (('position', 'theta_4'),), silent=True),
    Phase('theta_4 stuck', (('position', 'theta_4'),)),
    Phase('theta_2 free', (('torque', 'theta_2'),)),
    Phase('strut_3 lost', (('hard', 'strut_3'),)),
    Phase('theta_1 stuck, theta_3 free', (('position', 'theta_1'), ('torque', 'theta_3'))),
    Phase(
        'two free drives and a brake', (('torque', 'theta_1'), ('torque', 'theta_3')),
        converts=True,
    ),
    Phase('theta_1, theta_2 stuck', (('position', 'theta_1'), ('position', 'theta_2'))),
)
"""The phases; between two of them everything is mended and cleared."""


def summary(run: Run) -> dict[str, Any]:
    """Return what ``run`` showed, as plain data for JSON: the content of summary.json.

    ``tolerable`` is what the theory says, after brakes and releases where it ``converts``, and
    null for a mechanism that is not known here.
    """
    phases = []
    for records in zip(*run.passes.values(), strict=True):
        by_pass = dict(zip(run.passes, records, strict=True))
        first = records[0]
        phases.append(
            {
                'name': first.phase.name,
                'failures': [{'name': name, 'mode': mode} for mode, name in first.phase.failures],
                'state': first.state,
                'converts': first.phase.converts,
                'tolerable': run.is_tolerable(first.phase),
                'error_rms_urad': {
                    name: _plain(1e6 * one.error_rms(run.period)) for name, one in by_pass.items()
                },
                'detected': detected(run, first),
                'peak_force': {name: _plain(one.peak_force) for name, one in by_pass.items()},
                'measures': {name: _plain(value) for name, value in first.measures.items()},
            }
        )
    return {'mechanism': run.mechanism_name, 'period': run.period, 'phases': phases}


def unrecovered_phases(result: dict[str, Any]) -> list[str]:
    """Return a sentence for each phase of ``result`` (of `summary`) that is not as theory says."""
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
        found = phase['detected']
        if found and found['name'] not in [one['name'] for one in phase['failures']]:
            wrong.append(f'{phase["name"]}: {found["name"]} was suspected ({found["mode"]})')
    return wrong


def summary_table(result: dict[str, Any]) -> Table:
    """Return ``result`` of `summary` for people, to be printed with rich."""
    phases = result['phases']
    both = any(UNRECOVERED in phase['error_rms_urad'] for phase in phases)
    # In the table of two passes there is no room for the measures, in 80 columns.
    measures = () if both else TOLERANCES
    table = plain_table(
        'phase', 'state',
        numbers=('noticed', *(name[0] for name in measures), 'error rms, urad', 'force, N'),
        title='With recovery, and without (in brackets)' if both else None,
        title_justify='center', padding=(0, 1, 0, 0),
        caption=None if both else 'p, t, h: measure of the worst single failure that could come '
        'next',
    )
    for phase in phases:
        table.add_row(
            phase['name'], phase['state'], milliseconds(phase['detected']),
            *(number(phase['measures'].get(name), '.3f') for name in measures),
            _both(phase['error_rms_urad'], '.1f'),
            _both(phase['peak_force'], '.2f'),
        )
    return table


def _both(values: dict[str, float | None], form: str) -> str:
    """Return the value of the first pass, and that without recovery in brackets."""
    first = number(next(iter(values.values())), form)
    if UNRECOVERED not in values or len(values) == 1:
        return first
    return f'{first} ({number(values[UNRECOVERED], form)})'


def _plain(value: float) -> float | None:
    """Return None for a number that is not finite: JSON has none."""
    return float(value) if np.isfinite(value) else None
