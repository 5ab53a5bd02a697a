# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The examination of a mechanism as text and tables for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fault_tolerance.analysis.tables import group_table, headline, task_in_words, worst_in_words
from fault_tolerance.analysis.terminal import plain_table

_ORDINARY = 'neither under- nor over-constrained nor kinematically redundant'
_WORDS = {'position': 'stuck', 'torque': 'free', 'hard': 'strut lost'}


def check_table(report: Mapping[str, Any]) -> RenderableType:
    """Return the ``report`` of `check_report` as text and tables, to be printed with rich."""
    parts: list[RenderableType] = [headline(report), _facts(report), Text(), _actuators(report)]
    if report['struts']:
        parts += [Text(), _struts(report)]
    parts += [Text(), _budget(report)]
    if report['groups']:
        parts += [Text(), group_table(report)]
    if report['conversions']:
        parts += [Text(), _conversions(report)]
    return Group(*parts)


def _facts(report: Mapping[str, Any]) -> Table:
    redundancy, constraints = report['redundancy'], report['constraints']
    sigma, closure = report['singular_values'], report['closure']
    table = Table.grid(padding=(0, 2))
    table.add_column(style='dim')
    table.add_column()
    table.add_row('task', f'{task_in_words(report)} (in brackets: secondary)')
    table.add_row('mobility', _mobility(report['mobility'], redundancy['task']))
    table.add_row('kind', ', '.join(report['classification']) or _ORDINARY)
    if redundancy['kinematic'] > 0:
        table.add_row('redundancy', _redundancy(redundancy))
    if constraints['rows']:
        table.add_row(
            'structure',
            f'{constraints["rows"]} directions barred by the struts: '
            f'{constraints["effective"]} count, {constraints["repeated"]} repeat others, '
            f'{constraints["absorbed"]} absorbed (compliance {report["compliance"]:g})',
        )
        table.add_row('', f'singular values {_numbers(sigma["structure"])}')
    table.add_row('J_m', f'singular values {_numbers(sigma["major"])}')
    if report['struts']:
        table.add_row(
            'closure',
            f'open {closure["residual"]:.1e} m, flexure strain {closure["flexure_strain"]:.1e} m',
        )
    return table


def _mobility(mobility: int, spare: int) -> str:
    text = f'{mobility} controlled degree{"" if mobility == 1 else "s"} of freedom'
    if spare > 0:
        return f'{text}, {spare} more than the major task needs'
    return text if spare == 0 else f'{text}, {-spare} too few for the major task'


def _redundancy(redundancy: Mapping[str, Any]) -> str:
    count = redundancy['kinematic']
    text = f'{count} drive{"" if count == 1 else "s"} more than degrees of freedom'
    if redundancy['struts']:
        text += f'; can be spared singly: {", ".join(redundancy["struts"])}'
    if redundancy['drives']:
        text += f'; overactuated by any of {", ".join(redundancy["drives"])}'
    return text


def _actuators(report: Mapping[str, Any]) -> Table:
    notes = []
    table = plain_table(
        'actuator', 'strut', numbers=('range', 'speed', 'now'), title='actuators',
        caption_justify='left',
    )
    for entry in report['actuators']:
        unit = 'rad' if entry['kind'] == 'revolute' else 'm'
        speed = 'any' if entry['velocity'] is None else f'{entry["velocity"]:g} {unit}/s'
        table.add_row(
            entry['name'], entry['strut'] or '-', _range(entry['position'], unit), speed,
            f'{entry["value"]:.6g} {unit}',
        )
        notes += [f'{entry["name"]} {note}' for note in _drive(entry)]
    table.caption = '\n'.join(notes) or None
    return table


def _range(limits: Sequence[float | None], unit: str) -> str:
    low, high = limits
    if low is None and high is None:
        return 'any'
    ends = ['-inf' if low is None else f'{low:g}', 'inf' if high is None else f'{high:g}']
    return f'{" to ".join(ends)} {unit}'


def _drive(entry: Mapping[str, Any]) -> list[str]:
    """Return how the drive differs from what its name says."""
    notes = []
    if entry['joint_state_name'] != entry['name']:
        notes.append(f'is {entry["joint_state_name"]} in joint states')
    if entry['home'] != 0.0 or entry['sign'] != 1:
        notes.append(f'reads {entry["home"]:g} {"-" if entry["sign"] < 0 else "+"} value')
    if entry['brake']:
        notes.append('has a brake')
    return notes


def _struts(report: Mapping[str, Any]) -> Table:
    lost = {failure['name'] for failure in report['failures'] if failure['mode'] == 'hard'}
    title = 'struts (base to platform; * driven)'
    table = plain_table('strut', 'joints', numbers=['bars'], title=title)
    table.add_column('losing it is as freeing its drives')
    for entry in report['struts']:
        name = entry['name'] + (' (release)' if entry['release'] else '')
        verdict = 'lost already'
        if entry['name'] not in lost:
            equivalence = report['equivalence'][entry['name']]
            answer = 'yes' if equivalence['equivalent'] else 'no'
            verdict = f'{answer}: {equivalence["reason"]}'
        table.add_row(name, entry['chain'], str(entry['bars']), verdict)
    return table


def _budget(report: Mapping[str, Any]) -> Table:
    table = plain_table(
        'failure', numbers=('guaranteed', 'best case'),
        title='further failures that can be tolerated',
        caption=worst_in_words(report['worst_next']), caption_justify='left',
    )
    for mode, entry in report['failure_budget'].items():
        if mode == 'hard' and not report['struts']:
            continue
        least = '' if entry['complete'] else ' or more'
        counts = (f'{entry[key]}{least}' for key in ('guaranteed', 'best_case'))
        table.add_row(_WORDS[mode], *counts)
    return table


def _conversions(report: Mapping[str, Any]) -> Table:
    numbers = ('kept as it is', 'at best')
    table = plain_table('failure', numbers=numbers, title='brakes and releases')
    table.add_column('by')
    for entry in report['conversions']:
        failure = ', '.join(f'{one["mode"]}:{one["name"]}' for one in entry['failures'])
        if entry['best'] is None:
            table.add_row(failure, '', '', 'too many combinations to try them all')
            continue
        actions = [f'{one["from"]} to {one["to"]}' for one in entry['best']['actions']]
        kept = (f'{entry[key]["kept"]:.4f}' for key in ('as_it_is', 'best'))
        table.add_row(failure, *kept, ', '.join(actions) or 'leaving it')
    return table


def _numbers(values: Sequence[float]) -> str:
    largest = max(values, default=0.0)
    # Rounding errors are not shown.
    shown = [value if value > 1e-12 * largest else 0.0 for value in values]
    return ' '.join(f'{value:.4g}' for value in shown) or 'none'
