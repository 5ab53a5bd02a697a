# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the command line does about design: maps, routes, optima.

Each takes as ``work`` who does it (`executor_of`), the folder for the results, and the form in
which to print what they say in short. FaultToleranceError if that cannot be done or written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fault_tolerance.analysis.terminal import progress_bar
from fault_tolerance.commands import Form, show
from fault_tolerance.design.design_files import (
    comparison,
    comparison_table,
    design_report,
    design_table,
    write_design,
)
from fault_tolerance.design.grids import Axis, Grid, grid_around
from fault_tolerance.design.map_files import map_report, map_table, write_map
from fault_tolerance.design.maps import ToleranceMap, tolerance_map
from fault_tolerance.design.optimum import best_design, trade_off
from fault_tolerance.design.route_files import route_report, route_table, write_route
from fault_tolerance.design.routes import fail_safe, widest_route
from fault_tolerance.design.specification import specification_from_file
from fault_tolerance.executors import executor_of
from fault_tolerance.kinematics.failures import FailureLike
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path

Work = tuple[str, Path, Form]


def map_poses(
    name: str, axes: Sequence[Axis], failed: Sequence[FailureLike], work: Work, *, certified: bool
) -> None:
    """Map what a further failure would leave of the mechanism ``name`` over ``axes``.

    After those ``failed``, doing the ``work`` so; with cells ``certified`` where that is asked
    for.
    """
    _, folder, form = work
    found = _mapped(name, Grid(tuple(axes)), failed, work, certified=certified)
    report = map_report(found, mechanism_path(name))
    paths = write_map(found, report, folder)
    show(form, report, (), map_table(report))
    _list(paths, form)


def route(
    name: str, ends: tuple[Mapping[str, float], Mapping[str, float]], axes: Sequence[Axis],
    failed: Sequence[FailureLike], work: Work, *, safe: bool,
) -> None:
    """Find the widest route of the mechanism ``name`` between two poses, its ``ends``.

    On a map over ``axes`` (around the ends if there are none), after those ``failed``, doing the
    ``work`` so; fail-safe if it is to be ``safe``.
    """
    _, folder, form = work
    grid = Grid(tuple(axes)) if axes else grid_around(*ends)
    found = _mapped(name, grid, failed, work)
    allowed = fail_safe(found, ends[1]) if safe else None
    way = widest_route(found, *ends, allowed)
    report = route_report(found, mechanism_path(name), ends, way, safe=safe)
    paths = [] if way is None else write_route(way, report, folder)
    show(form, report, (), route_table(report))
    _list(paths, form)


def design(specifications: Sequence[Path], work: Work) -> None:
    """Find the best design that each of the files ``specifications`` allows.

    Doing the ``work`` so. Several, each in a folder of its own, are compared: what do more drives
    buy?
    """
    workers, folder, form = work
    asked = [specification_from_file(one) for one in specifications]
    several = len(asked) > 1
    reports, paths = [], []
    with progress_bar('designs tried') as watch, executor_of(workers) as executor:
        for one in asked:
            found = best_design(one, executor, watch)
            between = trade_off(found, executor) if one.tradeoff else ()
            reports.append(design_report(found, between))
            place = folder / one.name if several else folder
            paths += write_design(found, reports[-1], place)
    if several:
        compared = comparison(reports)
        show(form, compared, (), comparison_table(compared))
    else:
        show(form, reports[0], (), design_table(reports[0]))
    _list(paths, form)


def _mapped(
    name: str, grid: Grid, failed: Sequence[FailureLike], work: Work, *, certified: bool = False
) -> ToleranceMap:
    mechanism = mechanism_named(name)
    with progress_bar('parts of the map') as watch, executor_of(work[0]) as executor:
        return tolerance_map(
            mechanism, grid, failed, certified=certified, executor=executor, watch=watch
        )


def _list(paths: Sequence[Path], form: Form) -> None:
    if form == 'text':
        print(''.join(f'{path}\n' for path in paths), end='')
