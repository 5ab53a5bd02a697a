# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A design as files: the mechanism, a report, a picture."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from rich.console import RenderableType

from fault_tolerance.analysis.terminal import number, plain_table
from fault_tolerance.design.map_files import provenance
from fault_tolerance.design.optimum import Design, states
from fault_tolerance.errors import FaultToleranceError, writing


def design_report(design: Design, between: Sequence[tuple[float, ...]] = ()) -> dict[str, Any]:
    """Return what ``design`` is, for JSON.

    With the worst of both objectives in designs ``between`` them.
    """
    specification = design.specification
    post = states(specification, design.values)[0]
    objectives = []
    for one, before, worst in zip(
        specification.objectives, design.start, design.worst, strict=True
    ):
        bound, packing = one.bound(post), one.packing(post)
        objectives.append({
            'measure': one.measure,
            'failures': one.failures,
            'start': before,
            'worst': worst,
            'bound': bound,
            'over_bound': worst / bound if bound else None,
            'packing': packing,
            'over_packing': worst / packing if packing else None,
        })
    return {
        'design': specification.name,
        'mechanism': post.mechanism.name,
        **provenance(specification.file),
        'actuators': len(post.mechanism.actuators),
        'mobility': post.present.mobility,
        'objectives': objectives,
        'free': [
            {'path': list(one.paths), 'range': [one.low, one.high], 'value': float(value)}
            for one, value in zip(specification.free, design.values, strict=True)
        ],
        'tradeoff': [list(one) for one in between],
        'seed': specification.seed,
    }


def write_design(design: Design, report: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write mechanism.yaml and design.json to ``folder``, with matplotlib design.png and .html.

    Returns their paths. ``report`` is that of ``design``. FaultToleranceError if they cannot be
    written.
    """
    document = design.specification.documented(design.values)
    text = f'# Made by `design` ({report["design"]}) from {report["file"]}: {_words(report)}\n'
    text += yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=99)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        written = [folder / 'mechanism.yaml', folder / 'design.json']
        written[0].write_text(text, encoding='utf-8')
        words = json.dumps(report, indent=2, allow_nan=False) + '\n'
        written[1].write_text(words, encoding='utf-8')
        try:
            # matplotlib is optional, and needed here only.
            from fault_tolerance.design.design_figure import write_figures
        except ImportError:
            return written
        return [*written, *write_figures(design, report, folder)]


def design_rows(report: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Return the objectives of ``report`` in words, one each."""
    return [
        (
            _name(one),
            *(number(one[key], '.5f' if 'over' not in key else '.4f') for key in (
                'start', 'worst', 'bound', 'over_bound', 'packing', 'over_packing')),
        )
        for one in report['objectives']
    ]


HEADS = ('worst', 'before', 'now', 'bound', 'share', 'packing', 'share')
"""What a design attains, and its share of what it can at most, and as a packing of lines."""


def design_table(report: Mapping[str, Any]) -> RenderableType:
    """Return ``report`` as a table to be printed with rich."""
    title = f'{report["design"]}: {report["actuators"]} drives, mobility {report["mobility"]}'
    table = plain_table(HEADS[0], numbers=HEADS[1:], title=title)
    for row in design_rows(report):
        table.add_row(*row)
    return table


def comparison(reports: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return ``reports`` of designs for the same purpose beside each other, for JSON.

    One is beaten by another that has no more drives and is nowhere worse, and somewhere better.
    FaultToleranceError if their objectives or names do not let them be compared.
    """
    names = [one['design'] for one in reports]
    if len(set(names)) < len(names):
        raise FaultToleranceError(f'two designs have one name: {", ".join(names)}')
    purposes = [[(one['measure'], one['failures']) for one in report['objectives']]
                for report in reports]
    for name, purpose in zip(names, purposes, strict=True):
        if purpose != purposes[0]:
            raise FaultToleranceError(f'{name} has other objectives than {names[0]}')
    found = [
        {
            'design': report['design'],
            'actuators': report['actuators'],
            'worst': [one['worst'] for one in report['objectives']],
        }
        for report in reports
    ]
    for one in found:
        one['beaten_by'] = next((rival['design'] for rival in found if _beats(rival, one)), None)
    return {
        'objectives': [{'measure': one, 'failures': count} for one, count in purposes[0]],
        'designs': found,
    }


def _beats(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    ours = (-one['actuators'], *one['worst'])
    theirs = (-other['actuators'], *other['worst'])
    return ours != theirs and all(a >= b for a, b in zip(ours, theirs, strict=True))


def comparison_table(compared: Mapping[str, Any]) -> RenderableType:
    """Return designs ``compared`` (`comparison`) as a table for rich, the fewest drives first."""
    heads = [_name(one) for one in compared['objectives']]
    table = plain_table('design', 'beaten by', numbers=('drives', *heads))
    for one in sorted(compared['designs'], key=lambda one: int(one['actuators'])):
        worst = (number(each, '.5f') for each in one['worst'])
        table.add_row(one['design'], one['beaten_by'] or '', str(one['actuators']), *worst)
    return table


def _name(objective: Mapping[str, Any]) -> str:
    """Return an ``objective`` in words."""
    name = str(objective['measure']).replace('_', ' ')
    return name if name.startswith('smallest') else f'{name}, {objective["failures"]} failed'


def _words(report: Mapping[str, Any]) -> str:
    return '; '.join(f'worst {row[0]}: {row[2]}' for row in design_rows(report)) + '.'
