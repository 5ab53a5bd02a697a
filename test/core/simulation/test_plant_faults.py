# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Breaking and mending the plant: nothing jumps, nothing becomes infinite."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_cases import MECHANISMS, ORDERS, broken, driven, exact_plant, rotation_of

from fault_tolerance.errors import FailureError
from fault_tolerance.simulation.faults import FaultCommand, fault_command
from fault_tolerance.simulation.plant import ElasticPlant

ZERO = np.zeros(4)
# Rates that contradict each other once an actuator is stuck, in a mirror of 20 mm.
SCAN = np.array([4e-4, -2e-4, -4e-4, 2e-4])
LOADED = {'disturbance': (0.004, 0.003, 0.001, 0.001, 0.002, 0.003)}


@pytest.mark.parametrize(
    'faults',
    [
        ['position theta_4'],
        ['torque theta_2'],
        ['hard strut_3'],
        ['position theta_1', 'torque theta_3'],
        ['position theta_1', 'hard strut_2'],
        ['torque theta_1', 'torque theta_2'],
        ['hard strut_1', 'hard strut_3'],
        ['hard all'],
    ],
)
def test_mending_moves_nothing_at_once_and_leaves_no_strain(faults):
    plant = exact_plant('mirror_4_strut', *faults, **LOADED)
    driven(plant, SCAN, 0.5)
    before = driven(plant, ZERO, 0.05)
    broken(plant, 'ok all')
    after = plant.step(1e-3)
    # At 1 kHz and an engagement time of 50 ms a fiftieth of the strain goes in the first step.
    assert np.abs(rotation_of(after) - rotation_of(before)).max() < 5e-5
    assert np.abs(after.pose[:3, 3] - before.pose[:3, 3]).max() < 1e-6
    forces = np.abs(before.efforts).max() + 1e-2
    assert np.abs(after.efforts).max() < 1.1 * forces
    rested = driven(plant, ZERO, 0.8)
    assert np.abs(rested.efforts).max() < 0.1
    assert np.abs(rested.twist).max() < 1e-6
    assert plant.actuator_faults == ('none',) * 4


def test_a_mended_mirror_obeys_as_before():
    plant = exact_plant('mirror_4_strut', 'hard strut_3', **LOADED)
    driven(plant, SCAN, 0.3)
    broken(plant, 'ok strut_3')
    start = driven(plant, ZERO, 0.5)
    end = driven(plant, SCAN, 0.5)
    assert np.allclose((end.values - start.values) / 0.5, SCAN, atol=2e-6)
    assert np.allclose(end.twist[:2], [0.02, 0.01], rtol=1e-2)


def test_a_stuck_actuator_holds_its_place_and_a_mended_one_starts_from_it():
    plant = exact_plant('mirror_4_strut')
    driven(plant, SCAN, 0.1)
    broken(plant, 'position theta_1')
    held = plant.setpoints[0]
    state = driven(plant, np.array([0.05, 0.0, 0.0, 0.0]), 0.2)
    assert plant.setpoints[0] == held
    assert state.values[0] == pytest.approx(held, abs=1e-9)
    broken(plant, 'ok theta_1')
    driven(plant, ZERO, 0.2)
    driven(plant, np.full(4, 1e-4), 0.1)
    assert plant.setpoints[0] == pytest.approx(held + 1e-5, abs=1e-9)


def test_a_free_actuator_takes_hold_where_it_was_carried():
    plant = exact_plant('mirror_4_strut', 'torque theta_4')
    carried = driven(plant, SCAN, 0.2).values[3]
    assert carried == pytest.approx(0.2 * SCAN[3], rel=1e-2)
    assert plant.setpoints[3] == 0.0
    settled = driven(plant, ZERO, 0.1).values[3]
    broken(plant, 'ok theta_4')
    assert plant.setpoints[3] == pytest.approx(settled, abs=1e-12)
    assert np.abs(driven(plant, ZERO, 0.1).efforts).max() < 1e-3


def test_a_free_actuator_that_locks_locks_where_it_is():
    plant = exact_plant('mirror_4_strut', 'torque theta_4')
    driven(plant, SCAN, 0.2)
    carried = driven(plant, ZERO, 0.1).values[3]
    broken(plant, 'position theta_4')
    state = driven(plant, ZERO, 0.1)
    assert plant.setpoints[3] == carried
    assert state.values[3] == pytest.approx(carried, abs=1e-10)


def test_a_lost_strut_is_fitted_to_where_the_mirror_has_gone():
    plant = exact_plant('mirror_4_strut', 'hard strut_4')
    driven(plant, SCAN, 0.2)
    lost = driven(plant, ZERO, 0.1)
    broken(plant, 'ok strut_4')
    state = driven(plant, ZERO, 0.3)
    assert lost.values[3] == 0.0
    assert state.values[3] == pytest.approx(0.2 * SCAN[3], rel=1e-2)
    assert np.abs(state.efforts).max() < 1e-2


def test_what_happened_to_a_drive_in_a_lost_strut_shows_when_it_is_back():
    plant = exact_plant('mirror_overactuated', 'hard strut_1', 'position theta_4')
    assert plant.actuator_faults == ('hard', 'none', 'none', 'hard', 'hard')
    driven(plant, np.array([0.0, 2e-4, -2e-4, 0.0, 0.0]), 0.2)
    broken(plant, 'ok theta_1')
    assert plant.actuator_faults == ('none', 'none', 'none', 'position', 'none')
    assert plant.setpoints[3] == 0.0
    # The mirror has tilted by some 2 mrad about x; the locked drive now holds against that.
    state = driven(plant, np.zeros(5), 0.5)
    assert 5e-4 < state.values[3] < 2e-3
    length = plant.mechanism.characteristic_length
    assert state.efforts[3] == pytest.approx(-1e6 * length**2 * state.values[3], rel=1e-6)


def test_a_strut_all_of_whose_actuators_are_free_is_mended_with_it():
    plant = exact_plant('mirror_overactuated', 'torque strut_1')
    assert plant.actuator_faults == ('torque', 'none', 'none', 'torque', 'torque')
    broken(plant, 'ok strut_1')
    assert plant.actuator_faults == ('none',) * 5


def test_repeated_orders_change_nothing():
    for fault in ('position theta_1', 'torque theta_1', 'hard strut_1', 'ok all'):
        plant = exact_plant('mirror_4_strut', fault, **LOADED)
        other = exact_plant('mirror_4_strut', fault, **LOADED)
        driven(plant, SCAN, 0.02)
        driven(other, SCAN, 0.02)
        broken(other, fault)
        assert (plant.step(1e-3).values == other.step(1e-3).values).all()


def test_a_mended_drive_takes_up_its_commanded_rate_with_its_lag():
    plant = exact_plant('mirror_4_strut', 'torque theta_1', servo_time_constant=0.01)
    driven(plant, np.full(4, 1e-3), 0.1)
    broken(plant, 'ok theta_1')
    held = plant.setpoints[0]
    driven(plant, np.full(4, 1e-3), 1e-3)
    # 1 mm/s after a tenth of a time constant: half of a tenth of the way at full rate.
    assert plant.setpoints[0] - held == pytest.approx(0.5 * 0.1 * 1e-6, rel=0.1)


@pytest.mark.parametrize(
    ('command', 'message'),
    [
        (FaultCommand('position', ('strut_1',)), "not subject to position: 'strut_1'; valid: th"),
        (FaultCommand('frozen', ('strut_1',)), "not subject to frozen: 'strut_1'; valid: theta_1"),
        (FaultCommand('runaway', ('theta_1', 'theta_9')), "not subject to runaway: 'theta_9'"),
        (FaultCommand('hard', ('theta_1',)), "not subject to hard: 'theta_1'; valid: strut_1"),
        (FaultCommand('none', ('theta_1', 'theta_9')), "not subject to none: 'theta_9'"),
    ],
)
def test_an_order_for_a_part_that_cannot_have_it_does_nothing(command, message):
    plant = exact_plant('mirror_4_strut', 'torque theta_1')
    with pytest.raises(FailureError, match=message):
        plant.apply(command)
    assert plant.actuator_faults == ('torque', 'none', 'none', 'none')
    assert plant.encoder_faults == ('none',) * 4


@pytest.mark.parametrize('name', MECHANISMS)
@settings(max_examples=8, deadline=None)
@given(data=st.data())
def test_whatever_happens_every_number_is_finite(name, data):
    mechanism = MECHANISMS[name]
    plant = ElasticPlant(mechanism)
    names = [*mechanism.actuator_names, *mechanism.strut_names, 'all']
    rate = st.one_of(st.floats(-1.0, 1.0), st.floats(-1e300, 1e300))
    for _ in range(8):
        mode = data.draw(st.sampled_from(ORDERS))
        plant.apply(fault_command(mechanism, f'{mode} {data.draw(st.sampled_from(names))}'))
        count = len(mechanism.actuators)
        plant.command(data.draw(st.lists(rate, min_size=count, max_size=count)))
        dt = data.draw(st.sampled_from([1e-9, 1e-4, 1e-3, 1e-2, 0.1, 1.0]))
        for _ in range(3):
            state = plant.step(dt)
        for array in vars(state).values():
            assert np.isfinite(array).all()
        assert np.allclose(state.pose[:3, :3] @ state.pose[:3, :3].T, np.eye(3), atol=1e-9)
    plant.apply(fault_command(mechanism, 'ok all'))
    assert np.isfinite(plant.step(1e-3).efforts).all()
