# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What detection has found in a recording, as a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from fault_tolerance.analysis.terminal import plain_table

FINDING_KEYS = (
    'hardware_id', 'mode', 'candidates', 'log_odds', 'onset', 'travel', 'would_separate'
)
"""The columns of the findings."""


def finding_records(report: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield the findings of a ``report`` of detection in the order of `FINDING_KEYS`."""
    for one in report['findings']:
        values = {'mode': one.get('failure_mode') or one.get('suspected_mode', ''), **one}
        yield [values[key] for key in FINDING_KEYS]


def finding_table(report: Mapping[str, Any]) -> RenderableType:
    """Return a ``report`` of detection as text and a table, for rich."""
    found = report['findings']
    count = f'{len(found)} {"failure" if len(found) == 1 else "failures"}' if found else 'nothing'
    parts: list[RenderableType] = [Text.assemble(
        (f'{report["mechanism"]}: ', 'bold'), (count, 'bold red' if found else 'green'),
        f' found without a report, in {report["joint_states"]} joint states'
        f' and {report["probes"]} complete probes',
    )]
    if found:
        table = plain_table(
            'part', 'mode', 'in words', numbers=['log odds', 'onset, s', 'travel, um'],
        )
        for sentence, (part, mode, _, odds, onset, travel, _) in zip(
            report['sentences'], finding_records(report), strict=True
        ):
            begin = float(onset) - float(report['begin'])
            table.add_row(
                part, mode, sentence, f'{float(odds):.1f}', f'{begin:.3f}',
                f'{1e6 * float(travel):.1f}',
            )
        parts.append(table)
    for one in found:
        if one['would_separate']:
            text = f'{one["candidates"]}: would be told apart by {one["would_separate"]}'
            parts.append(Text(text))
    if report['forming']:
        parts.append(Text(f'not yet narrowed down: {report["forming"]["candidates"]}'))
    parts += [Text(f'note: {remark}') for remark in report['remarks']]
    return Group(*parts)
