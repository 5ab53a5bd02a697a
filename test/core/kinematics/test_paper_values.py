# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Every number of the paper's case study, from the shipped files.

Yi, McInroy and Chen, IEEE Transactions on Robotics 22(5), 2006, section IV. The paper prints
1 / sqrt(3) as 0.5775 and gives four digits; the exact values are used here.
"""

from itertools import combinations, permutations
from math import sqrt

import numpy as np
import pytest
from core import cases

from fault_tolerance.kinematics.actuator_measures import pair_measures
from fault_tolerance.kinematics.measures import next_failure, present_measures
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import home_configuration

P = 1.0 / sqrt(3.0)
T_PRINTED = np.array([
    [sqrt(0.5), 0.0, 0.5],
    [0.0, sqrt(0.5), 0.5],
    [-sqrt(0.5), 0.0, 0.5],
    [0.0, -sqrt(0.5), 0.5],
])
THETAS = ('theta_1', 'theta_2', 'theta_3', 'theta_4')
J_PRINTED = np.diag([1.0, -1.0, 0.5])

# Position failure, torque failure per actuator; hard failure per strut.
TABLE_I = {
    'fsm_3_strut': ([P] * 3, [0.0] * 3, [0.0] * 3),
    'fsm_4_strut': ([P] * 4, [0.5] * 4, [0.5] * 4),
    'fsm_overactuated': (
        [sqrt(5 / 11)] * 3 + [0.0] * 2,
        [sqrt(4 / 15)] * 3 + [sqrt(3 / 5)] * 2,
        [0.0, sqrt(3) / 5, sqrt(3) / 5],
    ),
}


def four(failures=()):
    return cases.state(cases.home('fsm_4_strut'), failures)


@pytest.mark.parametrize('name', TABLE_I)
def test_table_1(name):
    found = next_failure(cases.state(cases.home(name)))
    position, torque, hard = TABLE_I[name]
    np.testing.assert_allclose(found.position, position, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.torque, torque, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.hard, hard, rtol=0.0, atol=1e-9)


def test_table_1_as_printed():
    """The four digits of the paper: 0.5775 there is 0.57735."""
    over = next_failure(cases.state(cases.home('fsm_overactuated')))
    printed = [over.position[0], over.position[3], over.torque[0], over.torque[3], over.hard[1]]
    assert [round(value, 4) for value in printed] == [0.6742, 0.0, 0.5164, 0.7746, 0.3464]
    assert round(next_failure(four()).position[3], 5) == 0.57735


@pytest.mark.parametrize('name', ['fsm_3_strut', 'fsm_4_strut'])
def test_mirrors_of_a_real_size_have_the_same_measures(name):
    """Neither radius nor length matters while all drives are of one kind."""
    real = mechanism_named(name.replace('fsm', 'mirror'))
    found = next_failure(cases.state(home_configuration(real)))
    for measured, expected in zip(
        (found.position, found.torque, found.hard), TABLE_I[name], strict=True
    ):
        np.testing.assert_allclose(measured, expected, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize('name', TABLE_I)
def test_three_degrees_of_freedom_at_home(name):
    state = cases.state(cases.home(name))
    assert state.verdict.mobility == 3
    assert state.verdict.stable and state.verdict.tolerable
    twists = np.abs(state.present.twist_jacobian).max(axis=1) > 1e-12
    assert twists.tolist() == [True, True, False, False, False, True]


def test_printed_jacobian_and_mapping_of_the_four_strut_mirror():
    nominal = four().nominal
    np.testing.assert_allclose(
        nominal.mapping @ nominal.mapping.T, T_PRINTED @ T_PRINTED.T, atol=1e-12)
    np.testing.assert_allclose(
        nominal.jacobian @ nominal.mapping.T, J_PRINTED @ T_PRINTED.T, atol=1e-12)
    sizes = np.linalg.svd(nominal.jacobian, compute_uv=False)
    np.testing.assert_allclose(sizes, [1.0, 1.0, 0.5], atol=1e-12)


def test_theta_4_stuck():
    state = four([('position', 'theta_4')])
    expected = np.array([[2, 1, -1, 0], [1, 2, 1, 0], [-1, 1, 2, 0], [0, 0, 0, 0]]) / 3.0
    mapping = state.present.mapping
    np.testing.assert_allclose(mapping @ mapping.T, expected, atol=1e-12)
    # v_z goes along with w_y.
    coupling = state.present.jacobian[2] @ np.linalg.pinv(state.present.jacobian[:2])
    np.testing.assert_allclose(coupling, [0.0, -sqrt(0.5)], atol=1e-12)
    verdict = state.verdict
    assert (verdict.tolerable, verdict.mobility) == (True, 2)
    assert (verdict.lost, verdict.gained, verdict.drifting) == (('vz',), (), ())
    assert verdict.reason == 'theta_4 stuck; wx, wy retained, vz coupled'
    measures = present_measures(state)
    assert measures.position == pytest.approx(P, abs=1e-12)
    assert measures.retained_manipulability == pytest.approx(P, abs=1e-12)
    assert (measures.torque, measures.hard) == (1.0, 1.0)


def test_rates_with_and_without_recovery():
    velocity = np.array([0.01, 0.02, 0.0])
    nominal = four().nominal
    rates = nominal.mapping @ np.linalg.pinv(nominal.jacobian) @ velocity
    np.testing.assert_allclose(
        rates, [0.0070711, -0.0141421, -0.0070711, 0.0141421], atol=5e-8)

    present = four([('position', 'theta_4')]).present
    reduced = np.linalg.pinv(present.major) @ velocity[:2]
    np.testing.assert_allclose(
        present.mapping @ reduced, [-0.0070711, -0.0282843, -0.0212132, 0.0], atol=5e-8)
    np.testing.assert_allclose(
        present.jacobian @ reduced, [0.01, 0.02, -0.0141421], atol=5e-8)

    # Not recovered: the platform settles where the struts disagree least.
    rates[3] = 0.0
    motion = nominal.jacobian @ nominal.mapping.T @ rates
    np.testing.assert_allclose(motion, [0.01, 0.01, -0.0035355], atol=5e-8)


def test_theta_4_free():
    """T-hat is the identity on the others, as the paper says, and theta_4 follows."""
    state = four([('torque', 'theta_4')])
    present = state.present
    np.testing.assert_allclose(
        present.mapping @ present.mapping.T, np.diag([1.0, 1.0, 1.0, 0.0]), atol=1e-12)
    inverse = np.linalg.inv(T_PRINTED[:3])
    np.testing.assert_allclose(
        present.jacobian @ present.mapping[:3].T, J_PRINTED @ inverse, atol=1e-12)
    follows = present.rate_map[3] @ present.mapping[:3].T
    np.testing.assert_allclose(follows, T_PRINTED[3] @ inverse, atol=1e-12)
    assert (state.verdict.tolerable, state.verdict.mobility) == (True, 3)
    assert present_measures(state).torque == pytest.approx(0.5, abs=1e-12)


def test_strut_4_lost_is_theta_4_free_at_home():
    """Its hinge bars what the others bar too."""
    free = four([('torque', 'theta_4')]).present
    state = four([('hard', 'strut_4')])
    lost = state.present
    np.testing.assert_allclose(
        lost.jacobian @ lost.mapping.T, free.jacobian @ free.mapping.T, atol=1e-12)
    assert present_measures(state).hard == pytest.approx(0.5, abs=1e-12)
    assert state.verdict.gained == ()


@pytest.mark.parametrize(
    ('stuck', 'free'), list(permutations(THETAS, 2)))
def test_one_stuck_and_another_free_is_tolerated(stuck, free):
    state = four([('position', stuck), ('torque', free)])
    assert state.verdict.tolerable
    measures = present_measures(state)
    assert measures.position == pytest.approx(P, abs=1e-12)
    assert measures.torque == pytest.approx(P, abs=1e-12)


@pytest.mark.parametrize('pair', list(combinations(THETAS, 2)))
def test_two_of_a_kind_are_not(pair):
    stuck = four([('position', name) for name in pair])
    assert stuck.verdict.stable and not stuck.verdict.tolerable
    assert present_measures(stuck).position == 0.0
    free = four([('torque', name) for name in pair])
    assert not free.verdict.stable and not free.verdict.tolerable
    assert present_measures(free).torque == 0.0


def test_pairs_of_the_overactuated_mirror():
    position, torque = pair_measures(cases.state(cases.home('fsm_overactuated')).present)
    upper = np.triu_indices(5, 1)
    assert not position[upper].any()
    assert torque[3, 4] == pytest.approx(0.6, abs=1e-12)
    assert torque[0, 4] == 0.0
    # Summed over all pairs, eq. (15).
    assert np.sum(torque[upper] ** 2) == pytest.approx(1.0, abs=1e-12)


def test_losing_strut_2_of_the_overactuated_mirror_gains_a_freedom():
    for strut in ('strut_2', 'strut_3'):
        state = cases.state(cases.home('fsm_overactuated'), [('hard', strut)])
        assert (state.verdict.tolerable, state.verdict.mobility) == (True, 4)
        assert len(state.verdict.gained) == 1 and state.verdict.lost == ()
        assert present_measures(state).hard == pytest.approx(sqrt(3) / 5, abs=1e-12)
    assert not cases.state(cases.home('fsm_overactuated'), [('hard', 'strut_1')]).verdict.stable


def test_gough_stewart_platforms():
    """Equivalent legs share what there is: p = 1 / sqrt(6) with w_z secondary, t = 1 / 2."""
    six = next_failure(cases.state(home_configuration(mechanism_named('gough_stewart_6'))))
    np.testing.assert_allclose(six.position, 1.0 / sqrt(6.0), atol=1e-9)
    np.testing.assert_array_equal(six.torque, np.zeros(6))
    np.testing.assert_array_equal(six.hard, np.zeros(6))
    eight = next_failure(cases.state(home_configuration(mechanism_named('gough_stewart_8'))))
    np.testing.assert_allclose(eight.torque, 0.5, atol=1e-9)
    # Each leg ends in six freedoms: lost is as good as free.
    np.testing.assert_allclose(eight.hard, eight.torque, atol=1e-9)


def test_a_symmetric_hexapod():
    found = next_failure(cases.state(cases.home('hexapod_6')))
    np.testing.assert_allclose(found.position, 1.0 / sqrt(6.0), atol=1e-12)


def test_serial_arm():
    """No loops: T is the identity, a stuck joint only stops contributing, a free one is fatal."""
    state = cases.state(cases.home('serial_7r'))
    np.testing.assert_allclose(
        state.nominal.mapping @ state.nominal.mapping.T, np.eye(7), atol=1e-12)
    found = next_failure(state)
    np.testing.assert_array_equal(found.torque, np.zeros(7))
    assert (found.position > 0.0).all()
