# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Where a plausible implementation goes wrong."""

from itertools import combinations
from math import sin, sqrt

import numpy as np
import pytest
from core import cases
from core.mechanisms import (
    by_numbers,
    even_mirror,
    made,
    planar_4rpr,
    prismatic,
    revolute,
    serial_3r,
)

from fault_tolerance.kinematics.actuator_measures import position_measure, torque_measure
from fault_tolerance.kinematics.measures import next_failure, present_measures
from fault_tolerance.kinematics.paper_formulas import position_measure_by_theorem_2
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.kinematics.subspaces import manipulability
from fault_tolerance.mechanism.configuration import home_configuration, solved_configuration
from fault_tolerance.tolerances import CONDITION_CAP

# A constraint singularity at home.


@pytest.mark.parametrize('angle', [1e-6, 1e-4, 1e-3, 1e-2, 2.6e-2])
@pytest.mark.parametrize('name', ['fsm_4_strut', 'mirror_4_strut'])
def test_tilted_about_both_axes_a_rigid_four_strut_mirror_loses_a_freedom(name, angle):
    rows = strut_rows(cases.tilted(name, angle, angle))
    absorbed = reconfigured(rows)
    assert (absorbed.verdict.mobility, absorbed.verdict.tolerable) == (3, True)
    assert absorbed.present.absorbed == 1
    rigid = reconfigured(rows.with_compliance(0.0))
    assert (rigid.verdict.mobility, rigid.verdict.tolerable) == (2, False)
    assert rigid.present.absorbed == 0
    # Whichever way the tilt goes, with the radius for characteristic length.
    tilt = sqrt(2.0) * angle
    assert rigid.present.weakest_kept == pytest.approx(sqrt(0.5) * sin(tilt), rel=1e-3)
    one = reconfigured(strut_rows(cases.tilted(name, angle, 0.0)).with_compliance(0.0))
    assert one.present.weakest_kept == pytest.approx(sqrt(0.5) * sin(angle), rel=1e-3)


@pytest.mark.parametrize(
    ('tilt', 'kept', 'gone'), [((0.02, 0.0), 'wx', 'wy'), ((0.0, 0.02), 'wy', 'wx')])
def test_tilted_about_one_axis_it_keeps_that_one(tilt, kept, gone):
    """The two freedoms of the paper: that axis and the lift."""
    rows = strut_rows(cases.tilted('fsm_4_strut', *tilt)).with_compliance(0.0)
    state = reconfigured(rows)
    assert state.verdict.mobility == 2
    expected = np.zeros((6, 2))
    expected[['wx', 'wy', 'wz', 'vx', 'vy', 'vz'].index(kept), 0] = 1.0
    expected[5, 1] = 1.0
    basis, _ = np.linalg.qr(state.present.twist_jacobian)
    np.testing.assert_allclose(basis @ basis.T, expected @ expected.T, atol=1e-9)
    assert f'{gone} cannot be given independently' in state.verdict.reason


def test_lifted_only_it_keeps_all_three():
    rows = strut_rows(cases.tilted('fsm_4_strut', 0.0, 0.0, lift=0.03)).with_compliance(0.0)
    assert reconfigured(rows).verdict.mobility == 3


def test_the_limit_of_compliance_belongs_to_what_is_absorbed():
    rows = strut_rows(cases.tilted('fsm_4_strut', 0.02, 0.01))
    weakest = reconfigured(rows.with_compliance(0.0)).present.weakest_kept
    at_limit = reconfigured(rows.with_compliance(weakest * (1.0 + 1e-12)))
    assert (at_limit.present.mobility, at_limit.present.absorbed) == (3, 1)
    below = reconfigured(rows.with_compliance(weakest * (1.0 - 1e-12)))
    assert (below.present.mobility, below.present.absorbed) == (2, 0)


def test_off_home_a_lost_strut_is_not_a_free_actuator():
    """Its hinge barred something: without it the rigid mirror has one freedom more."""
    rows = strut_rows(cases.tilted('fsm_4_strut', 0.02, 0.02)).with_compliance(0.0)
    mechanism = rows.mechanism
    free = reconfigured(rows, cases.failure_set(mechanism, [('torque', 'theta_3')]))
    lost = reconfigured(rows, cases.failure_set(mechanism, [('hard', 'strut_3')]))
    assert (free.verdict.mobility, lost.verdict.mobility) == (2, 3)
    assert lost.verdict.tolerable and lost.verdict.gained == ('wy',)
    # With the compliance they are alike.
    rows = rows.with_compliance(0.05)
    free = reconfigured(rows, cases.failure_set(mechanism, [('torque', 'theta_3')]))
    lost = reconfigured(rows, cases.failure_set(mechanism, [('hard', 'strut_3')]))
    assert (free.verdict.mobility, lost.verdict.mobility) == (3, 3)


def test_locked_actuators_are_never_absorbed():
    """However large the compliance: it is for the structure."""
    for angle in (0.0, 0.02):
        rows = strut_rows(cases.tilted('fsm_4_strut', angle, angle)).with_compliance(0.9)
        for stuck, mobility in (([], 3), (['theta_4'], 2), (['theta_1', 'theta_4'], 1)):
            failures = cases.failure_set(
                rows.mechanism, [('position', name) for name in stuck])
            assert reconfigured(rows, failures).present.mobility == mobility


# The rank is part of a measure.

def test_two_stuck_actuators_look_healthy_without_the_rank():
    state = cases.state(
        cases.home('fsm_4_strut'), [('position', 'theta_1'), ('position', 'theta_4')])
    major = state.present.major
    assert major.shape == (2, 1)
    largest = sqrt(np.linalg.det(major.T @ major))  # the classical measure of a tall matrix
    classical = largest / sqrt(np.linalg.det(state.nominal.major @ state.nominal.major.T))
    assert classical == pytest.approx(sqrt(0.5), abs=1e-12)
    assert present_measures(state).position == 0.0
    assert present_measures(state).retained_manipulability == 0.0
    assert position_measure(state.nominal, [0, 3]) == 0.0
    assert position_measure_by_theorem_2(state.nominal.major, state.nominal.mapping, [0, 3]) == 0.0


def test_manipulability_needs_the_rank_it_is_asked_for():
    matrix = np.diag([3.0, 2.0, 1e-12])
    assert manipulability(matrix, 2) == pytest.approx(6.0)
    assert manipulability(matrix, 3) == 0.0
    assert manipulability(matrix, 4) == 0.0
    assert manipulability(matrix, 0) == 1.0
    assert manipulability(np.zeros((2, 2)), 1) == 0.0
    assert manipulability(np.zeros((0, 3)), 1) == 0.0
    assert manipulability(np.zeros((2, 0)), 0) == 1.0


@pytest.mark.parametrize('name', ['fsm_3_strut', 'fsm_4_strut', 'hexapod_8', 'fsm_overactuated'])
def test_more_failures_than_redundancy_are_zero(name):
    nominal = cases.state(cases.home(name)).nominal
    count, mobility, major = len(nominal.mapping), nominal.mobility, len(nominal.major)
    for size in range(1, min(count, 4) + 1):
        for chosen in combinations(range(count), size):
            if size > count - mobility:
                assert torque_measure(nominal, chosen) == 0.0
            rank = np.linalg.matrix_rank(nominal.mapping[list(chosen)], 1e-9)
            if rank > mobility - major:
                assert position_measure(nominal, chosen) == 0.0


# Rounding errors are not motion.


@pytest.mark.parametrize('coordinates', [['vz'], ['wx'], ['wx', 'vz'], ['wy', 'vz', 'wx']])
@pytest.mark.parametrize('document', [planar_4rpr, serial_3r])
def test_a_task_the_mechanism_cannot_do_at_all(document, coordinates):
    """Where nothing moves there is nothing to compare a rounding error with."""
    mechanism = made({**document(), 'task': {'coordinates': coordinates}})
    first, second = mechanism.actuator_names[:2]
    for values in ({}, {first: 0.05, second: -0.03}):
        state = cases.state(solved_configuration(mechanism, values))
        assert state.verdict.stable and not state.verdict.tolerable
        assert 'cannot be given independently' in state.verdict.reason
        np.testing.assert_array_equal(state.nominal.jacobian, 0.0)
        np.testing.assert_array_equal(next_failure(state).position, 0.0)
        measures = present_measures(state)
        assert measures.retained_manipulability == 0.0
        assert measures.condition_number == CONDITION_CAP


def test_drives_that_move_nothing_but_each_other():
    """A platform held by six passive struts of no freedom, and a seventh with two drives."""
    held = {'name': 'bar', 'joints': [revolute('lock', [0, 0, 1], [0, 0, 0])]}
    other = {'name': 'brace', 'joints': [revolute('latch', [0, 0, 1], [1, 0, 0])]}
    idle = [revolute(f'idle_{i}', axis, [0.1 * i, 0.2, 0.3 * i]) for i, axis in enumerate(
        [[1, 0, 0.1], [0, 1, 0.2], [0.3, 0, 1], [1, 1, 0], [0.5, 1, 1]])]
    for joint in (idle[1], idle[3], idle[4]):
        joint['actuated'] = True
    idle += [prismatic('slide_1', [1, 0, 0]), prismatic('slide_2', [0.2, 1, 0])]
    mechanism = made({
        'mechanism': 'locked', 'platform': {'origin': [0.3, 0.2, 1]},
        'task': {'coordinates': ['vx', 'vy']},
        'struts': [held, other, {'name': 'idle', 'joints': idle}],
    })
    state = cases.state(home_configuration(mechanism))
    assert state.verdict.stable and state.verdict.mobility > 0
    np.testing.assert_array_equal(state.nominal.twist_jacobian, 0.0)
    assert not state.verdict.tolerable


# Failures that depend on each other.

def twin_mirror():
    """Return a mirror with two struts at the very same place: their drives move alike."""
    document = even_mirror(3)
    twin = even_mirror(3)['struts'][0]
    twin['name'] = 'twin'
    for joint in twin['joints']:
        joint['name'] = f'twin_{joint["name"]}'
    document['struts'].append(twin)
    return made(document)


def test_dependent_stuck_actuators_count_once():
    mechanism = twin_mirror()
    state = cases.state(home_configuration(mechanism))
    nominal = state.nominal
    assert (nominal.mobility, len(nominal.mapping)) == (3, 4)
    np.testing.assert_allclose(nominal.mapping[0], nominal.mapping[3], atol=1e-15)
    one = position_measure(nominal, [0])
    assert 0.1 < one < 1.0
    assert position_measure(nominal, [3]) == pytest.approx(one, abs=1e-12)
    assert position_measure(nominal, [0, 3]) == pytest.approx(one, abs=1e-12)
    assert position_measure_by_theorem_2(
        nominal.major, nominal.mapping, [0, 3]) == pytest.approx(one, abs=1e-12)
    assert position_measure(nominal, [0, 1]) == 0.0
    both = cases.state(
        home_configuration(mechanism), [('position', 'theta_1'), ('position', 'twin_theta_1')])
    assert (both.verdict.tolerable, both.verdict.mobility) == (True, 2)


def test_dependent_free_actuators():
    mechanism = twin_mirror()
    home = home_configuration(mechanism)
    one = cases.state(home, [('torque', 'theta_1')])
    assert one.verdict.tolerable
    assert present_measures(one).torque == pytest.approx(sqrt(0.5), abs=1e-12)
    both = cases.state(home, [('torque', 'theta_1'), ('torque', 'twin_theta_1')])
    assert not both.verdict.stable
    assert present_measures(both).torque == 0.0


# A free actuator moves; a measure can hide a weak direction.

def test_a_free_actuator_follows_the_platform():
    name = 'fsm_overactuated'
    state = cases.state(cases.away(name), [('torque', 'theta_5')])
    mechanism, present = state.rows.mechanism, state.present
    np.testing.assert_array_equal(present.mapping[4], 0.0)
    assert np.abs(present.rate_map[4]).max() > 0.1
    # By how much, from two configurations the other drives bring about.
    rng = np.random.default_rng(0)
    step = 1e-6 * rng.normal(size=3)
    start = cases.away(name).actuator_values
    drives = cases.independent_drives(name)
    places = [mechanism.actuator_index(drive) for drive in drives]
    ends = [
        dict(zip(drives, start[places] + sign * step, strict=True)) for sign in (-1.0, 1.0)
    ]
    before, after = (solved_configuration(mechanism, end).actuator_values for end in ends)
    change = 0.5 * (after - before)
    reduced = np.linalg.pinv(present.rate_map[places]) @ step
    np.testing.assert_allclose(present.rate_map @ reduced, change, atol=1e-10)


def test_a_weak_direction_shows_in_the_condition_number():
    document = by_numbers()
    document['jacobian'] = [[1, 0, 0], [0, 1e-5, 0], [0, 0, 1]]
    measures = present_measures(cases.state(home_configuration(made(document))))
    assert measures.retained_manipulability == pytest.approx(1.0)
    assert measures.smallest_singular_value == pytest.approx(1e-5)
    assert measures.condition_number == pytest.approx(1e5)
    document['jacobian'][1][1] = 0.0
    lost = cases.state(home_configuration(made(document)))
    assert not lost.verdict.tolerable
    measures = present_measures(lost)
    assert measures.smallest_singular_value == pytest.approx(0.0, abs=1e-12)
    assert measures.condition_number == CONDITION_CAP
    assert next_failure(lost).worst_measure == 0.0


# Nothing left.

@pytest.mark.parametrize('name', cases.NAMES)
@pytest.mark.parametrize('mode', ['position', 'torque', 'hard'])
def test_everything_failed(name, mode):
    """No error, no warning, no number that is not finite, and the right verdict."""
    mechanism = cases.named(name)
    state = cases.state(cases.home(name), [
        (mode, each) for each in
        (mechanism.strut_names if mode == 'hard' else mechanism.actuator_names)
    ])
    verdict, present = state.verdict, state.present
    assert not verdict.tolerable and verdict.mobility == 0
    assert verdict.stable == (mode == 'position')
    assert present.mapping.shape == (len(mechanism.actuators), 0)
    assert present.jacobian.shape == (len(mechanism.task.coordinates), 0)
    if mode == 'hard':
        assert present.unactuated.shape == (6, 6)
    measures = present_measures(state)
    assert measures.retained_manipulability == 0.0 and measures.smallest_singular_value == 0.0
    assert measures.condition_number == CONDITION_CAP
    assert getattr(measures, mode) == 0.0
    ahead = next_failure(state)
    assert np.isnan(ahead.position).all() and np.isnan(ahead.torque).all()
    assert np.isnan(ahead.hard).all() == (mode == 'hard')
    assert np.isfinite(ahead.worst_measure)
    assert np.isfinite([ahead.position_bound, ahead.torque_bound]).all()
    assert (ahead.worst is None) == (mode == 'hard')


@pytest.mark.parametrize(
    ('failure', 'stable', 'word'),
    [
        (('position', 'leg_1'), True, 'leg_1 stuck; wx cannot be given independently'),
        (('torque', 'leg_1'), False, 'leg_1 free; wx, vz unactuated'),
        (('hard', 'strut_1'), False, 'strut_1 lost; wx, vz unactuated'),
        (('hard', 'flap'), False, 'flap lost; wx, wy, wz, vx, vy, vz unactuated'),
    ],
)
def test_one_drive_only(failure, stable, word):
    state = cases.state(cases.home('one_drive'), [failure])
    assert (state.verdict.stable, state.verdict.tolerable) == (stable, False)
    assert state.verdict.reason.startswith(word), state.verdict.reason
