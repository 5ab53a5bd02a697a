# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A route as files: task velocities over time, picture, and what it says in short."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from fault_tolerance.analysis.reports import failure_entries
from fault_tolerance.design.map_files import provenance
from fault_tolerance.design.maps import ToleranceMap
from fault_tolerance.design.routes import (
    Route,
    fail_safe,
    least,
    nearest,
    straight_profile,
)
from fault_tolerance.errors import writing
from fault_tolerance.mechanism.screws import rotation_vector_rates
from fault_tolerance.mechanism.task import COORDINATES


def task_velocities(route: Route) -> list[list[Any]]:
    """Return a ``route`` as rows of a table, the heads first: one for each of its poses.

    Time in seconds, the displacement of the platform from home, and the twist with which it
    leaves the pose, angular velocity and velocity of its origin in base axes: what
    ``~/task_velocity`` takes, zero at the end.
    """
    found = route.found
    places = [COORDINATES.index(name) for name in found.grid.names]
    moves = np.zeros((len(route.poses), 6))
    moves[:, places] = route.poses
    rates = np.zeros_like(moves)
    seconds = np.diff(route.times)[:, None]
    np.divide(np.diff(moves, axis=0), seconds, out=rates[:-1], where=seconds > 0.0)
    for move, rate in zip(moves, rates, strict=True):
        # The rate of a rotation vector is no angular velocity.
        rate[:3] = np.linalg.solve(rotation_vector_rates(move[:3]), rate[:3])
    heads = ['t', *COORDINATES, *(f'rate_{name}' for name in COORDINATES)]
    table = np.column_stack([route.times, moves, rates])
    return [heads, *([float(f'{value:.12g}') for value in row] for row in table)]


def route_report(
    found: ToleranceMap, file: Path, ends: tuple[Mapping[str, float], Mapping[str, float]],
    route: Route | None, *, safe: bool,
) -> dict[str, Any]:
    """Return what a ``route`` over the map ``found`` says in short, for JSON.

    Of the mechanism ``file``, between the ``ends``, fail-safe where that was asked for (``safe``);
    None: there is no route.
    """
    report: dict[str, Any] = {
        'mechanism': found.mechanism.name,
        **provenance(file),
        'failures': failure_entries(found.failures),
        'from': dict(ends[0]),
        'to': dict(ends[1]),
        'over': [
            {'name': axis.name, 'low': axis.low, 'high': axis.high, 'count': axis.count}
            for axis in found.grid.axes
        ],
        'fail_safe': safe,
        'found': route is not None,
    }
    if route is None:
        return report | {'reason': _why_not(found, ends, safe)}
    heads, *rows = task_velocities(route)
    return report | {
        'smallest': route.smallest,
        'straight': least(straight_profile(route)),
        'length': float(route.way[-1]),
        'duration': float(route.times[-1]),
        'route': [dict(zip(heads, row, strict=True)) for row in rows],
    }


def write_route(route: Route, report: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write route.csv, .json and with matplotlib .png of ``route`` to ``folder``.

    Returns their paths. ``report`` is that of the route. FaultToleranceError if they cannot be
    written.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        written = [folder / 'route.csv', folder / 'route.json']
        with written[0].open('w', newline='', encoding='utf-8') as file:
            csv.writer(file, lineterminator='\n').writerows(task_velocities(route))
        text = json.dumps(report, indent=2, allow_nan=False) + '\n'
        written[1].write_text(text, encoding='utf-8')
        try:
            # matplotlib is optional, and needed here only.
            from fault_tolerance.design.route_figure import RESOLUTION, route_figure
        except ImportError:
            return written
        route_figure(route).savefig(folder / 'route.png', dpi=RESOLUTION)
    return [*written, folder / 'route.png']


def route_table(report: Mapping[str, Any]) -> RenderableType:
    """Return ``report`` as a table to be printed with rich."""
    table = Table.grid(padding=(0, 2))
    table.title = f'{report["mechanism"]}: {"fail-safe " if report["fail_safe"] else ""}route'
    table.title_justify = 'left'
    table.add_column(style='dim')
    table.add_column()
    for key in ('from', 'to'):
        table.add_row(key, ', '.join(f'{name} {value:g}' for name, value in report[key].items()))
    if not report['found']:
        table.add_row('found', f'no: {report["reason"]}')
        return table
    straight = report['straight']
    words = 'leaves what is within reach' if straight is None else f'{straight:.4g}'
    smallest = report['smallest']
    table.add_row('smallest measure', 'none' if smallest is None else f'{smallest:.4g}')
    table.add_row('straight', words)
    table.add_row('poses', str(len(report['route'])))
    table.add_row('length', f'{report["length"]:.4g} m (rotations times characteristic length)')
    table.add_row('duration', f'{report["duration"]:.4g} s')
    return table


def _why_not(
    found: ToleranceMap, ends: tuple[Mapping[str, float], Mapping[str, float]], safe: bool
) -> str:
    """Return why there is no route over ``found`` between the ``ends``."""
    for what, where in zip(('start', 'goal'), ends, strict=True):
        number = nearest(found, where)
        if not found.reachable.ravel()[number]:
            return f'the {what} is out of reach'
        if not found.tolerable.ravel()[number]:
            return f'at the {what} a single failure is fatal'
    if safe and not fail_safe(found, ends[1]).ravel()[nearest(found, ends[0])]:
        return 'a drive that sticks at the start puts the goal out of reach'
    return 'the map has no such way from one to the other'
