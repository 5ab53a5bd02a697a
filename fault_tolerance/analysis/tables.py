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


def measures_table(report: Mapping[str, Any]) -> RenderableType:
    """Return the report of `measures_report` as text and a table, to be printed with rich."""
    verdict = 'tolerable' if report['tolerable'] else 'NOT tolerable'
    head = Text()
    head.append(f'{report["mechanism"]}: ', style='bold')
    head.append(verdict, style='green' if report['tolerable'] else 'bold red')
    head.append(f' - {report["reason"]}')
    task = [
        name if name in report['major'] else f'({name})' for name in report['task']
    ]
    lines = [
        head,
        Text(
            f'task {" ".join(task)}; {report["mobility"]} controlled degrees of freedom, '
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
    parts: list[RenderableType] = [*lines, _next_failures(report)]
    for key, title in (('position_pairs', 'p of both'), ('torque_pairs', 't of both')):
        if key in report:
            parts.append(_pairs(report[key], title))
    return Group(*parts)


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
