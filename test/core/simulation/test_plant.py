# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The elastic plant against the theory: what moves, how far, and which forces it takes."""

from __future__ import annotations

import numpy as np
import pytest
from plant_cases import (
    BY_NUMBERS,
    MECHANISMS,
    UNLOADED,
    broken,
    driven,
    exact_plant,
    rotation_of,
)

from fault_tolerance.errors import ArrayError, MechanismError
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.mechanism.configuration import fitted_configuration
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.simulation.plant import ElasticPlant
from fault_tolerance.simulation.plant_settings import PlantSettings

# The worked cases of the four-strut mirror, v = (0.01, 0.02, 0) (docs/theory.md).
HALF = 0.5**0.5
NOMINAL = np.array([0.01 * HALF, -0.02 * HALF, -0.01 * HALF, 0.02 * HALF])
RECOVERED = np.array([-0.01 * HALF, -0.04 * HALF, -0.03 * HALF, 0.0])
# Seconds at those rates: 1 mrad or so, where the mirror is linear.
SHORT = 0.1


def task_motion(state, plant):
    """Return (wx, wy, vz) times time, from home."""
    height = state.pose[2, 3] - plant.mechanism.origin[2]
    return np.array([*rotation_of(state)[:2], height])


def at_rest(plant, duration=0.05):
    return driven(plant, np.zeros(len(plant.mechanism.actuators)), duration)


@pytest.mark.parametrize(
    ('fault', 'rates', 'velocity'),
    [
        ('ok all', NOMINAL, (0.01, 0.02, 0.0)),
        ('position theta_4', NOMINAL, (0.01, 0.01, -0.01 * HALF / 2)),
        ('position theta_4', RECOVERED, (0.01, 0.02, -0.02 * HALF)),
        ('torque theta_4', NOMINAL, (0.01, 0.02, 0.0)),
        ('torque theta_4', RECOVERED, (0.01, 0.02, -0.02 * HALF)),
        ('hard strut_4', NOMINAL, (0.01, 0.02, 0.0)),
    ],
)
def test_the_worked_cases_of_the_four_strut_mirror(fault, rates, velocity):
    plant = exact_plant('fsm_4_strut', fault)
    driven(plant, rates, SHORT)
    moved = task_motion(at_rest(plant), plant)
    assert np.allclose(moved, SHORT * np.array(velocity), rtol=0.0, atol=2e-7)


def test_struts_fight_when_a_stuck_actuator_is_not_considered():
    plant = exact_plant('fsm_4_strut', 'position theta_4')
    driven(plant, NOMINAL, SHORT)
    unrecovered = at_rest(plant)
    # Least squares: a quarter of the contradiction in every strut, pushing and pulling in turn.
    expected = 1e6 * SHORT * 0.02 * HALF / 4.0 * np.array([1.0, -1.0, 1.0, -1.0])
    assert np.allclose(unrecovered.efforts, expected, rtol=0.03)
    plant = exact_plant('fsm_4_strut', 'position theta_4')
    driven(plant, RECOVERED, SHORT)
    recovered = at_rest(plant)
    assert np.abs(recovered.efforts).max() < 1e-3 * np.abs(unrecovered.efforts).max()


def test_a_free_actuator_follows_the_platform_without_force():
    plant = exact_plant('fsm_4_strut', 'torque theta_4')
    state = driven(plant, RECOVERED, SHORT)
    assert abs(state.rates[3]) < 1e-5
    state = driven(plant, NOMINAL, SHORT)
    assert state.rates[3] == pytest.approx(NOMINAL[3], rel=1e-3)
    assert state.efforts[3] == 0.0
    assert np.abs(at_rest(plant).efforts).max() < 1e-2


def test_a_lost_strut_stays_as_it_was_while_the_mirror_moves_on():
    plant = exact_plant('fsm_4_strut')
    before = driven(plant, NOMINAL, SHORT)
    broken(plant, 'hard strut_4')
    state = driven(plant, NOMINAL, SHORT)
    assert state.values[3] == before.values[3] == state.measured_values[3]
    assert state.rates[3] == state.efforts[3] == 0.0
    assert np.allclose(task_motion(state, plant), 2.0 * task_motion(before, plant), atol=1e-5)
    assert plant.lost_struts == ('strut_4',)
    assert plant.actuator_faults == ('none', 'none', 'none', 'hard')


@pytest.mark.parametrize('name', MECHANISMS)
def test_consistent_rates_move_the_platform_as_the_kinematics_say(name):
    mechanism = MECHANISMS[name]
    kinematics = differential_kinematics(home_rows(mechanism))
    rng = np.random.default_rng(3)
    for _ in range(3):
        reduced = rng.uniform(-1.0, 1.0, kinematics.mobility)
        reduced *= 1e-3 * mechanism.characteristic_length / np.linalg.norm(reduced)
        plant = exact_plant(name)
        driven(plant, kinematics.mapping @ reduced / SHORT, SHORT)
        state = at_rest(plant)
        moved = np.concatenate([rotation_of(state), state.pose[:3, 3] - plant.mechanism.origin])
        metric = np.repeat([mechanism.characteristic_length, 1.0], 3)
        expected = metric * (kinematics.twist_jacobian @ reduced)
        # Second order: the square of a thousandth, times what the geometry makes of it.
        error = np.linalg.norm(metric * moved - expected)
        assert error < 2e-2 * np.linalg.norm(expected)
        fight = 1e6 * np.linalg.norm(reduced)
        assert np.abs(state.efforts).max() < 1e-2 * fight


@pytest.mark.parametrize('name', ['fsm_3_strut', 'mirror_4_strut', 'hexapod', 'two_stages'])
def test_the_twist_is_that_of_the_kinematics_where_the_platform_is_now(name):
    mechanism = MECHANISMS[name]
    plant = exact_plant(name)
    nominal = differential_kinematics(home_rows(mechanism))
    along = np.linspace(1.0, 0.5, nominal.mobility) * 0.01 * mechanism.characteristic_length
    driven(plant, nominal.mapping @ along, 1.0, dt=5e-3)
    at_rest(plant)
    configuration = fitted_configuration(mechanism, plant.state.values)
    present = differential_kinematics(strut_rows(configuration))
    assert np.allclose(configuration.pose, plant.state.pose, atol=3e-6)
    rates = present.mapping @ present.mapping.T @ nominal.mapping @ along
    state = driven(plant, rates, 0.02)
    expected = present.twist_jacobian @ (present.mapping.T @ rates)
    assert np.linalg.norm(state.twist - expected) < 3e-3 * np.linalg.norm(expected)


@pytest.mark.parametrize('name', MECHANISMS)
def test_the_efforts_balance_the_load_however_the_struts_fight(name):
    plant = exact_plant(name, disturbance=(0.5, -0.4, 0.3, 0.6, -0.2, 0.1))
    mechanism = MECHANISMS[name]
    rng = np.random.default_rng(1)
    # Each actuator somewhere else: redundant ones fight.
    driven(plant, rng.uniform(-0.02, 0.02, len(mechanism.actuators)), 0.02)
    state = at_rest(plant, 0.2)
    # Virtual work: in every motion of the mechanism, efforts and load do none together.
    kinematics = differential_kinematics(strut_rows(fitted_configuration(mechanism, state.values)))
    metric = np.repeat([mechanism.characteristic_length, 1.0], 3)
    by_load = kinematics.twist_jacobian.T @ (metric * np.array(plant.settings.disturbance))
    by_efforts = kinematics.mapping.T @ state.efforts
    redundant = len(mechanism.actuators) > kinematics.mobility
    assert bool(np.abs(state.efforts).max() > 10.0) is redundant
    assert np.abs(by_load + by_efforts).max() < 1e-4 * np.abs(state.efforts).max()


def test_the_load_is_held_while_driven_and_drifts_where_nothing_holds():
    plant = exact_plant('mirror_4_strut', disturbance=(0.004, 0.003, 0.001, 0.001, 0.002, 0.003))
    state = at_rest(plant, 0.2)
    assert np.abs(state.twist).max() < 1e-9
    broken(plant, 'hard strut_1')
    at_rest(plant, 0.01)
    assert np.abs(at_rest(plant, 0.2).twist).max() < 1e-6
    broken(plant, 'hard strut_3')
    drifting = at_rest(plant, 0.2)
    # Struts 2 and 4 leave the rotation about the line through their tips; load over damping,
    # metric, is 0.004 / 100 m/s at a length of 0.02 m, less what the hinges drag.
    assert drifting.twist[0] == pytest.approx(0.002, rel=0.05)
    assert np.abs(drifting.twist[1:3]).max() < 1e-5
    later = at_rest(plant, 0.2)
    assert rotation_of(later)[0] > rotation_of(drifting)[0] + 3e-4
    assert np.allclose(later.values[[1, 3]], drifting.values[[1, 3]], atol=1e-9)


def test_two_stuck_actuators_hold_and_two_free_ones_drift_to_the_ends_of_their_stroke():
    loaded = {'disturbance': (0.4, 0.0, 0.0, 0.0, 0.0, 0.0)}
    plant = exact_plant('mirror_4_strut', 'position theta_1', 'position theta_3', **loaded)
    assert np.abs(at_rest(plant, 0.5).twist).max() < 1e-6
    plant = exact_plant('mirror_4_strut', 'torque theta_1', 'torque theta_3', **loaded)
    assert at_rest(plant, 0.05).twist[0] > 0.1
    stopped = at_rest(plant, 1.0)
    assert np.abs(stopped.twist).max() < 1e-6
    assert np.abs(stopped.values[[0, 2]]).max() == pytest.approx(0.0006, rel=1e-2)


def test_a_serial_arm_with_a_free_joint_hangs_in_the_load():
    plant = exact_plant('arm', 'torque d', disturbance=(0.0, 0.0, 0.0, 0.0, 1.0, 0.0))
    before = at_rest(plant, 0.01).values
    after = at_rest(plant, 0.1).values
    assert after[3] > before[3] + 1e-4
    assert np.allclose(after[:3], before[:3], atol=1e-4)


def test_a_serial_arm_that_is_lost_drops_its_tool():
    plant = exact_plant('arm', 'hard arm', disturbance=(0.0, 0.0, 0.0, 0.0, -1.0, 0.0))
    state = driven(plant, np.ones(4), 0.1)
    assert (state.values == 0.0).all()
    assert state.twist[4] == pytest.approx(-0.01)


def test_two_stages_share_a_stroke_and_one_replaces_the_other():
    plant = exact_plant('two_stages', 'position coarse_0')
    rates = np.array([5.0, 0.03, 0.02, 0.01, 0.02, 0.01])
    state = driven(plant, rates, SHORT)
    assert abs(state.values[0]) < 1.1e-6
    assert state.pose[2, 3] - 1.0 == pytest.approx(SHORT * 0.03, rel=1e-3)


def test_the_result_does_not_hang_on_the_time_step():
    ends = []
    for dt in (1e-3, 5e-3, 2.5e-2):
        plant = exact_plant('mirror_4_strut', 'position theta_2', command_timeout=1.0)
        driven(plant, np.array([2e-3, 1e-3, -2e-3, -1e-3]), 0.2, dt)
        ends.append(at_rest(plant))
    for end in ends[1:]:
        assert np.allclose(end.pose, ends[0].pose, atol=1e-9)
        assert np.allclose(end.efforts, ends[0].efforts, atol=1e-3)


def test_the_servo_lag_delays_the_mirror():
    plant = exact_plant('mirror_4_strut', servo_time_constant=0.01)
    rates = np.array([1e-3, 0.0, -1e-3, 0.0])
    state = driven(plant, rates, 0.1)
    assert state.values[0] == pytest.approx(1e-3 * (0.1 - 0.01), rel=1e-2)
    assert plant.setpoints[0] == pytest.approx(1e-3 * 0.09, rel=1e-3)


def test_the_plant_stops_when_commands_cease():
    plant = exact_plant('mirror_4_strut', command_timeout=0.1)
    plant.command([1e-3, 0.0, -1e-3, 0.0])
    for _ in range(30):
        state = plant.step(0.01)
    assert plant.setpoints[0] == pytest.approx(1e-4)
    assert np.abs(state.twist).max() < 1e-9
    # In the middle of a long step too.
    plant = exact_plant('mirror_4_strut', command_timeout=0.1)
    plant.command([1e-3, 0.0, -1e-3, 0.0])
    plant.step(0.5)
    assert plant.setpoints[0] == pytest.approx(1e-4)


def test_noise_is_small_and_comes_from_the_seed():
    def record(seed):
        plant = ElasticPlant(MECHANISMS['mirror_4_strut'], rng=seed)
        states = [plant.step(1e-3) for _ in range(500)]
        return np.array([state.measured_values - state.values for state in states])

    first = record(7)
    assert (first == record(7)).all()
    assert (first == record(np.random.default_rng(7))).all()
    assert (first != record(8)).all()
    assert first.std() == pytest.approx(2e-9, rel=0.1)
    # 0.5 urad at the radius of 20 mm
    assert np.abs(first).max() < 0.5e-6 * 0.02


def test_noise_of_turning_actuators_is_an_angle():
    plant = ElasticPlant(MECHANISMS['mirror_overactuated'], PlantSettings(encoder_noise=2e-9))
    states = [plant.step(1e-3) for _ in range(500)]
    noise = np.array([state.measured_values - state.values for state in states]).std(axis=0)
    length = plant.mechanism.characteristic_length
    assert noise == pytest.approx([2e-9] * 3 + [2e-9 / length] * 2, rel=0.2)


def test_before_the_first_step_the_plant_is_at_home():
    plant = ElasticPlant(MECHANISMS['mirror_4_strut'])
    assert (plant.state.pose[:3, 3] == plant.mechanism.origin).all()
    assert (plant.state.values == 0.0).all()
    assert (plant.state.efforts == 0.0).all()
    assert plant.actuator_faults == ('none',) * 4
    assert plant.lost_struts == ()


def test_no_time_no_change():
    plant = ElasticPlant(MECHANISMS['mirror_4_strut'])
    plant.command(np.full(4, 1e-3))
    state = plant.step(1e-3)
    assert plant.step(0.0) is state is plant.state


def test_states_cannot_be_written():
    state = ElasticPlant(MECHANISMS['mirror_4_strut']).step(1e-3)
    for array in vars(state).values():
        with pytest.raises(ValueError, match='read-only'):
            array[...] = 0.0


def test_the_points_of_the_struts_move_with_them():
    plant = exact_plant('mirror_4_strut')
    home = plant.strut_points
    assert len(home) == 4
    assert np.allclose(home[0][[0, -1]], [[0.0, 0.02, 0.0], [0.0, 0.02, 0.05]])
    driven(plant, np.full(4, 1e-3), 0.1)
    at_rest(plant)
    raised = plant.strut_points
    assert np.allclose(raised[0][0], home[0][0])
    assert np.allclose(raised[0][-1] - home[0][-1], [0.0, 0.0, 1e-4], atol=1e-8)


@pytest.mark.parametrize(
    ('rates', 'message'),
    [
        ([1.0, 2.0, 3.0], r'command: has shape \(3,\), expected 4'),
        ([0.0, 0.0, 0.0, np.nan], 'command: holds a number that is not finite'),
        ([0.0, 0.0, np.inf, 0.0], 'command: holds a number that is not finite'),
        (['a', 'b', 'c', 'd'], 'command: is not an array of numbers'),
    ],
)
def test_a_bad_command_is_refused_and_the_last_one_stands(rates, message):
    plant = exact_plant('mirror_4_strut')
    plant.command([1e-3, 1e-3, 1e-3, 1e-3])
    with pytest.raises(ArrayError, match=message):
        plant.command(rates)
    plant.step(0.01)
    assert np.allclose(plant.setpoints, 1e-5)


@pytest.mark.parametrize('dt', [-1e-9, 1.5, np.nan, np.inf])
def test_a_bad_time_step_is_refused(dt):
    plant = exact_plant('mirror_4_strut')
    with pytest.raises(ArrayError, match='dt: .* is not between 0 and 1.0 s'):
        plant.step(dt)


@pytest.mark.parametrize(
    ('settings', 'message'),
    [
        ({'actuator_stiffness': 0.0}, 'actuator_stiffness: must not be zero'),
        ({'structure_stiffness': -1.0}, 'structure_stiffness: -1.0 is not a finite, positive'),
        ({'encoder_noise': np.nan}, 'encoder_noise: nan is not a finite, positive number'),
        ({'command_timeout': np.inf}, 'command_timeout: inf is not a finite, positive number'),
        ({'weak_share': 1.5}, 'weak_share: 1.5 is more than 1'),
        ({'breakaway': -1e-6}, 'breakaway: -1e-06 is not a finite, positive number'),
        ({'runaway_rate': 0.0}, 'runaway_rate: must not be zero'),
        ({'encoders': 'both'}, "encoders: 'both' is not one of file, load, motor"),
        ({'disturbance': UNLOADED[:5]}, r'disturbance: has shape \(5,\), expected 6'),
        ({'disturbance': (*UNLOADED[:5], np.inf)}, 'disturbance: .* not finite'),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings, message):
    with pytest.raises(ArrayError, match=message):
        PlantSettings(**settings)


def test_a_mechanism_given_by_numbers_cannot_be_simulated():
    with pytest.raises(MechanismError, match='given by its Jacobian only cannot be simulated'):
        ElasticPlant(mechanism_from_text(BY_NUMBERS))


@pytest.mark.parametrize('strut', ['strut_1', 'strut_4'])
def test_after_a_loss_the_remaining_kinematics_hold(strut):
    mechanism = MECHANISMS['fsm_4_strut']
    kinematics = differential_kinematics(home_rows(mechanism), FailureSet(lost=(strut,)))
    reduced = np.array([0.001, -0.0005, 0.0008])
    plant = exact_plant('fsm_4_strut', f'hard {strut}')
    driven(plant, kinematics.mapping @ reduced / SHORT, SHORT)
    moved = task_motion(at_rest(plant), plant)
    assert np.allclose(moved, kinematics.jacobian @ reduced, atol=2e-6)
