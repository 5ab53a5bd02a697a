# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Routes are the widest there are, as an exhaustive search finds, and of those the shortest."""

import csv
import heapq
import json
from dataclasses import replace

import numpy as np
import pytest
from core.design.test_pose_measures import platform
from scipy.ndimage import gaussian_filter

from benchmark.replays import replayed
from fault_tolerance.cli import main
from fault_tolerance.design.grids import Axis, Grid, grid_around
from fault_tolerance.design.maps import ToleranceMap, tolerance_map
from fault_tolerance.design.routes import fail_safe, widest_route
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.screws import difference, displaced, exponential

SIZE = 41
ROWS = np.arange(SIZE)[:, None]
PLATFORM = mechanism_named('gough_stewart_8')


def map_of(field):
    """Return a map of a mirror whose worst measure is ``field``, NaN where it does not reach."""
    mirror = mechanism_named('mirror_4_strut')
    grid = Grid((Axis('wx', -0.001, 0.001, SIZE), Axis('wy', -0.002, 0.002, SIZE)))
    small = Grid((Axis('wx', -0.001, 0.001, 2), Axis('wy', -0.001, 0.001, 2)))
    one = tolerance_map(mirror, small).measures
    count, worst = SIZE**2, field.ravel()
    there = np.isfinite(worst)
    measures = replace(
        one, position=np.tile(worst[:, None], 4), torque=np.ones((count, 4)),
        hard=np.ones((count, 4)), actuator_values=np.zeros((count, 4)),
        smallest_singular_value=np.ones(count), condition_number=np.ones(count),
        tolerable=there & (worst > 0.0), reachable=there,
    )
    return ToleranceMap(mirror, grid, FailureSet(), measures)


def neighbours(i, j):
    for a in (-1, 0, 1):
        for b in (-1, 0, 1):
            if (a or b) and 0 <= i + a < SIZE and 0 <= j + b < SIZE:
                yield i + a, j + b


def exhaustive(field, start, goal, steps):
    """Return the width and the length of the best way, by trying every width there is."""
    def length(width):
        best, queue = {start: 0.0}, [(0.0, start)]
        while queue:
            far, here = heapq.heappop(queue)
            if here == goal:
                return far
            for there in neighbours(*here):
                if field[there] >= width:
                    new = far + np.hypot(*(np.subtract(there, here) * steps))
                    if new < best.get(there, np.inf):
                        best[there] = new
                        heapq.heappush(queue, (new, there))
        return None

    widths = np.unique(field[field > 0])
    widths = widths[widths <= min(field[start], field[goal])]
    low, high = 0, len(widths)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if length(widths[middle]) is None else (middle, high)
    return widths[low], length(widths[low])


@pytest.mark.parametrize('seed', range(2))
def test_the_widest_route_is_that_of_an_exhaustive_search(seed):
    rng = np.random.default_rng(seed)
    field = gaussian_filter(rng.normal(size=(SIZE, SIZE)), 2.5)
    field = np.round(0.5 + 1.5 * field / np.abs(field).max() / 2, 3)
    field[field < 0.2] = np.nan
    start, goal = (
        tuple(np.argwhere(np.nan_to_num(np.where(part, field, 0.0)) > 0.5)[which])
        for part, which in ((ROWS < 12, 5), (ROWS > 28, -5))
    )
    found = map_of(field)
    places = [found.place(int(np.ravel_multi_index(one, field.shape))) for one in (start, goal)]
    route = widest_route(found, *places)
    length = found.mechanism.characteristic_length
    steps = np.array([axis.step for axis in found.grid.axes]) * length
    width, way = exhaustive(np.nan_to_num(field), start, goal, steps)
    visited = [
        field[tuple(round((value - axis.low) / axis.step)
                    for value, axis in zip(pose, found.grid.axes, strict=True))]
        for pose in route.poses
    ]
    assert min(visited) == pytest.approx(width)
    assert route.way[-1] == pytest.approx(way)


def test_the_velocities_lead_from_start_to_goal(tmp_path, capsys):
    ends = ['--from', 'wx=0.1', 'wz=-0.1', '--to', 'wz=0.05', 'wx=-0.1']
    assert main(['route', 'gough_stewart_8', *ends, '--json', '--output', str(tmp_path)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report['found'] and report['smallest'] > 0.2
    with (tmp_path / 'route.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [{name: float(value) for name, value in row.items()} for row in rows] == report['route']
    names = ('wx', 'wy', 'wz', 'vx', 'vy', 'vz')
    # Integrated as a twist, in small steps, they lead from pose to pose.
    first = np.array([float(rows[0][name]) for name in names])
    pose = exponential(np.concatenate([first[:3], np.zeros(3)]))
    pose[:3, 3] = first[3:]
    for row, then in zip(rows, rows[1:], strict=False):
        twist = np.array([float(row[f'rate_{name}']) for name in names])
        pose = displaced(pose, twist * (float(then['t']) - float(row['t'])))
        wanted = np.array([float(then[name]) for name in names])
        assert np.abs(difference(pose, np.eye(4)) - wanted).max() < 2e-3
    assert np.abs(difference(pose, np.eye(4)) - [-0.1, 0, 0.05, 0, 0, 0]).max() < 2e-3
    assert all(float(rows[-1][f'rate_{name}']) == 0.0 for name in names)


def test_no_drive_is_faster_than_half_its_limit():
    grid = grid_around({'vx': -0.05}, {'vx': 0.05, 'vy': 0.03})
    route = widest_route(tolerance_map(PLATFORM, grid), {'vx': -0.05}, {'vx': 0.05, 'vy': 0.03})
    at = [after(PLATFORM, pose=dict(zip(grid.names, map(float, pose), strict=True)))
          .configuration.actuator_values for pose in route.poses]
    speeds = np.abs(np.diff(at, axis=0)) / np.diff(route.times)[:, None]
    assert speeds.max(axis=1) == pytest.approx(0.1)


def test_fail_safe_places_keep_the_goal_within_reach():
    """At every such place and for every drive, walking with that drive fixed gets to the goal."""
    machine = platform('UPS', 7)
    axes = Axis('vx', -0.12, 0.12, 13), Axis('vy', -0.12, 0.12, 13), Axis('wz', -0.4, 0.4, 25)
    machine = replace(machine, task=replace(machine.task, major=tuple(
        name for name in machine.task.coordinates if name != 'wz')))
    found = tolerance_map(machine, Grid(axes))
    goal = {'vx': 0.06}
    safe = fail_safe(found, goal)
    good = found.reachable & found.tolerable
    assert 0 < safe.sum() < good.sum()
    values = found.measures.actuator_values.reshape(*found.grid.shape, -1)
    for spot in np.argwhere(safe)[::97]:
        for drive in range(values.shape[-1]):
            value = values[..., drive]
            steps = max(np.nanmax(np.abs(np.diff(value, axis=axis))) for axis in range(3))
            near = good & (np.abs(value - value[tuple(spot)]) <= steps)
            # With vx and vy of the goal there is a pose at which the drive has its value.
            assert near[9, 6].any()


def test_a_fail_safe_route_stays_on_fail_safe_places():
    axes = Axis('vx', -0.04, 0.04, 9), Axis('vy', -0.02, 0.02, 5), Axis('wz', -0.3, 0.3, 25)
    found = tolerance_map(PLATFORM, Grid(axes))
    start, goal = {'vx': -0.01}, {'vx': 0.01}
    safe = fail_safe(found, goal)
    route = widest_route(found, start, goal, safe)
    for pose in route.poses:
        place = [round((value - axis.low) / axis.step)
                 for value, axis in zip(pose, axes, strict=True)]
        assert safe[tuple(place)]
    # All waypoints and drives: python -m benchmark.replays
    outcomes = replayed(found, route.poses[:2], goal, ['leg_1'])
    assert [one.reached for one in outcomes] == [True, True]


def test_a_drive_that_sticks_elsewhere_puts_the_goal_out_of_reach():
    axes = Axis('vx', -0.04, 0.04, 9), Axis('vy', -0.02, 0.02, 5), Axis('wz', -0.3, 0.3, 25)
    found, goal = tolerance_map(PLATFORM, Grid(axes)), {'vx': 0.04}
    safe, spot = fail_safe(found, goal), (0, 0, 4)
    assert (found.reachable & found.tolerable)[spot] and not safe[spot]
    pose = found.grid.poses.reshape(9, 5, 25, 3)[spot]
    assert [one.reached for one in replayed(found, [pose], goal, ['leg_6'])] == [False]


@pytest.mark.parametrize(('goal', 'words'), [
    ('vx=0.35', 'the goal is out of reach'),
    ('vx=0.05', 'a drive that sticks at the start puts the goal out of reach'),
])
def test_why_there_is_no_route(goal, words, tmp_path, capsys):
    ends = ['--from', 'vx=0', '--to', goal, '--over', 'vx=-0.4:0.4:81', '--fail-safe']
    assert main(['route', 'gough_stewart_8', '--json', '--output', str(tmp_path), *ends]) == 0
    report = json.loads(capsys.readouterr().out)
    assert not report['found'] and report['reason'] == words
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--from', 'vx=0', '--to', 'vx=0'], 'vx is the same at both ends: give --over'),
    (['--from', 'vx=0', '--to', 'vy=1', '--over', 'vx=0:1:3'], 'vy is not a coordinate of the'),
    (['--from', 'vx=0', '--to', 'vx=2', '--over', 'vx=0:1:3'], 'vx 2 is not on the map (0 to 1)'),
    (['--from', 'vx=0', '--to', 'vx'], "'vx' is not NAME=VALUE"),
])
def test_wrong_input_is_one_line(arguments, words, capsys, tmp_path):
    try:
        code = main(['route', 'gough_stewart_8', *arguments, '--output', str(tmp_path)])
    except SystemExit as left:
        code = left.code
    error = capsys.readouterr().err
    assert code == 2 and error.count('\n') == 1
    assert words in error


def test_an_end_outside_is_refused():
    found = tolerance_map(PLATFORM, Grid((Axis('vx', 0.0, 0.1, 3),)))
    with pytest.raises(FaultToleranceError, match='vx -1 is not on the map'):
        widest_route(found, {'vx': -1.0}, {'vx': 0.1})
