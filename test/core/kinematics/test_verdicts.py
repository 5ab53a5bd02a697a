# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What the verdict says in words, which failure is the worst, and what is nearly singular."""

import numpy as np
import pytest
from core import cases
from core.mechanisms import DOCUMENTS, hexapod, made, scaled
from scipy.spatial.transform import Rotation

from fault_tolerance.kinematics.failures import Failure, FailureMode
from fault_tolerance.kinematics.measures import next_failure, present_measures
from fault_tolerance.kinematics.verdict import failures_in_words
from fault_tolerance.mechanism.configuration import home_configuration, solved_configuration


def verdict(name, *failures):
    return cases.state(cases.home(name), failures).verdict


@pytest.mark.parametrize(
    ('name', 'failures', 'reason'),
    [
        ('fsm_4_strut', [], 'no failure'),
        ('fsm_4_strut', [('stuck', 'theta_4')], 'theta_4 stuck; wx, wy retained, vz coupled'),
        ('fsm_4_strut', [('free', 'theta_4')], 'theta_4 free; wx, wy retained'),
        ('fsm_4_strut', [('lost', 'strut_3')], 'strut_3 lost; wx, wy retained'),
        ('fsm_4_strut', [('free', 'theta_2'), ('stuck', 'theta_1')],
         'theta_1 stuck, theta_2 free; wx, wy retained, vz coupled'),
        ('fsm_overactuated', [('lost', 'strut_2')],
         'strut_2 lost; wx, wy retained, wz gained'),
        ('fsm_overactuated', [('stuck', 'theta_5')],
         'theta_5 stuck; wy cannot be given independently'),
        ('fsm_3_strut', [('stuck', 'theta_1'), ('stuck', 'theta_2'), ('stuck', 'theta_3')],
         'theta_1 stuck, theta_2 stuck, theta_3 stuck; wx, wy cannot be given independently'),
        ('fsm_3_strut', [('free', 'theta_1')],
         'theta_1 free; wy, vz unactuated (1 motion): zero velocity does not hold the platform'),
        ('fsm_3_strut', [('lost', 'strut_1'), ('free', 'theta_2')],
         'theta_2 free, strut_1 lost; wx, wy, wz, vy, vz unactuated (3 motions): '
         'zero velocity does not hold the platform'),
    ],
)
def test_reasons(name, failures, reason):
    assert verdict(name, *failures).reason == reason


def test_drifting_coordinates():
    """Of all six, whether they are in the task or not."""
    lost = verdict('fsm_3_strut', ('lost', 'strut_1'))
    assert lost.drifting == ('wy', 'wz', 'vy', 'vz') and not lost.stable
    assert verdict('fsm_3_strut').drifting == ()


def test_a_drift_is_told_by_its_main_directions():
    """A hexapod's drift has a share in everything; the sentence names what a person would see."""
    drift = verdict('gough_stewart_6', ('free', 'leg_4'))
    assert drift.drifting == ('wx', 'wy', 'wz', 'vx', 'vy', 'vz')
    assert drift.reason.startswith('leg_4 free; mostly ')
    assert ' wx' not in drift.reason


def test_lost_major_coordinates_come_first():
    """Two stuck: one of w_x, w_y is left; the one whose row comes first is kept."""
    both = verdict('fsm_4_strut', ('stuck', 'theta_1'), ('stuck', 'theta_4'))
    assert both.lost == ('wy', 'vz') and both.mobility == 1
    assert verdict('fsm_4_strut', ('stuck', 'theta_1'), ('stuck', 'theta_3')).lost == ('wx', 'vz')


def test_failures_in_words():
    mechanism = cases.named('fsm_overactuated')
    words = failures_in_words(cases.failure_set(
        mechanism, [('free', 'theta_5'), ('stuck', 'theta_1'), ('lost', 'strut_2')]))
    assert words == 'theta_1 stuck, theta_5 free, strut_2 lost'


@pytest.mark.parametrize(
    ('name', 'failures', 'worst', 'measure'),
    [
        ('fsm_3_strut', [], Failure(FailureMode.TORQUE, 'theta_1'), 0.0),
        ('fsm_4_strut', [], Failure(FailureMode.TORQUE, 'theta_1'), 0.5),
        ('fsm_4_strut', [('stuck', 'theta_1')], Failure(FailureMode.POSITION, 'theta_2'), 0.0),
        ('fsm_overactuated', [], Failure(FailureMode.POSITION, 'theta_4'), 0.0),
    ],
)
def test_worst_next_failure(name, failures, worst, measure):
    ahead = next_failure(cases.state(cases.home(name), failures))
    assert ahead.worst == worst
    assert ahead.worst_measure == pytest.approx(measure, abs=1e-12)


def test_a_hard_measure_may_be_healthy_where_the_platform_is_not():
    """P_J looks at the nominal task only: the gained freedom shows in the other numbers."""
    state = cases.state(cases.home('fsm_overactuated'), [('hard', 'strut_2')])
    measures = present_measures(state)
    assert measures.hard == pytest.approx(0.34641, abs=1e-5)
    sizes = np.linalg.svd(state.present.major, compute_uv=False)
    assert measures.smallest_singular_value == pytest.approx(sizes[-1])
    assert measures.condition_number == pytest.approx(sizes[0] / sizes[-1])


def turned_hexapod(angle):
    """Return a hexapod whose platform is turned about z: singular at a right angle."""
    document = hexapod()
    middle = np.mean([strut['joints'][0]['point'] for strut in document['struts']], axis=0)
    turn = Rotation.from_rotvec([0, 0, angle]).as_matrix()
    for strut in document['struts']:
        foot, leg, head = strut['joints']
        point = middle + turn @ (np.array(head['point']) - middle)
        along = point - foot['point']
        head['point'] = point.tolist()
        leg['axis'] = along.tolist()
        side = np.cross(along, [1.0, 0.0, 0.0])
        foot['axes'] = [side.tolist(), np.cross(along, side).tolist()]
    return made(document)


@pytest.mark.parametrize('offset', [1e-2, 1e-4, 1e-6])
def test_near_a_singularity_of_the_platform(offset):
    """A hexapod turned by a right angle is not held; just before it is, weakly."""
    state = cases.state(home_configuration(turned_hexapod(np.pi / 2 - offset)))
    assert state.verdict.stable and state.verdict.tolerable
    sizes = np.linalg.svd(state.present.jacobian, compute_uv=False)
    assert 0.01 < sizes[0] / sizes[-1] * offset < 100.0
    for measure in (present_measures(state).position, present_measures(state).torque):
        assert measure == 1.0
    assert np.isfinite(state.present.jacobian).all()


def test_at_a_singularity_of_the_platform():
    state = cases.state(home_configuration(turned_hexapod(np.pi / 2)))
    assert not state.verdict.stable
    assert state.present.mobility == 5 and state.present.unactuated.shape == (6, 1)
    assert not state.verdict.tolerable
    assert np.isfinite(state.present.jacobian).all()


@pytest.mark.parametrize('size', [1e-6, 1e-3, 100.0])
@pytest.mark.parametrize('name', [name for name in DOCUMENTS if name in cases.RIGID])
def test_the_size_of_the_machine_does_not_matter(name, size):
    """From micrometres to a hundred metres, straight and rotary drives, home and away."""
    document = DOCUMENTS[name]()
    plain, other = made(document), made(scaled(document, size))
    kinds = {drive.name: drive.kind for drive in plain.actuators}
    moves = {
        actuator: value * (size if kinds[actuator] == 'prismatic' else 1.0)
        for actuator, value in cases.moves(name).items()
    }
    pairs = [
        (cases.home(name), home_configuration(other)),
        (cases.away(name), solved_configuration(other, moves)),
    ]
    for first, second in pairs:
        for failures in cases.failure_lists(plain, most=5):
            one, two = cases.state(first, failures), cases.state(second, failures)
            assert one.verdict.mobility == two.verdict.mobility, failures
            assert one.verdict.tolerable == two.verdict.tolerable, failures
            assert one.verdict.drifting == two.verdict.drifting, failures
            if one.verdict.stable:
                assert one.verdict == two.verdict, failures


def test_no_strut_holds_more_than_there_is():
    """All that is handed out fits together: shapes, zero rows, orthonormal columns."""
    for name in cases.NAMES:
        for failures in cases.failure_lists(cases.named(name), most=10):
            state = cases.state(cases.home(name), failures)
            present = state.present
            mobility = present.mobility
            np.testing.assert_allclose(
                present.mapping.T @ present.mapping, np.eye(mobility), atol=1e-10)
            failed = ~present.active
            assert not present.mapping[failed].any()
            np.testing.assert_array_equal(
                present.rate_map[~failed], present.mapping[~failed])
            mechanism = state.rows.mechanism
            for index, actuator in enumerate(mechanism.actuator_names):
                mode = state.failures.mode_of(mechanism, actuator)
                assert (mode is FailureMode.NONE) == present.active[index]
                if mode in (FailureMode.POSITION, FailureMode.HARD):
                    assert not present.rate_map[index].any()
            task = mechanism.task
            np.testing.assert_array_equal(present.major, present.jacobian[task.major_rows])
            np.testing.assert_array_equal(
                present.secondary, present.jacobian[task.secondary_rows])
