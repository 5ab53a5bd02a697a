# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Several mechanisms side by side: legs, freedom, and what a next failure would leave."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from rich.table import Table

from fault_tolerance.analysis.checks import chain_in_letters
from fault_tolerance.analysis.reports import measures_report
from fault_tolerance.analysis.terminal import plain_table
from fault_tolerance.kinematics.reconfiguration import PostFailure

_MODES = {'position': 'stuck p', 'torque': 'free t', 'hard': 'lost h'}


def gallery_rows(posts: Sequence[PostFailure]) -> list[dict[str, Any]]:
    """Return the mechanisms of ``posts`` as data.

    One each: name, joints of the struts from base to platform and how many struts have such,
    task, mobility, and by actuator and by strut the measure if this one failed next.
    """
    rows = []
    for post in posts:
        report = measures_report(post)
        chains = Counter(map(chain_in_letters, post.mechanism.struts))
        row = {key: report[key] for key in ('mechanism', 'task', 'major', 'mobility', *_MODES)}
        rows.append(row | {'chains': dict(chains)})
    return rows


def gallery_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return the ``rows`` of `gallery_rows` as a table: from the worst measure to the best."""
    table = plain_table(
        'mechanism', 'struts', numbers=('mobility', *_MODES.values())
    )
    for row in rows:
        chains = '\n'.join(f'{count} {chain}' for chain, count in row['chains'].items())
        table.add_row(
            row['mechanism'], chains, str(row['mobility']),
            *(_span(row[mode].values()) for mode in _MODES),
        )
    return table


def gallery_records(rows: Sequence[Mapping[str, Any]]) -> list[list[Any]]:
    """Return the ``rows`` of `gallery_rows` as records with a heading, for CSV."""
    records = [
        [row['mechanism'], row['mobility'], mode, name, value]
        for row in rows for mode in _MODES for name, value in row[mode].items()
    ]
    return [['mechanism', 'mobility', 'mode', 'name', 'measure'], *records]


def _span(values: Collection[float]) -> str:
    """Return the lowest and the highest of ``values``, once if they look the same, or a dash."""
    if not values:
        return '-'
    low, high = (f'{value:.2f}' for value in (min(values), max(values)))
    return low if low == high else f'{low}-{high}'
