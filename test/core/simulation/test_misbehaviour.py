# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Drives and encoders that misbehave in their own ways, in every engine, and their repair."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from plant_cases import MECHANISMS, UNLOADED, broken, driven, rotation_of

from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.resources import share_directory
from fault_tolerance.simulation.mjcf import Masses
from fault_tolerance.simulation.mujoco import MujocoPlant
from fault_tolerance.simulation.plant import ElasticPlant
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.state import present_faults

ZERO = np.zeros(4)
# Consistent rates of the mirror of 20 mm, in which no two drives contradict each other.
SCAN = np.array([4e-4, -2e-4, -4e-4, 2e-4])
UP = np.full(4, 2e-4)
STROKE = 6e-4

needs_mujoco = pytest.mark.skipif(find_spec('mujoco') is None, reason='mujoco is not installed')


@pytest.fixture(params=['elastic', pytest.param('mujoco', marks=needs_mujoco)])
def plant_of(request):
    """Makes a plant without noise, load and lag of an engine, broken as the words say."""

    def made(*faults, mechanism='mirror_4_strut', rng=0, **changes):
        exact = {'encoder_noise': 0.0, 'disturbance': UNLOADED, 'servo_time_constant': 0.0}
        settings = PlantSettings(**{**exact, **changes})
        found = MECHANISMS[mechanism]
        if request.param == 'elastic':
            plant = ElasticPlant(found, settings, rng)
        else:
            plant = MujocoPlant(found, settings, rng, Masses(gravity=(0.0, 0.0, 0.0)))
        broken(plant, *faults)
        return plant

    return made


def moved(plant, rates, duration=0.1):
    """Drive, come to rest, and return how far the setpoints have moved, and the state."""
    before = plant.setpoints
    driven(plant, rates, duration, 4e-3)
    state = driven(plant, np.zeros(len(before)), 0.04, 4e-3)
    return plant.setpoints - before, state


# Encoders

@pytest.mark.parametrize('word', ['frozen', 'encoder'])
def test_a_frozen_encoder_repeats_its_last_reading_until_it_is_mended(plant_of, word):
    plant = plant_of(encoder_noise=2e-9)
    last = driven(plant, SCAN, 0.1, 4e-3).measured_values
    broken(plant, f'{word} theta_1')
    for _ in range(5):
        state = driven(plant, SCAN, 0.02, 4e-3)
        assert state.measured_values[0] == last[0]
        assert state.measured_rates[0] == 0.0
        assert np.allclose(state.measured_rates[1:], state.rates[1:])
        assert np.allclose(state.measured_values[1:], state.values[1:], atol=2e-8)
    assert state.values[0] == pytest.approx(last[0] + 0.1 * SCAN[0], rel=0.03)
    assert state.rates[0] == pytest.approx(SCAN[0], rel=0.03)
    broken(plant, 'ok theta_1')
    state = plant.step(4e-3)
    assert np.allclose(state.measured_values, state.values, atol=2e-8)


def test_the_reading_of_a_biased_encoder_jumps_by_the_parameter(plant_of):
    for changes, bias in (({}, 2e-6), ({'encoder_bias': 5e-5}, 5e-5)):
        plant = plant_of(mechanism='mirror_overactuated', **changes)
        broken(plant, 'biased theta_2', 'biased theta_4')
        state = driven(plant, np.zeros(5), 0.02, 4e-3)
        length = plant.mechanism.characteristic_length
        expected = [0.0, bias, 0.0, bias / length, 0.0]
        assert np.allclose(state.measured_values - state.values, expected, rtol=1e-9, atol=1e-15)
        # It is the drive that is where it should be.
        assert np.allclose(state.values, 0.0, atol=1e-9)
        assert np.allclose(state.measured_rates, state.rates, atol=1e-12)
        broken(plant, 'ok all')
        state = plant.step(4e-3)
        assert (state.measured_values == state.values).all()


def test_an_encoder_of_the_motor_reads_the_drive_and_one_of_the_load_the_joint(plant_of):
    for side in ('load', 'motor'):
        plant = plant_of('silent stuck theta_4', encoders=side)
        way, state = moved(plant, SCAN)
        held, joint, read = way[3], state.values[3], state.measured_values[3]
        assert held == 0.0
        # The others draw the joint a quarter of the way they would have taken it.
        assert joint == pytest.approx(0.1 * SCAN[3] / 4.0, rel=0.05)
        assert read == (joint if side == 'load' else 0.0)
        # That of a free drive is carried along with the joint, to where the others have it.
        broken(plant, 'silent free theta_4')
        _, state = moved(plant, SCAN)
        assert state.measured_values[3] == state.values[3]
        assert state.values[3] == pytest.approx(0.2 * SCAN[3], rel=0.05)


def test_a_mended_drive_moves_no_encoder_at_once(plant_of):
    for fault in ('stuck', 'weak', 'reversed', 'runaway'):
        plant = plant_of(f'{fault} theta_4', encoders='motor')
        _, before = moved(plant, SCAN)
        broken(plant, 'ok all')
        after = plant.step(1e-5)
        assert np.allclose(after.measured_values, before.measured_values, atol=1e-8)


def test_the_side_of_an_encoder_comes_from_the_mechanism_file():
    path = share_directory() / 'config' / 'mechanisms' / 'mirror_4_strut.yaml'
    text = path.read_text().replace('actuated: true', 'actuated: true, encoder: motor', 1)
    mechanism = mechanism_from_text(text, 'file')
    motor = [one.encoder == 'motor' for one in mechanism.actuators]
    assert sum(motor) == 1
    base = PlantSettings(
        encoder_noise=0.0, disturbance=(*UNLOADED[:5], 10.0), servo_time_constant=0.0)
    for choice, expected in (('file', motor), ('load', [False] * 4), ('motor', [True] * 4)):
        state = driven(ElasticPlant(mechanism, replace(base, encoders=choice)), ZERO, 0.05)
        # The load compresses what is between drive and joint.
        assert (state.values > 1e-6).all()
        assert (state.measured_values == np.where(expected, 0.0, state.values)).all()


# Drives

@pytest.mark.parametrize(
    ('fault', 'share', 'changes'),
    [('weak', 0.5, {}), ('weak', 0.25, {'weak_share': 0.25}), ('reversed', -1.0, {})],
)
def test_a_drive_moves_a_part_of_the_way_or_the_wrong_way(plant_of, fault, share, changes):
    plant = plant_of(f'{fault} theta_1', **changes)
    way, _ = moved(plant, SCAN)
    assert np.allclose(way, 0.1 * SCAN * [share, 1.0, 1.0, 1.0], rtol=1e-9)
    plant = plant_of(f'{fault} all', **changes)
    way, state = moved(plant, UP)
    assert np.allclose(way, 0.1 * share * UP, rtol=1e-9)
    assert np.allclose(state.values, way, rtol=1e-3)
    height = state.pose[2, 3] - plant.mechanism.origin[2]
    assert height == pytest.approx(0.1 * share * UP[0], rel=1e-3)


def test_a_drive_runs_away_to_the_end_of_its_stroke_whatever_it_is_told(plant_of):
    plant = plant_of('runaway theta_1', mechanism='mirror_3_strut', runaway_rate=2e-3)
    state = driven(plant, np.array([-1e-3, 0.0, 0.0]), 0.1, 4e-3)
    assert plant.setpoints[0] == pytest.approx(2e-4)
    assert state.values[0] == pytest.approx(2e-4, rel=0.01)
    for _ in range(10):  # and with nobody who commands
        state = plant.step(0.05)
    assert plant.setpoints[0] == STROKE
    assert state.values[0] == pytest.approx(STROKE, abs=1e-7)
    assert np.abs(plant.setpoints[1:]).max() == 0.0
    assert np.abs(state.rates).max() < 1e-6


def test_a_turning_drive_runs_away_at_an_angle(plant_of):
    plant = plant_of('runaway theta_4', mechanism='mirror_overactuated')
    driven(plant, np.zeros(5), 0.1, 4e-3)
    assert plant.setpoints[3] == pytest.approx(1e-5 / plant.mechanism.characteristic_length)


@pytest.mark.parametrize('fault', ['weak theta_1', 'reversed theta_1', 'runaway theta_1'])
def test_what_misbehaved_obeys_again_without_a_jump_and_leaves_no_strain(plant_of, fault):
    plant = plant_of(fault)
    driven(plant, SCAN, 0.1, 4e-3)
    before = driven(plant, ZERO, 0.1, 4e-3)
    assert np.abs(before.efforts).max() > 2.0
    broken(plant, 'ok theta_1')
    after = plant.step(1e-3)
    assert np.abs(rotation_of(after) - rotation_of(before)).max() < 5e-5
    assert np.abs(after.efforts).max() < 1.3 * np.abs(before.efforts).max()
    rested = driven(plant, ZERO, 0.8, 0.02)
    assert np.abs(rested.efforts).max() < 0.3
    assert plant.actuator_faults == ('none',) * 4
    way, state = moved(plant, SCAN)
    assert np.allclose(way, 0.1 * SCAN, rtol=1e-9)
    assert np.allclose(state.values - rested.values, 0.1 * SCAN, atol=1e-6)


def test_a_free_drive_that_misbehaves_takes_hold_where_it_was_carried(plant_of):
    plant = plant_of('free theta_4')
    _, carried = moved(plant, SCAN)
    broken(plant, 'weak theta_4')
    assert plant.setpoints[3] == pytest.approx(carried.values[3], abs=1e-9)
    way, state = moved(plant, SCAN)
    assert way[3] == pytest.approx(0.05 * SCAN[3])
    broken(plant, 'stuck theta_4')
    held = plant.setpoints[3]
    way, _ = moved(plant, SCAN)
    assert way[3] == 0.0 and plant.setpoints[3] == held
    assert state.values[3] == pytest.approx(held, abs=1e-5)


def test_a_drive_with_static_friction_sticks_and_then_slips(plant_of):
    plant = plant_of(breakaway=4e-6)
    # A micrometre a step of 4 ms.
    rates = np.full(4, 2.5e-4)
    for _ in range(4):
        plant.command(rates)
        state = plant.step(3.9e-3)
        assert (plant.setpoints == 0.0).all()
        assert np.abs(state.values).max() < 1e-9
    heights = [driven(plant, rates, 4e-3, 4e-3).values[0] for _ in range(40)]
    # It lags behind by no more than that, and is at rest most of the time.
    expected = 2.5e-4 * (4 * 3.9e-3 + 4e-3 * np.arange(1, 41))
    assert (np.abs(heights - expected) < 4.6e-6).all()
    rests = np.abs(np.diff(heights)) < 1e-8
    assert 0.5 < rests.mean() < 0.85


# Lost struts

def test_nobody_tells_the_drive_of_a_strut_that_is_lost_silently(plant_of):
    for side in ('load', 'motor'):
        plant = plant_of('silent lost strut_4', encoders=side)
        before = plant.state
        rates = SCAN * [1.0, 1.0, 1.0, -2.0]
        way, state = moved(plant, rates)
        assert way[3] == pytest.approx(0.1 * rates[3])
        assert state.measured_values[3] == state.values[3] == plant.setpoints[3]
        assert state.efforts[3] == 0.0
        # The platform does not mind.
        turned = rotation_of(state) - rotation_of(before)
        assert np.allclose(turned[:2], [2e-3, 1e-3], rtol=0.02)
        state = driven(plant, rates, 0.02, 4e-3)
        assert state.rates[3] == pytest.approx(rates[3])
        assert state.measured_rates[3] == pytest.approx(rates[3])
        # Told to stand still it does, and reads noise only.
        state = driven(plant, ZERO, 0.02, 4e-3)
        assert state.measured_rates[3] == 0.0
        broken(plant, 'ok strut_4')
        after = plant.step(1e-3)
        assert after.values[3] == pytest.approx(-after.values[1], rel=0.05)
        assert np.abs(rotation_of(after) - rotation_of(state)).max() < 5e-5
        rested = driven(plant, ZERO, 0.6, 0.02)
        assert np.abs(rested.efforts).max() < 0.3


def test_the_drive_of_a_strut_reported_lost_stands_still(plant_of):
    plant = plant_of(encoder_noise=2e-9)
    driven(plant, SCAN, 0.02, 4e-3)
    broken(plant, 'silent lost strut_4')
    driven(plant, SCAN, 0.02, 4e-3)
    broken(plant, 'lost strut_4', 'silent lost strut_4')
    first = plant.step(4e-3)
    state = driven(plant, SCAN, 0.02, 4e-3)
    assert state.measured_values[3] == first.measured_values[3] == state.values[3]
    assert state.measured_rates[3] == state.rates[3] == 0.0
    broken(plant, 'ok all')
    way, _ = moved(plant, SCAN)
    assert np.allclose(way, 0.1 * SCAN, rtol=1e-9)


def test_what_is_wrong_with_the_drive_of_a_silently_lost_strut_shows_in_its_reading(plant_of):
    expected = {'stuck': 0.0, 'weak': 0.5, 'reversed': -1.0, 'free': 0.0}
    for fault, share in expected.items():
        plant = plant_of('silent lost strut_4', f'silent {fault} theta_4')
        _, state = moved(plant, SCAN)
        assert state.measured_values[3] == pytest.approx(0.1 * share * SCAN[3], abs=1e-12)


# Together

def test_an_encoder_may_be_broken_beside_its_drive(plant_of):
    plant = plant_of('frozen theta_1', 'stuck theta_1', 'biased theta_2', 'lost strut_3')
    assert plant.actuator_faults == ('position', 'none', 'hard', 'none')
    assert plant.encoder_faults == ('frozen', 'biased', 'none', 'none')
    assert present_faults(plant) == {
        'theta_1': ('position', 'frozen'), 'theta_2': ('biased',), 'theta_3': ('hard',),
        'theta_4': (),
    }
    way, state = moved(plant, SCAN)
    assert way[0] == 0.0
    assert state.measured_values[0] == 0.0
    assert state.measured_values[1] == pytest.approx(state.values[1] + 2e-6, abs=1e-12)
    broken(plant, 'ok theta_1')
    assert plant.actuator_faults == ('none', 'none', 'hard', 'none')
    assert plant.encoder_faults == ('none', 'biased', 'none', 'none')
    # A new fault of an encoder takes the place of the old one, and of a drive likewise.
    broken(plant, 'frozen theta_2', 'weak theta_2', 'runaway theta_2')
    assert plant.actuator_faults[1] == 'runaway'
    assert plant.encoder_faults[1] == 'frozen'
    broken(plant, 'ok all')
    assert present_faults(plant) == dict.fromkeys(plant.mechanism.actuator_names, ())


def test_faults_of_one_leave_the_noise_of_the_others_alone(plant_of):
    def record(*faults, seed=5):
        plant = plant_of(*faults, rng=seed, encoder_noise=2e-9)
        states = [plant.step(4e-3) for _ in range(20)]
        return np.array([state.measured_values - state.values for state in states])

    healthy = record()
    for faults in (['frozen theta_1'], ['biased theta_1'], ['silent lost strut_1']):
        found = record(*faults)
        assert (found == record(*faults)).all()
        assert np.allclose(found[:, 1:], healthy[:, 1:], rtol=0.0, atol=1e-15)
    assert (record(seed=6) != healthy).all()
