# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What a study of detection has found: false alarms, delays, and one against the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import exp
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

PER_UNIT = 4
"""Bins of a histogram of sums in a unit."""

SHOWN_RATES = (5.0, 10.0, 14.0, 15.0, 20.0, 25.0)
"""Thresholds of which the false alarms are listed."""

COLUMNS = (
    'mechanism', 'fault', 'probing', 'amplitude', 'trials', 'noticed', 'wrong', 'delay_median',
    'delay_p95',
)


def study_summary(found: Sequence[dict[str, Any]], seed: int) -> dict[str, Any]:
    """Return the figures of a study.

    Parameters
    ----------
    found : sequence of dict
        Results of its runs, in any order.
    seed : int

    Returns
    -------
    dict
        For JSON: ``healthy`` of all mechanisms, ``mechanisms`` one by one, ``failures``.
    """
    healthy = [one for one in found if 'histogram' in one]
    names = sorted({one['mechanism'] for one in healthy})
    by_name = {
        name: _healthy([one for one in healthy if one['mechanism'] == name]) for name in names
    }
    keys = sorted({_key(one) for one in found if 'delays' in one})
    failures = [
        _failures([one for one in found if 'delays' in one and _key(one) == key]) for key in keys
    ]
    return {
        'seed': seed,
        'healthy': {
            'cycles': sum(one['cycles'] for one in healthy),
            'alarms': sum(one['alarms'] for one in healthy),
            'unexplained': sum(one['unexplained'] for one in healthy),
        },
        'mechanisms': by_name,
        'failures': failures,
    }


def study_rows(summary: dict[str, Any]) -> Iterator[Iterable[Any]]:
    """Yield the failures of a ``summary`` in rows for CSV, the names first."""
    yield COLUMNS
    for one in summary['failures']:
        yield [one[name] for name in COLUMNS]


def study_table(summary: dict[str, Any]) -> Table:
    """Return the figures of a ``summary`` as a table."""
    healthy = summary['healthy']
    table = Table(
        box=box.SIMPLE_HEAD,
        title=f'{healthy["alarms"]} false alarms in {healthy["cycles"]:.3g} healthy cycles; '
              'delays in cycles',
    )
    for name in ('mechanism', 'failure', 'amplitude', 'noticed', 'wrong', 'median', '95 %'):
        table.add_column(name, justify='left' if name in ('mechanism', 'failure') else 'right')
    for one in summary['failures']:
        unit = 'm, probe' if one['probing'] else 'rad'
        delays = (one['delay_median'], one['delay_p95'])
        table.add_row(
            one['mechanism'], one['fault'], f'{one["amplitude"]:.0e} {unit}',
            f'{one["noticed"]}/{one["trials"]}', str(one['wrong']),
            *('-' if delay is None else f'{delay:.0f}' for delay in delays),
        )
    return table


def _key(one: dict[str, Any]) -> tuple[str, bool, str, float]:
    return one['mechanism'], one['probing'], one['fault'], one['amplitude']


def _healthy(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    cycles = sum(one['cycles'] for one in found)
    histogram = np.sum([one['histogram'] for one in found], axis=0)
    above = np.cumsum(histogram[::-1])[::-1]
    count = found[0]['hypotheses']
    highest = max(found, key=lambda one: float(one['highest']))
    return {
        'cycles': cycles,
        'hypotheses': count,
        'threshold': found[0]['threshold'],
        'alarms': sum(one['alarms'] for one in found),
        'unexplained': sum(one['unexplained'] for one in found),
        'highest': highest['highest'],
        'highest_of': highest['highest_of'],
        'rates': {
            f'{level:g}': {
                'measured': float(above[int(PER_UNIT * level)] / cycles),
                'bound': (count - 1) * exp(-level),
            }
            for level in SHOWN_RATES
        },
        'histogram': histogram.tolist(),
    }


def _failures(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    first = found[0]
    delays = [delay for one in found for delay in one['delays']]
    noticed = sorted(delay for delay in delays if delay is not None)
    # What was never noticed took longer than any.
    whole = np.array([np.inf if delay is None else delay for delay in delays])
    median, high = np.percentile(whole, [50, 95], method='higher')
    passed = [levels for one in found for levels in one['passed']]
    levels = sorted({int(level) for one in passed for level in one})
    return {
        'mechanism': first['mechanism'], 'fault': first['fault'], 'probing': first['probing'],
        'amplitude': first['amplitude'], 'trials': len(delays), 'noticed': len(noticed),
        'wrong': sum(one['wrong'] for one in found),
        'delay_median': float(median) if np.isfinite(median) else None,
        'delay_p95': float(high) if np.isfinite(high) else None,
        # By threshold: the share of trials that passed it within 1, 10 and 100 cycles.
        'passed': {
            str(level): [
                sum(one.get(str(level), 10**9) <= limit for one in passed) / len(passed)
                for limit in (1, 10, 100)
            ]
            for level in levels
        },
    }
