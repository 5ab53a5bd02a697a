# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Live configurations: noisy and missing readings, lost struts, warm starts, flexures."""

import numpy as np
import pytest
from core import cases, reference
from core.mechanisms import by_numbers, made
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.errors import ArrayError, FailureError
from fault_tolerance.mechanism.configuration import fitted_configuration, solved_configuration
from fault_tolerance.tolerances import CLOSURE_TOLERANCE

REDUNDANT = ('fsm_overactuated', 'planar_4rpr', 'hexapod_8', 'guided_mirror')


@pytest.mark.parametrize('name', cases.RIGID)
def test_exact_readings_are_met(name):
    exact = cases.away(name)
    found = fitted_configuration(exact.mechanism, exact.actuator_values)
    assert found.converged
    assert found.closure_residual <= CLOSURE_TOLERANCE
    length = exact.mechanism.characteristic_length
    np.testing.assert_allclose(found.pose[:3, :3], exact.pose[:3, :3], atol=1e-6)
    np.testing.assert_allclose(found.pose[:3, 3], exact.pose[:3, 3], atol=1e-6 * length)
    assert found.largest_misfit <= 1e-6 * length


@pytest.mark.parametrize(
    ('name', 'size'),
    [('gough_stewart_6', 1.0), ('rooted_hexapod', 1.5), ('bennett', 1.5), ('serial_7r', 1.5)])
def test_readings_far_from_the_start_are_reached(name, size):
    """Steps are kept short: whole ones would lead to another assembly, or nowhere."""
    exact = solved_configuration(cases.named(name), cases.moves(name, size))
    found = fitted_configuration(exact.mechanism, exact.actuator_values)
    assert found.converged
    np.testing.assert_allclose(found.pose, exact.pose, atol=1e-6)


@pytest.mark.parametrize('name', REDUNDANT)
def test_noisy_readings_are_fitted_by_least_squares(name):
    """The misfit is at right angles to everything the actuators can do together."""
    exact = cases.away(name)
    mechanism = exact.mechanism
    noise = 1e-3 * np.random.default_rng(2).normal(size=len(mechanism.actuators))
    readings = exact.actuator_values + noise
    found = fitted_configuration(mechanism, readings)
    assert found.converged and found.closure_residual <= CLOSURE_TOLERANCE
    np.testing.assert_allclose(found.misfit, readings - found.actuator_values, atol=1e-15)
    assert np.linalg.norm(found.misfit) < np.linalg.norm(noise)
    mapping = reference.model(mechanism, cases.joint_values(found)).mapping
    np.testing.assert_allclose(mapping.T @ found.misfit, 0.0, atol=1e-6)
    # Least squares: no nearby configuration is nearer to the readings.
    best = np.sum(found.misfit**2)
    drive = cases.independent_drives(name)[0]
    start = {
        actuator: found.actuator_values[mechanism.actuator_index(actuator)]
        for actuator in cases.independent_drives(name)
    }
    for step in (-1e-3, 1e-3):
        near = solved_configuration(mechanism, {**start, drive: start[drive] + step})
        assert np.sum((readings - near.actuator_values) ** 2) > best


def test_four_readings_of_a_mirror_share_an_error():
    mechanism = cases.named('mirror_4_strut')
    found = fitted_configuration(mechanism, np.array([4e-5, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(found.misfit, 1e-5 * np.array([1, -1, 1, -1]), atol=1e-9)
    assert found.largest_misfit == pytest.approx(1e-5, rel=1e-3)


def test_rotary_misfit_counts_by_the_characteristic_length():
    mechanism = cases.named('mirror_overactuated')
    found = fitted_configuration(mechanism, np.array([0.0, 0.0, 0.0, 1e-3, 0.0]))
    metres = np.abs(found.misfit) * [1.0, 1.0, 1.0, 0.02, 0.02]
    assert found.largest_misfit == pytest.approx(metres.max(), rel=1e-12)


@pytest.mark.parametrize('name', ['fsm_overactuated', 'hexapod_8', 'planar_4rpr'])
def test_a_warm_start_comes_to_the_same_in_fewer_steps(name):
    exact = cases.away(name)
    mechanism, readings = exact.mechanism, exact.actuator_values
    cold = fitted_configuration(mechanism, readings)
    near = fitted_configuration(mechanism, readings * 1.001, start=cold)
    assert near.converged and near.iterations < cold.iterations
    again = fitted_configuration(mechanism, readings, start=near)
    np.testing.assert_allclose(again.pose, cold.pose, atol=1e-7)


def test_scanning_for_long_does_not_drift():
    """Ten turns of a circle in small steps, each from the one before."""
    mechanism = cases.named('mirror_4_strut')
    found = None
    for phase in np.linspace(0.0, 20.0 * np.pi, 401):
        tilt = 5e-3 * np.array([np.cos(phase), np.sin(phase)])
        values = [0.02 * tilt[0], -0.02 * tilt[1], -0.02 * tilt[0], 0.02 * tilt[1]]
        found = fitted_configuration(mechanism, np.array(values), start=found)
        assert found.converged and found.iterations <= 3
    cold = fitted_configuration(mechanism, np.array(values))
    np.testing.assert_allclose(found.actuator_values, cold.actuator_values, atol=1e-10)
    np.testing.assert_allclose(found.pose, cold.pose, atol=1e-7)


@pytest.mark.parametrize('name', ['fsm_overactuated', 'hexapod_8', 'planar_4rpr', 'fsm_3_strut'])
def test_the_reading_of_a_lost_strut_does_not_matter(name):
    exact = cases.away(name)
    mechanism = exact.mechanism
    lost = mechanism.strut_names[1]
    gone = [mechanism.actuator_index(each) for each in mechanism.actuators_of(lost)]
    found = []
    for value in (np.nan, 0.0, 1e3):
        readings = exact.actuator_values.copy()
        readings[gone] = value
        found.append(fitted_configuration(mechanism, readings, lost=[lost]))
    for one in found:
        assert one.converged
        assert not one.misfit[gone].any()
        assert np.isfinite(one.actuator_values).all() and np.isfinite(one.joint_values).all()
        np.testing.assert_array_equal(one.pose, found[0].pose)


def test_a_missing_reading_is_found_from_the_others():
    exact = cases.away('hexapod_8')
    readings = exact.actuator_values.copy()
    readings[[2, 5]] = np.nan
    found = fitted_configuration(exact.mechanism, readings)
    np.testing.assert_allclose(found.actuator_values, exact.actuator_values, atol=1e-7)
    assert not found.misfit[[2, 5]].any()


def test_what_no_reading_tells_stays_where_it_was():
    mechanism = cases.named('fsm_3_strut')
    start = solved_configuration(mechanism, {'theta_1': 0.02, 'theta_2': -0.01, 'theta_3': 0.03})
    found = fitted_configuration(mechanism, np.full(3, np.nan), start=start)
    np.testing.assert_allclose(found.pose, start.pose, atol=1e-12)
    nothing = fitted_configuration(mechanism, np.full(3, np.nan), lost=mechanism.strut_names,
                                   start=start)
    np.testing.assert_allclose(nothing.pose, start.pose, atol=1e-12)
    assert nothing.converged


def test_a_strut_that_comes_back_is_met_again():
    exact = cases.away('fsm_overactuated')
    mechanism, readings = exact.mechanism, exact.actuator_values
    with_all = fitted_configuration(mechanism, readings)
    without = fitted_configuration(mechanism, 0.5 * readings, lost=['strut_3'], start=with_all)
    again = fitted_configuration(mechanism, readings, start=without)
    np.testing.assert_allclose(again.pose, with_all.pose, atol=1e-7)


@given(
    seed=st.integers(0, 2**32 - 1),
    name=st.sampled_from(['fsm_4_strut', 'fsm_overactuated', 'hexapod_6', 'two_stage_mirror',
                          'serial_7r', 'bennett', 'one_drive']),
    size=st.sampled_from([0.0, 1e-3, 1.0, 30.0, 1e12, 1e160, 1e308, np.inf]),
)
@settings(max_examples=60, deadline=None)
@pytest.mark.filterwarnings('ignore:overflow', 'ignore:invalid value')
def test_no_reading_makes_it_raise(seed, name, size):
    rng = np.random.default_rng(seed)
    mechanism = cases.named(name)
    count = len(mechanism.actuators)
    readings = rng.choice([-1.0, 1.0], count) * size
    readings = np.where(rng.random(count) < 0.3, np.nan, readings)
    lost = [strut for strut in mechanism.strut_names if rng.random() < 0.3]
    found = fitted_configuration(mechanism, readings, lost)
    for array in (found.pose, found.joint_values, found.actuator_values):
        assert np.isfinite(array).all()
    assert np.isfinite(found.closure_residual) and np.isfinite(found.flexure_strain)
    if found.converged:
        assert found.closure_residual <= CLOSURE_TOLERANCE


def test_out_of_reach_is_said_not_raised():
    mechanism = cases.named('mirror_3_strut')
    found = fitted_configuration(mechanism, np.array([1.0, -1.0, 0.0]))
    assert not found.converged


def test_readings_of_the_wrong_number_are_a_mistake_of_the_program():
    with pytest.raises(ArrayError, match=r'values: has shape \(2,\), expected 3'):
        fitted_configuration(cases.named('fsm_3_strut'), np.zeros(2))


def test_overconstrained_but_mobile():
    """Bennett's linkage moves only where its loop is closed: steps towards it seem barred."""
    mechanism = cases.named('bennett')
    for value in (1e-3, 0.1, 0.4, -0.3):
        found = fitted_configuration(mechanism, np.array([value]))
        assert found.converged
        assert found.actuator_values[0] == pytest.approx(value, abs=1e-7)
        assert cases.state(found).present.mobility == 1


def test_given_by_its_jacobian_readings_say_nothing():
    mechanism = made(by_numbers())
    found = fitted_configuration(mechanism, np.array([1.0, np.nan, 0.0, 2.0]))
    assert found.converged and not found.actuator_values.any()


@pytest.mark.parametrize('angle', [1e-4, 1e-3, 1e-2, 2.6e-2])
@pytest.mark.parametrize('name', ['fsm_4_strut', 'mirror_4_strut'])
def test_flexure_strain(name, angle):
    """Tilted about both axes, the four hinges miss each other by the square of the angle.

    A ball at radius R moves tangentially by R a^2 / 2 if the mirror turns by a about both axes,
    two one way round and two the other. One part of the four, in which unit rows (1, R / Lc)
    count by 1 / sqrt(2) for Lc = R, is a pattern that no motion makes good: R a^2 / sqrt(2).
    """
    found = cases.tilted(name, angle, angle)
    assert found.converged and found.closure_residual <= CLOSURE_TOLERANCE
    radius = found.mechanism.characteristic_length
    expected = radius * angle**2 / np.sqrt(2.0)
    assert found.flexure_strain == pytest.approx(expected, rel=1e-3)
    assert found.strain_allowed == pytest.approx(0.05 * radius)


def test_no_strain_about_one_axis():
    assert cases.tilted('fsm_4_strut', 0.03, 0.0).flexure_strain < 1e-15
    assert cases.tilted('fsm_4_strut', 0.0, 0.03, 0.01).flexure_strain < 1e-15


def test_a_lost_strut_that_there_is_not_is_a_mistake():
    with pytest.raises(FailureError, match="not a strut: 'theta_1'; valid: strut_1, strut_2"):
        fitted_configuration(cases.named('fsm_3_strut'), np.zeros(3), lost=['theta_1'])
