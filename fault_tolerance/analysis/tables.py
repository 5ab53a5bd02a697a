# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Tables to print: the measures of one mechanism, and the paper's Table I for several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fault_tolerance.analysis.snapshot import LETTERS, WORDS
from fault_tolerance.analysis.terminal import number, plain_table

_MODES = ('position', 'torque', 'hard')


def measures_table(report: Mapping[str, Any]) -> RenderableType:
    """Return the ``report`` of `measures_report` as text and a table, to be printed with rich."""
    size = (
        f'task {task_in_words(report)}; {report["mobility"]} controlled degrees of freedom, '
        f'{len(report["actuators"])} actuators, {len(report["struts"])} struts'
    )
    parts: list[RenderableType] = [headline(report), Text(size)]
    if any(report['at'].values()):
        values = (f'{name} {round(value, 12) + 0.0:.6g}' for name, value in report['at'].items())
        parts.append(Text(f'at {", ".join(values)} (m or rad from home)'))
    if report['failures']:
        present = report['present']
        measures = ', '.join(f'{LETTERS[mode]} {present[mode]:.4f}' for mode in _MODES)
        kept = f'manipulability retained {present["retained_manipulability"]:.4f}'
        parts.append(Text(f'so far: {measures}; {kept}'))
    parts.append(_next_failures(report))
    if report['groups']:
        parts.append(group_table(report))
    parts += _remarks(report)
    for mode in ('position', 'torque'):
        if f'{mode}_pairs' in report:
            table = plain_table('pair', numbers=[f'{LETTERS[mode]} of both'])
            for pair, value in report[f'{mode}_pairs'].items():
                table.add_row(pair.replace(',', ', '), _number(value))
            parts.append(table)
    return Group(*parts)


def headline(report: Mapping[str, Any]) -> Text:
    """Return the name, the verdict and its reason of a ``report`` (of measures, or a check)."""
    verdict = 'tolerable' if report['tolerable'] else 'NOT tolerable'
    style = 'green' if report['tolerable'] else 'bold red'
    name = (f'{report["mechanism"]}: ', 'bold')
    return Text.assemble(name, (verdict, style), f' - {report["reason"]}')


def task_in_words(report: Mapping[str, Any]) -> str:
    """Return the task coordinates of a ``report``, secondary ones in brackets."""
    return ' '.join(name if name in report['major'] else f'({name})' for name in report['task'])


def worst_in_words(worst: Mapping[str, Any] | None) -> str:
    """Return which single failure would hurt most, given ``worst`` from `worst_next`."""
    if worst is None:
        return 'nothing is left to fail'
    mode, name, measure = worst['mode'], worst['name'], worst['measure']
    if mode == 'group':
        return f'worst next failure: {name}, not tolerable'
    return f'worst next failure: {name} {WORDS[mode]}, {LETTERS[mode]} = {measure:.4f}'


def _remarks(report: Mapping[str, Any]) -> list[Text]:
    """Return the worst next failure and the hard-torque equivalence, in words."""
    remarks = [Text(worst_in_words(report['worst_next']))]
    equivalence = report['hard_torque_equivalence']
    same = [name for name, equal in equivalence.items() if equal]
    if same:
        names = 'any strut' if len(same) == len(equivalence) else ', '.join(same)
        remarks.append(Text(f'losing {names} is kinematically the same as freeing its drives'))
    return remarks


def _next_failures(report: Mapping[str, Any]) -> Table:
    numbers = ('stuck (p)', 'free (t)', 'strut lost (h)')
    table = plain_table('', numbers=numbers, title='if this one failed next')
    for name in report['actuators']:
        cells = (_number(report[key][name]) for key in ('position', 'torque'))
        table.add_row(name, *cells, '')
    for name in report['struts']:
        table.add_row(name, '', '', _number(report['hard'][name]))
    return table


def group_table(report: Mapping[str, Any]) -> Table:
    """Return what the groups of a ``report`` (of measures, or a check) would leave."""
    table = plain_table('group', 'would be', 'then', title='if this group failed next')
    for name, entry in report['groups'].items():
        if entry is None:
            table.add_row(name, 'failed', '')
            continue
        words = (f'{one["name"]} {WORDS[one["mode"]]}' for one in entry['failures'])
        verdict = 'tolerable' if entry['tolerable'] else 'NOT tolerable'
        table.add_row(name, '\n'.join(words), verdict)
    return table


def _number(value: float | None) -> str:
    return number(value, '.4f', 'failed')


def paper_table(reports: Sequence[Mapping[str, Any]]) -> Table:
    """Return the paper's Table I for ``reports`` (of `measures_report`): p, t and h, no failures.

    Where the actuators (or struts) of a mechanism differ, each value says whose it is.
    """
    table = plain_table('mechanism', *(f'{mode} failure' for mode in _MODES))
    for report in reports:
        table.add_row(report['mechanism'], *(_grouped(report[mode]) for mode in _MODES))
    return table


def paper_rows(reports: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the content of `paper_table` of ``reports`` as data."""
    return [{key: report[key] for key in ('mechanism', *_MODES)} for report in reports]


def _grouped(values: Mapping[str, float | None]) -> str:
    """Return equal values once, with the names that have them if there are several values."""
    groups: dict[str, list[str]] = {}
    for name, value in values.items():
        groups.setdefault(_number(value), []).append(name)
    if len(groups) < 2:
        return ''.join(groups) or '-'
    return '\n'.join(f'{value} ({", ".join(names)})' for value, names in groups.items())


def measures_records(report: Mapping[str, Any]) -> list[list[Any]]:
    """Return ``report`` of `measures_report` as records with a heading, for CSV.

    One failure, or pair, a line.
    """
    records: list[list[Any]] = [['mode', 'name', 'and', 'measure']]
    for mode in _MODES:
        records += [[mode, name, '', value] for name, value in report[mode].items()]
    for mode in ('position', 'torque'):
        pairs = report.get(f'{mode}_pairs', {})
        records += [[mode, *pair.split(','), value] for pair, value in pairs.items()]
    return records


def paper_records(reports: Sequence[Mapping[str, Any]]) -> list[list[Any]]:
    """Return the content of `paper_table` of ``reports`` as records with a heading, for CSV."""
    return [['mechanism', 'mode', 'name', 'measure']] + [
        [report['mechanism'], mode, name, value]
        for report in reports for mode in _MODES for name, value in report[mode].items()
    ]
