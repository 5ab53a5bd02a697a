# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Loops closed from actuator values: against a general solver, and by what they promise."""

import numpy as np
import pytest
from core import cases, reference
from core.mechanisms import by_numbers, even_mirror, hexapod, made, scaled
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import null_space

from fault_tolerance.errors import ClosureError, MechanismError
from fault_tolerance.mechanism.configuration import home_configuration, solved_configuration

# Solved again by a general least-squares solver, which takes its time.
AGAIN = ('fsm_3_strut', 'fsm_overactuated', 'uneven_mirror', 'planar_4rpr', 'guided_mirror',
         'two_stage_mirror', 'one_drive', 'bennett', 'rooted_hexapod', 'tipped_platform')


def assert_closed(configuration, lost=(), tolerance=1e-9):
    """Check with other code that every strut that holds ends at the platform."""
    mechanism = configuration.mechanism
    for index, strut in enumerate(mechanism.struts):
        if strut.name in lost:
            continue
        values = configuration.joint_values[index, : len(strut.joints)]
        turn, shift, _ = reference.strut_motion(strut, values, mechanism.origin)
        pose = configuration.pose
        np.testing.assert_allclose(turn, pose[:3, :3], rtol=0.0, atol=tolerance)
        np.testing.assert_allclose(
            turn @ mechanism.origin + shift, pose[:3, 3], rtol=0.0, atol=tolerance
        )


@pytest.mark.parametrize('name', cases.NAMES)
def test_home_is_where_the_file_says(name):
    configuration = cases.home(name)
    mechanism = configuration.mechanism
    expected = np.eye(4)
    expected[:3, 3] = mechanism.origin
    np.testing.assert_array_equal(configuration.pose, expected)
    for array in (configuration.joint_values, configuration.actuator_values, configuration.misfit):
        assert not array.any()
    assert configuration.converged
    assert configuration.closure_residual <= 1e-12
    assert configuration.flexure_strain <= 1e-12


@pytest.mark.parametrize('name', cases.RIGID)
def test_away_from_home_the_loops_close(name):
    configuration, given_ = cases.away(name), cases.moves(name)
    mechanism = configuration.mechanism
    assert configuration.converged
    assert_closed(configuration, tolerance=1e-11)
    assert configuration.closure_residual <= 1e-11 and configuration.flexure_strain <= 1e-11
    for actuator, value in given_.items():
        found = configuration.actuator_values[mechanism.actuator_index(actuator)]
        assert found == pytest.approx(value, abs=1e-12)
    assert np.abs(configuration.misfit).max() <= 1e-12


@pytest.mark.parametrize('name', AGAIN)
def test_the_same_as_a_general_solver_finds(name):
    configuration = cases.away(name)
    mechanism = configuration.mechanism
    loops = reference.Loops(mechanism)
    values = loops.closed(cases.moves(name), strides=2)
    assert np.abs(loops.openings(values)).max(initial=0.0) < 1e-11
    expected = [values[loops.place(actuator)] for actuator in mechanism.actuator_names]
    atol = 1e-9 * mechanism.characteristic_length
    np.testing.assert_allclose(configuration.actuator_values, expected, rtol=0.0, atol=atol)
    turn, origin = loops.tips(values)[0]
    np.testing.assert_allclose(configuration.pose[:3, :3], turn, atol=1e-9)
    np.testing.assert_allclose(configuration.pose[:3, 3], origin, atol=atol)


@pytest.mark.parametrize('name', cases.RIGID)
def test_what_is_left_out_is_nearest_to_home(name):
    """No motion that keeps the given values makes the others smaller."""
    mechanism = cases.named(name)
    values = cases.moves(name)
    given_ = dict(list(values.items())[:1])
    configuration = solved_configuration(mechanism, given_)
    assert_closed(configuration)
    mapping = reference.model(mechanism, cases.joint_values(configuration)).mapping
    fixed = [mechanism.actuator_index(actuator) for actuator in given_]
    others = [index for index in range(len(mapping)) if index not in fixed]
    free = null_space(mapping[fixed], rcond=1e-9)
    slope = configuration.actuator_values[others] @ mapping[others] @ free
    np.testing.assert_allclose(slope, 0.0, atol=1e-9 * mechanism.characteristic_length)


def test_nothing_given_is_home():
    for name in ('fsm_4_strut', 'serial_7r'):
        configuration = solved_configuration(cases.named(name), {})
        assert not configuration.actuator_values.any()


@pytest.mark.parametrize('scale', [1e-6, 1e-3, 1.0, 100.0])
@pytest.mark.parametrize('document', [even_mirror(3), hexapod()], ids=['mirror', 'hexapod'])
def test_any_size_of_machine(document, scale):
    mechanism = made(scaled(document, scale))
    names = mechanism.actuator_names
    sizes = np.array([0.05, -0.03, 0.08, 0.02, -0.06, 0.04])[: len(names)]
    small = solved_configuration(made(document), dict(zip(names, sizes, strict=True)))
    found = solved_configuration(mechanism, dict(zip(names, scale * sizes, strict=True)))
    np.testing.assert_allclose(found.pose[:3, :3], small.pose[:3, :3], atol=1e-9)
    np.testing.assert_allclose(found.pose[:3, 3] / scale, small.pose[:3, 3], atol=1e-9)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_random_moves_of_a_hexapod(seed):
    mechanism = cases.named('hexapod_6')
    values = np.random.default_rng(seed).uniform(-0.15, 0.15, 6)
    configuration = solved_configuration(
        mechanism, dict(zip(mechanism.actuator_names, values, strict=True))
    )
    assert_closed(configuration, tolerance=1e-10)
    for index, strut in enumerate(mechanism.struts):
        foot, head = strut.joints[0].point, strut.joints[-1].point
        moved = configuration.pose[:3, :3] @ (head - mechanism.origin) + configuration.pose[:3, 3]
        length = np.linalg.norm(head - foot) + values[index]
        assert np.linalg.norm(moved - foot) == pytest.approx(length, abs=1e-10)


def test_redundant_values_that_agree_are_met():
    mechanism = cases.named('fsm_overactuated')
    free = solved_configuration(mechanism, {'theta_2': 0.02, 'theta_3': -0.01, 'theta_1': 0.03})
    all_ = dict(zip(mechanism.actuator_names, free.actuator_values, strict=True))
    again = solved_configuration(mechanism, all_)
    np.testing.assert_allclose(again.pose, free.pose, atol=1e-12)


@pytest.mark.parametrize(
    ('error', 'unit', 'closes'),
    [(2e-6, 1.0, True), (4e-6, 1.0, False), (2e-8, 0.02, True), (9e-8, 0.02, False)],
)
def test_redundant_values_may_differ_by_a_millionth(error, unit, closes):
    """Four readings of three freedoms: a fit spreads an error evenly, a quarter to each."""
    name = {1.0: 'fsm_4_strut', 0.02: 'mirror_4_strut'}[unit]
    mechanism = cases.named(name)
    length = mechanism.characteristic_length
    values = dict.fromkeys(mechanism.actuator_names, 0.0)
    values['theta_1'] = error
    assert (error / 4 <= 1e-6 * length) is closes
    if closes:
        found = solved_configuration(mechanism, values)
        np.testing.assert_allclose(
            found.misfit, np.array([1, -1, 1, -1]) * error / 4, rtol=1e-3, atol=1e-15
        )
        return
    with pytest.raises(ClosureError, match='the actuator values contradict each other') as caught:
        solved_configuration(mechanism, values)
    assert caught.value.residual == pytest.approx(error / 4, rel=1e-3)
    assert caught.value.tolerance == pytest.approx(1e-6 * length)


def test_out_of_reach():
    with pytest.raises(ClosureError, match='the loops do not close: residual .* m exceeds') as it:
        solved_configuration(cases.named('mirror_3_strut'), {'theta_1': 0.02, 'theta_2': -0.02})
    assert it.value.residual > it.value.tolerance
    with pytest.raises(ClosureError, match='exceeds'):
        solved_configuration(cases.named('one_drive'), {'leg_1': -0.9})


def test_without_a_lost_strut():
    mechanism = cases.named('fsm_overactuated')
    given_ = {'theta_1': 0.02, 'theta_3': -0.03, 'theta_4': 0.01, 'theta_5': 0.04}
    with pytest.raises(ClosureError, match='contradict'):
        solved_configuration(mechanism, given_)
    found = solved_configuration(mechanism, given_, lost=['strut_2'])
    assert_closed(found, lost=['strut_2'])
    for actuator, value in given_.items():
        place = mechanism.actuator_index(actuator)
        assert found.actuator_values[place] == pytest.approx(value, abs=1e-12)
    ignored = solved_configuration(mechanism, {**given_, 'theta_2': 0.3}, lost=['strut_2'])
    np.testing.assert_allclose(ignored.pose, found.pose, atol=1e-12)


def test_a_large_move_follows_the_assembly_from_home():
    """One turn and more: the arm goes round, it does not take the short way."""
    mechanism = cases.named('serial_3r')
    found = solved_configuration(mechanism, {'joint_1': 7.0, 'joint_2': 0.0, 'joint_3': 0.0})
    assert found.actuator_values[0] == pytest.approx(7.0, abs=1e-12)
    c, s = np.cos(7.0), np.sin(7.0)
    origin = mechanism.origin
    expected = [c * origin[0] - s * origin[1], s * origin[0] + c * origin[1], 0.0]
    np.testing.assert_allclose(found.pose[:3, 3], expected, atol=1e-12)


@pytest.mark.parametrize(
    ('given_', 'message'),
    [
        ({'theta_9': 0.0}, "fsm_3_strut: at: 'theta_9' is not an actuator; valid: theta_1, "),
        ({'hinge_1': 0.0}, "'hinge_1' is not an actuator"),
        ({'theta_1': float('nan')}, r'fsm_3_strut: at\.theta_1: nan is not finite'),
        ({'theta_1': float('-inf')}, r'at\.theta_1: -inf is not finite'),
    ],
)
def test_bad_values_are_named(given_, message):
    with pytest.raises(MechanismError, match=message):
        solved_configuration(cases.named('fsm_3_strut'), given_)


def test_given_by_its_jacobian_there_is_one_configuration():
    mechanism = made(by_numbers())
    for configuration in (home_configuration(mechanism), solved_configuration(mechanism, {})):
        assert configuration.converged and not configuration.actuator_values.any()
        np.testing.assert_array_equal(configuration.pose, np.eye(4))
        with pytest.raises(MechanismError, match='by_numbers: struts: .* given by its Jacobian'):
            _ = configuration.constraints
    with pytest.raises(MechanismError, match='no configuration but its working point'):
        solved_configuration(mechanism, {'theta_1': 0.0})
