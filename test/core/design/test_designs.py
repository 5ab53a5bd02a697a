# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Designs: known optima are found, constraints hold, and mistakes in a file are named."""

import json
from concurrent.futures import ThreadPoolExecutor
from io import StringIO
from math import pi, sin
from pathlib import Path

import numpy as np
import pytest
import yaml
from rich.console import Console

from benchmark.optima import POSITION, TORQUE, position_design, torque_design
from fault_tolerance.cli import main
from fault_tolerance.design.design_files import comparison, comparison_table
from fault_tolerance.design.objectives import Objective
from fault_tolerance.design.optimum import best_design, strut_distances, trade_off
from fault_tolerance.design.specification import specification_from_file
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.kinematics.actuator_measures import torque_measure
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

EXAMPLES = Path(__file__).parents[3] / 'examples' / 'designs'
MIRROR = {
    'design': 'mirror', 'mechanism': 'mirror_4_strut',
    'free': [
        {'path': [f'struts.strut_{i}.joints.{joint}_{i}.point[{axis}]' for joint in
                  ('hinge', 'ball')], 'range': [-0.03, 0.03]}
        for i in (1, 2) for axis in (0, 1)
    ],
    'objectives': [{'measure': 'position'}, {'measure': 'torque'}],
    'population': 8, 'generations': 3, 'polish': 1,
}


def specification(folder, **changes):
    file = folder / 'design.yaml'
    file.write_text(yaml.safe_dump({**MIRROR, **changes}))
    return specification_from_file(file)


# `python -m benchmark.optima` finds those of up to nine drives.
@pytest.mark.parametrize('sizes', [(4, 3, 1), (5, 3, 2), (6, 3, 2)], ids=str)
def test_the_best_worst_torque_measures_are_found(sizes, tmp_path):
    found = torque_design(tmp_path, *sizes, generations=5, polish=14)
    assert found.worst[0] == pytest.approx(TORQUE[sizes], abs=1e-3)


def test_the_best_worst_position_measure_is_found(tmp_path):
    found = position_design(tmp_path, 4, 2, 2, generations=5, polish=6)
    assert found.worst[0] == pytest.approx(POSITION[4, 2, 2], abs=1e-3)


def test_bounds_and_packings_are_those_of_known_mechanisms():
    """The evenly spaced mirror attains both with five struts, and neither with six and pairs."""
    pairs, singles = Objective('torque', 2), Objective('torque', 1)
    five, six = (after(evenly_spaced_mirror(count)) for count in (5, 6))
    assert singles.values(five).min() == pytest.approx(singles.bound(five))
    assert pairs.values(five).min() == pytest.approx(2 / 5 * sin(pi / 5))
    assert pairs.packing(five) == pytest.approx(2 / 5 * sin(pi / 5))
    assert pairs.bound(five) == pytest.approx(0.316228, abs=1e-6)
    # Of an icosahedron.
    assert pairs.packing(six) == pytest.approx(0.447214, abs=1e-6)
    assert pairs.values(six).min() == pytest.approx(0.372678, abs=1e-6)
    triple = Objective('torque', 3).values(six)
    assert triple.min() == pytest.approx(0.117851, abs=1e-6)
    assert triple[0] == pytest.approx(torque_measure(six.present, [0, 1, 2]))


def test_the_measures_of_an_objective_are_those_of_the_definition():
    post = after(mechanism_named('gough_stewart_8'), pose={'wx': 0.1, 'vz': 0.02})
    ahead = post.next_failure
    for name in ('position', 'torque', 'hard'):
        np.testing.assert_allclose(Objective(name).values(post), getattr(ahead, name), atol=1e-12)
    sigma = Objective('smallest_singular_value').values(post)
    assert sigma == pytest.approx([post.measures.smallest_singular_value])


def test_a_better_mirror_is_a_file_that_measures_agree_with(tmp_path, capsys):
    """Two struts of the four are moved out of place; two numbers of each bring them back."""
    base = spoilt(tmp_path, [[0.005, 0.015], [0.012, 0.011]])
    (tmp_path / 'design.yaml').write_text(yaml.safe_dump(MIRROR | {'mechanism': base}))
    output = tmp_path / 'out'
    assert main(['design', str(tmp_path / 'design.yaml'), '--json', '--output', str(output)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report == json.loads((output / 'design.json').read_text())
    p, t = report['objectives']
    assert t['start'] < 0.4 and t['worst'] == pytest.approx(0.5, abs=1e-3)
    assert t['over_bound'] == pytest.approx(1.0, abs=2e-3)
    assert main(['measures', str(output / 'mechanism.yaml'), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert min(found['torque'].values()) == pytest.approx(t['worst'], abs=1e-9)
    assert min(found['position'].values()) == pytest.approx(p['worst'], abs=1e-9)
    assert (output / 'design.png').stat().st_size > 10_000
    assert 'strut_1' in (output / 'design.html').read_text()


def test_designs_are_compared_by_their_number_of_drives(tmp_path, capsys):
    quick = {'population': 4, 'generations': 1, 'polish': 1,
             'objectives': [{'measure': 'torque'}, {'measure': 'position'}]}
    for name, count in (('five', 5), ('four', 4)):
        assert main(['new', 'mirror', '--struts', str(count), '--radius', '0.02', '--length',
                     '0.03', '-o', str(tmp_path / f'mirror_{name}.yaml')]) == 0
        strut = yaml.safe_load((tmp_path / f'mirror_{name}.yaml').read_text())['struts'][0]
        drive = next(one['name'] for one in strut['joints'] if one.get('actuated'))
        path = f'struts.{strut["name"]}.joints.{drive}.axis[0]'
        (tmp_path / f'{name}.yaml').write_text(yaml.safe_dump({
            'design': name, 'mechanism': f'mirror_{name}.yaml',
            'free': [{'path': path, 'range': [-1e-6, 1e-6]}], **quick}))
    files, output = [str(tmp_path / f'{name}.yaml') for name in ('five', 'four')], tmp_path / 'out'
    capsys.readouterr()
    assert main(['design', *files, '--json', '--output', str(output)]) == 0
    compared = json.loads(capsys.readouterr().out)
    assert compared['objectives'] == [
        {'measure': 'torque', 'failures': 1}, {'measure': 'position', 'failures': 1}]
    five, four = compared['designs']
    assert (five['actuators'], four['actuators']) == (5, 4)
    # More drives buy tolerance of free ones; neither beats the other.
    assert (five['worst'][0], four['worst'][0]) == pytest.approx((0.4**0.5, 0.5), abs=1e-3)
    assert (five['beaten_by'], four['beaten_by']) == (None, None)
    for name in ('five', 'four'):
        report = json.loads((output / name / 'design.json').read_text())
        assert report['design'] == name


def report_of(name, actuators, *worst, measure='torque'):
    return {'design': name, 'actuators': actuators, 'objectives': [
        {'measure': measure, 'failures': 1, 'worst': one} for one in worst]}


def test_a_design_is_beaten_by_one_with_no_more_drives_that_is_nowhere_worse():
    compared = comparison([
        report_of('a', 4, 0.5, 0.5), report_of('b', 4, 0.5, 0.6), report_of('c', 5, 0.5, 0.6),
        report_of('d', 5, 0.7, 0.1), report_of('e', 4, 0.5, 0.6)])
    assert [one['beaten_by'] for one in compared['designs']] == ['b', None, 'b', None, None]
    console = Console(width=80, file=StringIO())
    console.print(comparison_table(compared))
    lines = [line.split() for line in console.file.getvalue().splitlines()]
    assert ['c', 'b', '5', '0.50000', '0.60000'] in lines
    assert [words[0] for words in lines if len(words) > 3 and words[1] != 'beaten'] == [
        'a', 'b', 'e', 'c', 'd']
    with pytest.raises(FaultToleranceError, match='two designs have one name: a, a'):
        comparison([report_of('a', 4, 0.5), report_of('a', 5, 0.5)])
    with pytest.raises(FaultToleranceError, match='b has other objectives than a'):
        comparison([report_of('a', 4, 0.5), report_of('b', 5, 0.5, measure='position')])


def spoilt(folder, places):
    """Write a mirror some of whose struts are out of place; return the name of its file."""
    document = yaml.safe_load(mechanism_path('mirror_4_strut').read_text())
    for strut, place in enumerate(places):
        for joint in (0, 2):
            document['struts'][strut]['joints'][joint]['point'][:2] = place
    (folder / 'spoilt.yaml').write_text(yaml.safe_dump(document))
    return 'spoilt.yaml'


def test_struts_keep_their_distance(tmp_path):
    """The best place for strut 1 within its ranges is too near to strut 2."""
    free = [one | {'range': limits} for one, limits in zip(
        MIRROR['free'][:2], ([0.01, 0.04], [-0.005, 0.012]), strict=True)]
    asked = {'mechanism': spoilt(tmp_path, [[0.015, 0.002]]), 'free': free,
             'objectives': [{'measure': 'torque'}]}
    loose = best_design(specification(tmp_path, **asked))
    tight = best_design(specification(tmp_path, **asked, constraints={'distance': 0.018}))
    near, far = (strut_distances(one.specification.mechanism(one.values)).min()
                 for one in (loose, tight))
    assert near < 0.017 and far >= 0.018 - 1e-7
    assert tight.worst[0] < loose.worst[0]


def test_distances_of_struts_are_those_of_lines():
    apart = strut_distances(mechanism_named('fsm_4_strut'))
    assert sorted(apart) == pytest.approx([0.7071 * 2**0.5] * 4 + [1.4142] * 2, abs=1e-3)


def test_over_poses_the_worst_of_all_counts(tmp_path):
    over = specification(tmp_path, over=['wx=-0.02:0.02:2', 'wy=-0.02:0.02:2'],
                         constraints={'strokes': True})
    found = best_design(over)
    mechanism = over.mechanism(found.values)
    worst = 1.0
    for wx in (-0.02, 0.02):
        for wy in (-0.02, 0.02):
            post = after(mechanism, pose={'wx': wx, 'wy': wy})
            worst = min(worst, post.next_failure.torque.min())
            assert np.abs(post.configuration.actuator_values).max() <= 0.0006 + 1e-9
    assert found.worst[1] == pytest.approx(worst, abs=1e-9)


def test_symmetry_turns_a_strut_into_another(tmp_path):
    turned = specification(tmp_path, free=MIRROR['free'][:2], symmetry=[
        {'from': 'strut_1', 'to': 'strut_3', 'turn': 180}])
    mechanism = turned.mechanism(np.array([0.011, 0.007]))
    for name, wanted in (('strut_1', [0.011, 0.007]), ('strut_3', [-0.011, -0.007])):
        strut = next(one for one in mechanism.struts if one.name == name)
        np.testing.assert_allclose(strut.joints[-1].point[:2], wanted, atol=1e-15)


def test_the_result_is_the_same_whoever_does_the_work(tmp_path):
    asked = specification(tmp_path)
    with ThreadPoolExecutor(3) as executor:
        shared = best_design(asked, executor)
    np.testing.assert_array_equal(best_design(asked).values, shared.values)


def test_none_of_the_designs_of_a_trade_off_beats_another(tmp_path):
    example = yaml.safe_load((EXAMPLES / 'platform.yaml').read_text())
    quick = {'free': example['free'][:5], 'population': 5, 'generations': 1, 'polish': 1}
    found = best_design(specification(tmp_path, **example | quick | {'tradeoff': 3}))
    points = np.array(trade_off(found))
    assert len(points) > 1
    # From left to right the second falls.
    assert (np.diff(points[:, 0]) > 0).all() and (np.diff(points[:, 1]) < 0).all()
    assert (points > 0.0).all() and points[:, 1].max() <= 6**-0.5 + 1e-6
    assert (np.abs(points - found.worst).max(axis=1) < 1e-6).any() or (
        (points > np.array(found.worst) - 1e-6).all(axis=1).any())


def test_the_example_is_a_specification():
    found = specification_from_file(EXAMPLES / 'platform.yaml')
    assert len(found.free) == 16
    assert found.mechanism(found.start).name == 'gough_stewart_8'


def test_no_design_is_said(tmp_path):
    with pytest.raises(FaultToleranceError, match='no design was found that meets the const'):
        best_design(specification(tmp_path, constraints={'distance': 1.0}))
    with pytest.raises(FaultToleranceError, match='no design was found that bears every failure'):
        best_design(specification(tmp_path, objectives=[{'measure': 'torque', 'failures': 2}]))


@pytest.mark.parametrize(('changes', 'words'), [
    ({'free': []}, 'free: is empty'),
    ({'free': [{'path': 'struts.strut_9.x', 'range': [0, 1]}]},
     "free.[0].path: 'struts.strut_9.x' is not in the mechanism file"),
    ({'free': [{'path': 'mechanism', 'range': [0, 1]}]}, "'mechanism' is not a number"),
    ({'free': [{'path': 'compliance', 'range': [1, 0]}]}, '[1, 0] is not an interval'),
    ({'objectives': [{'measure': 'beauty'}]}, "'beauty' is not one of position, torque, hard"),
    ({'objectives': [{'measure': 'hard', 'failures': 4}]}, 'failures: is 4, at most 3'),
    ({'mechanism': 'nothing'}, 'nothing: is neither a file nor a shipped mechanism'),
    ({'over': ['wq=0:1:3']}, "'wq' is not a task coordinate"),
    ({'over': ['wx=0:1']}, "over: 'wx=0:1' is not NAME=LOW:HIGH:COUNT"),
    ({'symmetry': [{'from': 'a', 'to': 'strut_1', 'turn': 9}]}, "'a' is not a strut"),
    ({'constraints': {'weight': 3}}, 'weight: is not a known key here'),
    ({'colour': 'red'}, 'colour: is not a known key here'),
    ({'tradeoff': 3, 'objectives': [{'measure': 'hard'}]}, 'is between two objectives, not 1'),
    ({'population': 2.5}, 'population: is 2.5, expected a whole number from 1 on'),
])
def test_mistakes_are_named(changes, words, tmp_path, capsys):
    file = tmp_path / 'design.yaml'
    file.write_text(yaml.safe_dump({**MIRROR, **changes}))
    assert main(['design', str(file), '--output', str(tmp_path / 'out')]) == 2
    error = capsys.readouterr().err
    assert words in error and error.count('\n') == 1


def test_a_file_that_is_missing_is_named(tmp_path, capsys):
    assert main(['design', str(tmp_path / 'none.yaml')]) == 2
    assert 'none.yaml: cannot be read (No such file or directory)' in capsys.readouterr().err
