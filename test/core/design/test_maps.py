# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Maps: grids, what they add up to, files, and the command."""

import json
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256

import numpy as np
import pytest
from core.design.test_pose_measures import platform

from fault_tolerance.cli import main
from fault_tolerance.design.grids import Axis, Grid, grid_around
from fault_tolerance.design.map_files import map_arrays
from fault_tolerance.design.maps import tolerance_map
from fault_tolerance.design.pose_measures import pose_measures
from fault_tolerance.errors import FaultToleranceError, MechanismError
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path

PLATFORM = mechanism_named('gough_stewart_8')
SQUARE = Grid((Axis('wx', -0.4, 0.4, 9), Axis('vz', -0.12, 0.12, 7)))


def test_a_map_has_the_worst_next_failure_of_every_pose():
    found = tolerance_map(PLATFORM, SQUARE, ['lost:strut_3'])
    for i, j in ((4, 3), (3, 2), (5, 4)):
        pose = {'wx': float(SQUARE.axes[0].places[i]), 'vz': float(SQUARE.axes[1].places[j])}
        ahead = after(PLATFORM, ['lost:strut_3'], pose=pose).next_failure
        for name in ('position', 'torque', 'hard'):
            wanted = np.nanmin(getattr(ahead, name))
            assert getattr(found, name)[i, j] == pytest.approx(wanted, abs=1e-9), name


def test_reachable_is_within_all_strokes():
    """A platform that only rises has legs of known lengths."""
    grid = Grid((Axis('vz', -0.12, 0.12, 241),))
    found = tolerance_map(PLATFORM, grid)
    leg = np.array([-0.205700661005, -0.113927663889, 0.6])
    length = np.sqrt(leg[0] ** 2 + leg[1] ** 2 + (0.6 + grid.axes[0].places) ** 2)
    stretch = length - np.linalg.norm(leg)
    clear = np.abs(np.abs(stretch) - 0.1) > 1e-3
    np.testing.assert_array_equal(found.reachable[clear], (np.abs(stretch) <= 0.1)[clear])
    # Each pose stands for a step.
    high = np.interp(0.1, stretch, grid.axes[0].places)
    low = np.interp(-0.1, stretch, grid.axes[0].places)
    volume = found.volume_of(found.reachable)
    assert volume == pytest.approx(high - low, abs=2 * grid.axes[0].step)


def test_the_worst_place_is_where_the_smallest_measure_is():
    found = tolerance_map(PLATFORM, SQUARE)
    place = found.worst_place()
    assert place['measure'] == pytest.approx(np.nanmin(found.worst))
    post = after(PLATFORM, pose=place['at'])
    assert str(post.next_failure.worst) == place['failure']
    assert post.next_failure.worst_measure == pytest.approx(place['measure'], abs=1e-9)


def test_results_are_the_same_whoever_does_the_work():
    grid = Grid((Axis('wx', -0.2, 0.2, 150), Axis('vz', -0.05, 0.05, 150)))
    alone = map_arrays(tolerance_map(PLATFORM, grid, certified=True))
    with ThreadPoolExecutor(3) as executor:
        shared = map_arrays(tolerance_map(PLATFORM, grid, certified=True, executor=executor))
    for name, values in alone.items():
        np.testing.assert_array_equal(values, shared[name], err_msg=name)


@pytest.mark.parametrize(('mechanism', 'size'), [
    (PLATFORM, 0.2), (platform('UPS'), 0.3), (platform('SPS'), 0.3), (platform('PUS'), 0.2),
    (platform('RSS'), 0.05),
], ids=lambda one: getattr(one, 'name', ''))
def test_no_cell_is_certified_falsely(mechanism, size):
    """Poses drawn at random from certified cells: every one holds, by at least what was proven."""
    turns = Axis('wx', -size, size, 11), Axis('wz', -1.5 * size, size, 13)
    grid = Grid((*turns, Axis('vx', -0.1 * size, 0.5 * size, 5)))
    check_certificates(mechanism, grid, 20_000)


@pytest.mark.slow
def test_no_cell_is_certified_falsely_in_a_million_checks():
    grid = Grid((Axis('wx', -0.5, 0.5, 31), Axis('wz', -0.6, 0.6, 31), Axis('vx', -0.2, 0.2, 9)))
    check_certificates(PLATFORM, grid, 10**6)


def check_certificates(mechanism, grid, count):
    found = tolerance_map(mechanism, grid, certified=True)
    whole = np.flatnonzero(found.proof.share.ravel() == 1.0)
    assert len(whole) > 20
    rng = np.random.default_rng(0)
    # The sides of a cell count too.
    spots = np.clip(rng.uniform(-1.2, 1.2, (count, len(grid.axes))), -1.0, 1.0)
    chosen = rng.choice(whole, count)
    steps = np.array([axis.step for axis in grid.axes])
    measures = pose_measures(mechanism, grid.names, grid.centres[chosen] + spots * steps / 2)
    low, high = mechanism.position_limits.T
    values = measures.actuator_values
    assert measures.tolerable.all()
    assert ((values >= low - 1e-12) & (values <= high + 1e-12)).all()
    smallest = np.fmin(measures.position.min(axis=1), measures.torque.min(axis=1))
    assert (smallest >= found.proof.least.ravel()[chosen]).all()
    # And it is no empty promise.
    share = found.volume_of(found.tolerable & found.reachable) / grid.weights.sum()
    assert found.proof.share.mean() > 0.5 * share


def test_halving_leaves_little_undecided():
    grid = Grid((Axis('wx', -0.4, 0.4, 5), Axis('wy', -0.4, 0.4, 5)))
    proof = tolerance_map(PLATFORM, grid, certified=True).proof
    fine = Grid((Axis('wx', -0.4, 0.4, 201), Axis('wy', -0.4, 0.4, 201)))
    found = tolerance_map(PLATFORM, fine)
    share = found.volume_of(found.tolerable & found.reachable) / fine.weights.sum()
    assert share - 0.06 < proof.share.mean() <= share + 0.001


def test_what_cannot_be_certified_is_said():
    grid = Grid((Axis('wx', -0.01, 0.01, 3),))
    with pytest.raises(MechanismError, match='cells cannot be certified: the struts are not all'):
        tolerance_map(mechanism_named('mirror_4_strut'), grid, certified=True)
    with pytest.raises(MechanismError, match='cells cannot be certified: a drive is stuck'):
        tolerance_map(PLATFORM, grid, ['stuck:leg_1'], certified=True)


@pytest.mark.parametrize(('axes', 'words'), [
    ([Axis('wx', 0, 1, 2)] * 2, 'a coordinate is named twice'),
    ([], 'a map is over 1 to 3 coordinates, not 0'),
    ([Axis(name, 0, 1, 10_000) for name in ('vx', 'vy')], '100000000 poses, at most'),
])
def test_grids_that_cannot_be(axes, words):
    with pytest.raises(FaultToleranceError, match=words):
        Grid(tuple(axes))


def test_the_command_writes_what_it_says(tmp_path, capsys):
    over = ['--over', 'wx=-0.3:0.3:7', '--over', 'vz=-0.1:0.1:5']
    options = ['--certified', '--json', '--output', str(tmp_path)]
    assert main(['map', 'gough_stewart_8', *over, *options]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report == json.loads((tmp_path / 'map.json').read_text())
    digest = sha256(mechanism_path('gough_stewart_8').read_bytes()).hexdigest()
    assert report['sha256'] == digest
    arrays = np.load(tmp_path / 'map.npz')
    np.testing.assert_allclose(arrays['wx'], np.linspace(-0.3, 0.3, 7))
    for name in ('position', 'torque', 'hard', 'smallest_singular_value', 'condition_number',
                 'tolerable', 'reachable'):
        assert arrays[name].shape == (7, 5), name
    assert arrays['certified'].shape == (6, 4)
    good = (arrays['tolerable'] & arrays['reachable']).mean()
    assert 0 < report['volume']['certified'] <= report['volume']['fault_tolerant']
    assert 0.2 < good < 1.0
    page = (tmp_path / 'map.html').read_text()
    assert digest in page and 'http' not in page.replace('http://www.w3.org', '')
    assert (tmp_path / 'map.png').stat().st_size > 20_000


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--over', 'wx=0:1'], "'wx=0:1' is not NAME=LOW:HIGH:COUNT"),
    (['--over', 'wx=0:1:1'], 'wx: 1 places, at least 2'),
    (['--over', 'wx=1:0:5'], 'wx: 1 to 0 is no range'),
    (['--over', 'wx=0:nan:5'], 'wx: 0 to nan is no range'),
    (['--over', 'wq=0:1:5'], "'wq' is not a task coordinate; valid: wx, wy"),
    (['--over', 'wx=0:4:5'], 'a rotation vector is at most pi long'),
    ([], 'the following arguments are required: --over'),
    (['--over', 'vx=0:1:2', '--failed', 'stuck:leg_9'], 'leg_9'),
])
def test_wrong_input_is_one_line(arguments, words, capsys, tmp_path):
    try:
        code = main(['map', 'gough_stewart_8', *arguments, '--output', str(tmp_path)])
    except SystemExit as left:
        code = left.code
    error = capsys.readouterr().err
    assert code == 2 and error.count('\n') == 1
    assert words in error


def test_the_ends_of_a_route_are_places_of_the_grid_around_them():
    start, goal = {'vx': -0.12, 'vy': 0.1}, {'wz': 0.2, 'vy': 0.1}
    for axis in grid_around(start, goal).axes:
        for end in (start, goal):
            assert np.abs(axis.places - end.get(axis.name, 0.0)).min() < 1e-12
            assert axis.low < end.get(axis.name, 0.0) < axis.high
        assert 15 < axis.count < 30
