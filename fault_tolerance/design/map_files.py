# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A map as files: arrays, picture, page, and what it says in short."""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from fault_tolerance.analysis.reports import failure_entries
from fault_tolerance.design.maps import ToleranceMap
from fault_tolerance.errors import writing
from fault_tolerance.resources import PACKAGE

QUANTITIES = (
    'position', 'torque', 'hard', 'smallest_singular_value', 'condition_number', 'tolerable',
    'reachable',
)
"""The arrays over the grid."""


def provenance(file: Path) -> dict[str, str]:
    """Return what a result was made of: the mechanism ``file``, its hash, the version of this."""
    try:
        number = version(PACKAGE)
    except PackageNotFoundError:
        number = ''
    return {'file': file.name, 'sha256': sha256(file.read_bytes()).hexdigest(), 'version': number}


def map_report(found: ToleranceMap, file: Path) -> dict[str, Any]:
    """Return what the map ``found``, of the mechanism ``file``, says in short, for JSON."""
    grid = found.grid
    whole = float(grid.weights.sum())
    good = found.volume_of(found.tolerable & found.reachable)
    report: dict[str, Any] = {
        'mechanism': found.mechanism.name,
        **provenance(file),
        'failures': failure_entries(found.failures),
        'over': [
            {'name': axis.name, 'low': axis.low, 'high': axis.high, 'count': axis.count}
            for axis in grid.axes
        ],
        'poses': len(grid.poses),
        'unit': grid.unit,
        'volume': {
            'map': whole,
            'reachable': found.volume_of(found.reachable),
            'fault_tolerant': good,
        },
        'worst': found.worst_place(),
    }
    if found.proof is not None:
        share = found.proof.share
        report['volume']['certified'] = whole * float(share.mean())
        report['certified'] = {
            'cells': share.size,
            'whole': int((share == 1.0).sum()),
            'partly': int(((share > 0.0) & (share < 1.0)).sum()),
        }
    return report


def map_arrays(found: ToleranceMap) -> dict[str, Any]:
    """Return the arrays of ``found`` by name: axes, quantities, and what is proven of cells."""
    arrays = {axis.name: axis.places for axis in found.grid.axes}
    arrays |= {name: getattr(found, name) for name in QUANTITIES}
    if found.proof is not None:
        arrays |= {'certified': found.proof.share, 'certified_measure': found.proof.least}
    return arrays


def write_map(found: ToleranceMap, report: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write map.npz and .json to ``folder``, with matplotlib .png and .html; return their paths.

    ``report`` is that of ``found``. FaultToleranceError if they cannot be written.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        written = [folder / 'map.npz', folder / 'map.json']
        np.savez_compressed(written[0], **map_arrays(found))
        text = json.dumps(report, indent=2, allow_nan=False) + '\n'
        written[1].write_text(text, encoding='utf-8')
        try:
            # matplotlib is optional, and needed here only.
            from fault_tolerance.analysis.report_page import RESOLUTION, figure_as_svg
            from fault_tolerance.design.map_figure import map_figure
            from fault_tolerance.design.map_page import map_page
        except ImportError:
            return written
        figure = map_figure(found)
        figure.savefig(folder / 'map.png', dpi=RESOLUTION)
        page = map_page(found, report, figure_as_svg(figure))
        (folder / 'map.html').write_text(page, encoding='utf-8')
    return [*written, folder / 'map.png', folder / 'map.html']


def map_facts(report: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what ``report`` says, as pairs of words, for a table."""
    volume, unit = report['volume'], report['unit']

    def share(name: str) -> str:
        return f'{volume[name]:.4g} {unit} ({100.0 * volume[name] / volume["map"]:.1f} %)'

    facts = [
        ('poses', ', '.join(
            f'{one["name"]} {one["low"]:g} to {one["high"]:g} ({one["count"]})'
            for one in report['over']
        )),
        ('map', f'{volume["map"]:.4g} {unit}'),
        ('within reach', share('reachable')),
        ('no single failure fatal', share('fault_tolerant')),
    ]
    if 'certified' in report:
        cells = report['certified']
        facts.append(('proven so', f'{share("certified")}; {cells["whole"]} of {cells["cells"]} '
                      f'cells wholly, {cells["partly"]} in part'))
    worst = report['worst']
    if worst is None:
        return [*facts, ('worst', 'no pose is within reach')]
    place = ', '.join(f'{name} {value:.4g}' for name, value in worst['at'].items())
    return [*facts, ('worst', f'{worst["failure"]}: {worst["measure"]:.4g} at {place}')]


def map_table(report: Mapping[str, Any]) -> RenderableType:
    """Return ``report`` as a table to be printed with rich."""
    failed = ', '.join(f'{one["mode"]}:{one["name"]}' for one in report['failures'])
    table = Table.grid(padding=(0, 2))
    table.title = report['mechanism'] + (f' after {failed}' if failed else '')
    table.title_justify = 'left'
    table.add_column(style='dim')
    table.add_column()
    for words in map_facts(report):
        table.add_row(*words)
    return table
