# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What a campaign found: each trial judged, in rows, in figures for JSON and as a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from fault_tolerance.analysis.snapshot import WORDS
from fault_tolerance.analysis.terminal import number

LARGEST_RATIO = 1.2
"""Times the healthy error that a tolerable failure may cost the major task."""

COLUMNS = (
    'mechanism', 'failures', 'tolerable', 'final_state', 'error_rms', 'healthy_error_rms',
    'peak_force', 'recovery_time_us', 'seed', 'group', 'with_conversion',
)
"""Columns of results.csv, the same to the last byte whoever does the work: its time is empty."""

TIMES = ('mechanism', 'failures', 'recovery_time_us')
"""Columns of timings.csv."""


@dataclass(frozen=True)
class TrialRecord:
    """The result of one trial; rates are in rad/s or m/s.

    ``failures`` are ``mode:name;mode:name``, ``tolerable`` is the theory's verdict at home, and
    ``states`` are those of the controller since the failure, each once, in their order. The rms
    errors of the major task are radians, and displacements divided by the characteristic length.
    ``peak_force`` is the largest effort of an actuator since the failure beyond its mean before,
    newtons (moments divided by the characteristic length). ``recovery_time_us`` is the computing
    time from the report to the end of the step that followed it, microseconds.

    ``group`` is the group of the mechanism file that has failed; empty if it is none.
    ``with_conversion`` is the final state where brakes and releases are commanded, and
    ``converted_error_rms`` the error then; empty, and 0, where nothing can be converted.
    ``convertible`` is whether, by theory, something tolerable can be made of the failures.
    """

    mechanism: str
    failures: str
    tolerable: bool
    states: tuple[str, ...]
    final_state: str
    largest_rate: float
    error_rms: float
    healthy_error_rms: float
    peak_force: float
    recovery_time_us: float
    seed: int
    group: str = ''
    with_conversion: str = ''
    converted_error_rms: float = 0.0
    convertible: bool = False

    @property
    def error_ratio(self) -> float:
        """The error over the healthy one."""
        return self.error_rms / self.healthy_error_rms

    @property
    def mistakes(self) -> tuple[str, ...]:
        """What should not have been; empty if all went as the theory says."""
        found = []
        wanted = 'degraded' if self.tolerable else 'stopped'
        if self.states != (wanted,):
            verdict = 'tolerable' if self.tolerable else 'intolerable'
            found.append(f'{verdict}, but {", then ".join(self.states)} and not {wanted}')
        if not self.tolerable and self.largest_rate > 0.0:
            found.append(f'a rate of {self.largest_rate:.3g} was commanded after the failure')
        # Written so that not a number is a mistake too.
        if self.tolerable and not self.error_ratio <= LARGEST_RATIO:
            healthy = f'{1e6 * self.healthy_error_rms:.2f} microradians'
            found.append(f'error {self.error_ratio:.3g} times the healthy {healthy}')
        converted = 'degraded' if self.convertible else 'stopped'
        if self.with_conversion not in ('', converted):
            found.append(f'with conversion {self.with_conversion} and not {converted}')
        ratio = self.converted_error_rms / self.healthy_error_rms
        if self.with_conversion and self.convertible and not ratio <= LARGEST_RATIO:
            found.append(f'with conversion error {ratio:.3g} times the healthy one')
        return tuple(found)

    def row(self, columns: Sequence[str]) -> tuple[str, ...]:
        """Return the record as one row of ``columns``; the time stays empty in `COLUMNS`."""
        left_out = ('recovery_time_us',) if columns == COLUMNS else ()
        values = ('' if name in left_out else getattr(self, name) for name in columns)
        return tuple(str(one).lower() if isinstance(one, bool) else str(one) for one in values)


def campaign_rows(
    records: Iterable[TrialRecord], columns: tuple[str, ...] = COLUMNS
) -> Iterator[tuple[str, ...]]:
    """Yield the lines of a file with ``columns``: these, then one line for each of ``records``."""
    yield columns
    for record in records:
        yield record.row(columns)


def campaign_summary(records: Sequence[TrialRecord], seed: int) -> dict[str, Any]:
    """Return what ``records`` of a campaign with ``seed`` found, as plain data for JSON.

    The keys are those of summary.json: docs/command_line.md.
    """
    return {
        'seed': seed,
        'largest_error_ratio_allowed': LARGEST_RATIO,
        'trials': len(records),
        'mechanisms': {
            name: _figures([record for record in records if record.mechanism == name])
            for name in dict.fromkeys(record.mechanism for record in records)
        },
        'mistakes': [
            {'mechanism': record.mechanism, 'failures': record.failures, 'seed': record.seed,
             'mistakes': list(record.mistakes)}
            for record in records
            if record.mistakes
        ],
    }


def campaign_table(summary: dict[str, Any]) -> Table:
    """Return ``summary`` of `campaign_summary` for people to read, within 80 columns."""
    table = Table(
        box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False,
        title='Largest error (times the healthy one) and force of tolerable failures,\n'
        'median time of recovery',
    )
    table.add_column('mechanism', no_wrap=True)
    for heading in ('borne', 'stopped', 'error', 'N', 'us', 'wrong'):
        table.add_column(heading, justify='right', no_wrap=True)
    table.add_column('largest\nerror after', overflow='fold')
    for name, figures in summary['mechanisms'].items():
        table.add_row(
            name,
            str(figures['tolerable']),
            str(figures['intolerable']),
            number(figures['largest_error_ratio'], '.3f', ''),
            number(figures['largest_force_tolerable'], '.2f', ''),
            number(figures['median_recovery_time_us'], '.0f', ''),
            str(figures['mistakes']),
            _in_words(figures['largest_error_after'] or ''),
        )
    return table


def _figures(records: Sequence[TrialRecord]) -> dict[str, Any]:
    tolerable = [record for record in records if record.tolerable]
    worst = max(tolerable, key=lambda record: record.error_ratio, default=None)
    times = [record.recovery_time_us for record in records]
    return {
        'tolerable': len(tolerable),
        'intolerable': len(records) - len(tolerable),
        'converted': sum(record.with_conversion == 'degraded' for record in records),
        'mistakes': sum(bool(record.mistakes) for record in records),
        'healthy_error_rms': records[0].healthy_error_rms,
        'largest_error_ratio': worst.error_ratio if worst else None,
        'largest_error_after': worst.failures if worst else None,
        'largest_force_tolerable': max((record.peak_force for record in tolerable), default=None),
        'largest_force': max(record.peak_force for record in records),
        'median_recovery_time_us': float(np.median(times)),
        'largest_recovery_time_us': max(times),
    }


def _in_words(failures: str) -> str:
    """Return ``mode:name;mode:name`` in words, one failure a line."""
    pairs = [failure.partition(':') for failure in failures.split(';') if failure]
    return '\n'.join(f'{name} {WORDS.get(mode, mode)}' for mode, _, name in pairs)
