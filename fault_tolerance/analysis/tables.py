# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Tables for people: the measures of one mechanism, and the paper's Table I for several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

_FAILURES = {'position': ('p', 'stuck'), 'torque': ('t', 'free'), 'hard': ('h', 'lost')}


def measures_table(report: Mapping[str, Any]) -> RenderableType:
    """Return the report of `measures_report` as text and a table, to be printed with rich."""
    lines = [
        headline(report),
        Text(
            f'task {task_in_words(report)}; {report["mobility"]} controlled degrees of freedom, '
            f'{len(report["actuators"])} actuators, {len(report["struts"])} struts'
        ),
    ]
    if report['failures']:
        present = report['present']
        lines.append(
            Text(
                f'so far: p {present["position"]:.4f}, t {present["torque"]:.4f}, '
                f'h {present["hard"]:.4f}; manipulability retained '
                f'{present["retained_manipulability"]:.4f}'
            )
        )
    parts: list[RenderableType] = [*lines, _next_failures(report), *_remarks(report)]
    for key, title in (('position_pairs', 'p of both'), ('torque_pairs', 't of both')):
        if key in report:
            parts.append(_pairs(report[key], title))
    return Group(*parts)


def headline(report: Mapping[str, Any]) -> Text:
    """Return the name, the verdict and its reason."""
    verdict = 'tolerable' if report['tolerable'] else 'NOT tolerable'
    head = Text()
    head.append(f'{report["mechanism"]}: ', style='bold')
    head.append(verdict, style='green' if report['tolerable'] else 'bold red')
    head.append(f' - {report["reason"]}')
    return head


def task_in_words(report: Mapping[str, Any]) -> str:
    """Return the task coordinates, secondary ones in brackets."""
    return ' '.join(
        name if name in report['major'] else f'({name})' for name in report['task']
    )


def worst_in_words(worst: Mapping[str, Any] | None) -> str:
    """Return which single failure would hurt most."""
    if worst is None:
        return 'nothing is left to fail'
    letter, word = _FAILURES[worst['mode']]
    return f'worst next failure: {worst["name"]} {word}, {letter} = {worst["measure"]:.4f}'


def _remarks(report: Mapping[str, Any]) -> list[Text]:
    """Return what the numbers do not say."""
    remarks = [Text(worst_in_words(report['worst_next']))]
    same = [name for name, equal in report['hard_torque_equivalence'].items() if equal]
    other = [name for name, equal in report['hard_torque_equivalence'].items() if not equal]
    if same:
        names = 'any strut' if not other else ', '.join(same)
        remarks.append(Text(f'losing {names} is kinematically the same as freeing its drives'))
    return remarks


def _next_failures(report: Mapping[str, Any]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, title='if this one failed next', title_justify='left')
    table.add_column('')
    for heading in ('stuck (p)', 'free (t)', 'strut lost (h)'):
        table.add_column(heading, justify='right')
    for name in report['actuators']:
        cells = (_number(report[key][name]) for key in ('position', 'torque'))
        table.add_row(name, *cells, '')
    for name in report['struts']:
        table.add_row(name, '', '', _number(report['hard'][name]))
    return table


def _pairs(values: Mapping[str, float], title: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column('pair')
    table.add_column(title, justify='right')
    for pair, value in values.items():
        table.add_row(pair.replace(',', ', '), _number(value))
    return table


def _number(value: float | None) -> str:
    return 'failed' if value is None else f'{value:.4f}'


def paper_table(reports: Sequence[Mapping[str, Any]]) -> Table:
    """Return the paper's Table I for the mechanisms of ``reports``: p, t and h, no failures.

    Where the actuators (or struts) of a mechanism differ, each value says whose it is.
    """
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column('mechanism')
    for heading in ('position failure', 'torque failure', 'hard failure'):
        table.add_column(heading)
    for report in reports:
        cells = (_grouped(report[key]) for key in ('position', 'torque', 'hard'))
        table.add_row(report['mechanism'], *cells)
    return table


def paper_rows(reports: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the content of `paper_table` as data."""
    keys = ('mechanism', 'position', 'torque', 'hard')
    return [{key: report[key] for key in keys} for report in reports]


def _grouped(values: Mapping[str, float | None]) -> str:
    """Return equal values once, with the names that have them if there are several values."""
    groups: dict[str, list[str]] = {}
    for name, value in values.items():
        groups.setdefault(_number(value), []).append(name)
    if not groups:
        return '-'
    if len(groups) == 1:
        return next(iter(groups))
    return '\n'.join(f'{value} ({", ".join(names)})' for value, names in groups.items())


def measures_records(report: Mapping[str, Any]) -> list[list[Any]]:
    """Return the measures as records with a heading, for CSV: one failure, or pair, a line."""
    records: list[list[Any]] = [['mode', 'name', 'and', 'measure']]
    for mode in ('position', 'torque', 'hard'):
        records += [[mode, name, '', value] for name, value in report[mode].items()]
    for mode in ('position', 'torque'):
        pairs = report.get(f'{mode}_pairs', {})
        records += [[mode, *pair.split(','), value] for pair, value in pairs.items()]
    return records


def paper_records(reports: Sequence[Mapping[str, Any]]) -> list[list[Any]]:
    """Return the content of `paper_table` as records with a heading, for CSV."""
    records: list[list[Any]] = [['mechanism', 'mode', 'name', 'measure']]
    for report in reports:
        for mode in ('position', 'torque', 'hard'):
            records += [
                [report['mechanism'], mode, name, value] for name, value in report[mode].items()
            ]
    return records
