# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What sensors can tell apart, as text for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from fault_tolerance.analysis.snapshot import SUSPECTED
from fault_tolerance.analysis.terminal import plain_table

_HEALTHY = 'healthy'


def class_table(report: Mapping[str, Any]) -> RenderableType:
    """Return the ``report`` of `isolability_report`, with its ``options``, for rich.

    Parameters
    ----------
    report : mapping
        What would help is under ``would_help``.

    Returns
    -------
    RenderableType
    """
    classes = report['classes']
    title = (f'{report["mechanism"]}: ', 'bold')
    count = sum(map(len, classes))
    head = f'{count} hypotheses in {len(classes)} classes, r = {report["redundancy"]}'
    table = plain_table('what looks the same', numbers=['nearest other, um/um'])
    for group in classes:
        table.add_row(_in_words(group), _nearest(report, group[0]))
    parts: list[RenderableType] = [Text.assemble(title, head), table]
    hidden = [one for group in classes if _HEALTHY in group for one in group if one != _HEALTHY]
    if hidden:
        parts.append(Text(f'Cannot be noticed with these sensors: {_in_words(hidden)}.'))
    if report['would_help']:
        parts.append(Text(f'More would be told apart with: {", ".join(report["would_help"])}.'))
    return Group(*parts)


def _nearest(report: Mapping[str, Any], name: str) -> str:
    """Return the separation of a class from the one that is most like it."""
    found = [value for pair, value in report['separation'].items() if name in pair.split(',')]
    return f'{min(found):.3g}' if found else ''


def _in_words(group: list[str]) -> str:
    """Return hypotheses by kind: ``stuck theta_1 theta_2; lost strut_1``."""
    kinds: dict[str, list[str]] = {}
    for one in group:
        mode, _, name = one.partition(':')
        kinds.setdefault(SUSPECTED.get(mode, mode), []).append(name)
    return '; '.join(' '.join([kind, *filter(None, names)]) for kind, names in kinds.items())
