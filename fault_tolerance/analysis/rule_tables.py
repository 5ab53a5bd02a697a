# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What rules about drives mean, and would have reported, as text and tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from fault_tolerance.analysis.terminal import plain_table

RULE_EVENT_KEYS = ('time', 'rule', 'actuator', 'mode', 'message')
"""The columns of what would have been reported."""


def rule_event_records(report: Mapping[str, Any]) -> Iterator[list[Any]]:
    """Yield what would have been reported by ``report``, in the order of `RULE_EVENT_KEYS`."""
    for event in report.get('events', ()):
        yield [event[key] for key in RULE_EVENT_KEYS]


def rule_table(report: Mapping[str, Any]) -> RenderableType:
    """Return the ``report`` of `rules_report`, and of a recording if there is one, for rich."""
    count = len(report['rules'])
    parts: list[RenderableType] = [Text.assemble(
        (f'{report["source"]}: ', 'bold'), f'{count} {"rule" if count == 1 else "rules"}',
        f' for {report["mechanism"]}' if report['mechanism'] else '',
    )]
    for rule in report['rules']:
        place = f'{rule["field"]} of {rule["topic"]} ({rule["type"]})'
        parts.append(Text(f'\n{rule["name"]}: {place}'))
        parts.append(Text(f'  {_whose(rule)}'))
        if rule['reset']:
            reset = rule['reset']
            parts.append(Text(f'  reset by {reset["service"]} ({reset["type"]})'))
        table = plain_table('if the value', 'says', 'which means')
        # All of an expression, however long.
        table.columns[0].overflow = 'fold'
        for case in rule['cases']:
            words = f'{case["text"]}: {case["meaning"]}' if case['text'] else case['meaning']
            table.add_row(case['if'], case['says'], words)
        table.add_row('is none of these', rule['otherwise']['says'], rule['otherwise']['meaning'])
        parts.append(table)
    parts += [Text(text) for text in _modes(report)]
    if 'events' in report:
        parts.append(_events(report))
        parts += [Text(f'note: {remark}') for remark in report['remarks']]
    return Group(*parts)


def _whose(rule: Mapping[str, Any]) -> str:
    drives = rule['drives']
    if not rule['per_drive']:
        return 'tells no drives apart: what it says is about all of them'
    if isinstance(drives, Mapping):
        return ', '.join(f'{called} is {name}' for name, called in drives.items())
    return f'drives are called {drives} (--mechanism M says which)'


def _modes(report: Mapping[str, Any]) -> Iterator[str]:
    for key, words in (('when_off', 'when_off'), ('worse', 'the worse of stuck and free')):
        if key in report:
            modes = ', '.join(f'{name} {mode}' for name, mode in report[key].items())
            yield f'{words}: {modes}'
    if report['unwatched']:
        yield f'note: no rule is about {", ".join(report["unwatched"])}'


def _events(report: Mapping[str, Any]) -> RenderableType:
    events = report['events']
    head = f'\n{len(events)} changes in {report["messages"]} messages'
    if not events:
        return Text(f'{head}: nothing would have been reported')
    table = plain_table('rule', 'actuator', 'mode', 'message', numbers=['s'])
    for time, *words in rule_event_records(report):
        table.add_row(*words, f'{time:.3f}')
    return Group(Text(head), table)
