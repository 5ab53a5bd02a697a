# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The plant in MuJoCo: stiffness, weight, drives, and parts that break and are mended."""

from __future__ import annotations

import copy
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_cases import BY_NUMBERS, MECHANISMS, ORDERS, UNLOADED, broken, driven, rotation_of

from fault_tolerance.cli import main
from fault_tolerance.errors import ArrayError, EngineError, MechanismError
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.simulation.engines import ENGINES, plant_named, require_engine
from fault_tolerance.simulation.faults import fault_command
from fault_tolerance.simulation.mjcf import Masses, mjcf_text
from fault_tolerance.simulation.mujoco import MujocoPlant
from fault_tolerance.simulation.plant_settings import PlantSettings

NOWHERE = (0.0, 0.0, 0.0)
PLATFORM_WEIGHT = 9.81 * 20.0 * np.pi * 0.02**2
ZERO = np.zeros(4)
# Consistent rates of the mirror of 20 mm, and rates for it with theta_4 stuck.
SCAN = np.array([4e-4, -2e-4, -4e-4, 2e-4])


def plant_of(name, *faults, gravity=NOWHERE, **changes):
    defaults = {'encoder_noise': 0.0, 'disturbance': UNLOADED, 'servo_time_constant': 0.0}
    plant = MujocoPlant(
        MECHANISMS[name], PlantSettings(**{**defaults, **changes}), masses=Masses(gravity=gravity))
    broken(plant, *faults)
    return plant


def elements(name, tag):
    root = ElementTree.fromstring(mjcf_text(MECHANISMS[name]))
    return root.findall(f'.//{tag}')


@pytest.mark.parametrize('name', MECHANISMS)
def test_a_model_has_a_body_for_every_joint_and_a_closure_for_every_strut(name):
    mechanism = MECHANISMS[name]
    balls = 3 * len(elements(name, 'equality/connect'))
    joints = sum(len(strut.joints) for strut in mechanism.struts)
    assert len(elements(name, 'body')) == joints - balls + 1
    closures = {*elements(name, 'equality/connect'), *elements(name, 'equality/weld')}
    assert {one.get('name') for one in closures} == set(mechanism.strut_names)
    locks = elements(name, 'equality/joint')
    assert [one.get('name') for one in locks] == list(mechanism.actuator_names)
    assert {one.get('active') for one in locks} == {'false'}
    assert len(elements(name, 'actuator/position')) == len(mechanism.actuators)


def test_a_spherical_joint_is_a_closure_unless_it_is_driven():
    kinds = {one.get('name'): one.tag for one in (
        *elements('mirror_overactuated', 'equality/connect'),
        *elements('mirror_overactuated', 'equality/weld'))}
    assert kinds == {'strut_1': 'weld', 'strut_2': 'connect', 'strut_3': 'connect'}
    assert len(elements('serial_3r', 'equality/weld')) == 1


@pytest.mark.parametrize('fault', ['ok all', 'position all', 'position theta_4'])
def test_drives_are_as_stiff_as_the_settings_say_stuck_or_not(fault):
    plant = plant_of('mirror_4_strut', fault, disturbance=(0.0, 0.0, 0.0, 0.0, 0.0, 10.0))
    state = driven(plant, ZERO, 0.2, 4e-3)
    assert np.allclose(state.efforts, -2.5, rtol=1e-6)
    assert np.allclose(state.values, 2.5e-6, rtol=1e-6)
    # The closures, in series with them, are not quite so stiff as 1e8 N/m.
    assert 2.5e-6 < state.pose[2, 3] - 0.05 < 2.6e-6


def test_the_drives_carry_the_weight():
    plant = plant_of('mirror_4_strut', gravity=(0.0, 0.0, -9.81))
    state = driven(plant, ZERO, 0.2, 4e-3)
    # And of each strut's own the upper half.
    assert PLATFORM_WEIGHT < state.efforts.sum() < 1.05 * PLATFORM_WEIGHT
    assert np.ptp(state.efforts) < 1e-6
    assert state.pose[2, 3] - 0.05 == pytest.approx(-state.efforts.sum() / 4e6, rel=0.05)
    assert np.abs(state.twist).max() < 1e-9


def test_moments_and_forces_act_as_on_the_elastic_plant():
    load = (0.4, -0.3, 0.0, 0.0, 0.0, 0.5)
    states = []
    for engine in ENGINES:
        settings_of = PlantSettings(encoder_noise=0.0, disturbance=load)
        plant = plant_named(engine, MECHANISMS['mirror_4_strut'], settings_of)
        states.append(driven(plant, ZERO, 0.2, 4e-3))
    elastic, mujoco = states
    weight = mujoco.efforts.mean() - elastic.efforts.mean()
    assert np.allclose(mujoco.efforts - weight, elastic.efforts, atol=1e-5)


def test_struts_fight_when_a_stuck_actuator_is_not_considered():
    plant = plant_of('mirror_4_strut', 'position theta_4')
    driven(plant, SCAN, 0.1, 4e-3)
    state = driven(plant, ZERO, 0.1, 4e-3)
    # Least squares: a quarter of the contradiction in every strut, pushing and pulling in turn.
    expected = 1e6 * 0.1 * -2e-4 / 4.0 * np.array([-1.0, 1.0, -1.0, 1.0])
    assert np.allclose(state.efforts, expected, rtol=0.03)
    assert state.rates[3] == pytest.approx(0.0, abs=1e-9)


def test_a_free_actuator_follows_the_platform_without_force():
    plant = plant_of('mirror_4_strut', 'torque theta_4')
    state = driven(plant, SCAN, 0.2, 4e-3)
    assert state.rates[3] == pytest.approx(SCAN[3], rel=1e-2)
    assert state.efforts[3] == 0.0
    # The hinges, which bar one direction twice, strain the closures a little.
    assert np.abs(driven(plant, ZERO, 0.1, 4e-3).efforts).max() < 0.05


def test_a_free_actuator_stops_at_the_end_of_its_stroke():
    plant = plant_of('mirror_3_strut', 'torque theta_1', gravity=(0.0, 0.0, -9.81))
    state = driven(plant, np.zeros(3), 1.5, 0.02)
    assert state.values[0] == pytest.approx(-6e-4, abs=1e-6)
    assert np.abs(state.rates).max() < 1e-5


def test_a_lost_strut_stays_as_it_was_while_the_mirror_moves_on():
    plant = plant_of('mirror_4_strut', gravity=(0.0, 0.0, -9.81))
    before = driven(plant, SCAN, 0.1, 4e-3)
    broken(plant, 'hard strut_4')
    state = driven(plant, SCAN, 0.1, 4e-3)
    assert state.values[3] == before.values[3] == state.measured_values[3]
    assert state.rates[3] == state.efforts[3] == 0.0
    assert np.allclose(rotation_of(state)[:2], 2.0 * rotation_of(before)[:2], atol=2e-5)
    assert plant.lost_struts == ('strut_4',)


@pytest.mark.parametrize('name', ['mirror_4_strut', 'mirror_overactuated', 'gough_stewart_8'])
def test_strut_points_end_at_the_platform(name):
    plant = plant_of(name)
    for strut, points in zip(plant.mechanism.struts, plant.strut_points, strict=True):
        turning = [joint.point for joint in strut.joints if joint.kind == 'revolute']
        assert np.allclose(points, turning, atol=1e-9)


@pytest.mark.parametrize(
    'faults',
    [
        ['position theta_4'],
        ['torque theta_2'],
        ['hard strut_3'],
        ['position theta_1', 'torque theta_3'],
        ['position theta_1', 'hard strut_2'],
        ['hard strut_1', 'hard strut_3'],
    ],
)
def test_mending_moves_nothing_at_once_and_leaves_no_strain(faults):
    plant = plant_of('mirror_4_strut', *faults, gravity=(0.0, 0.0, -9.81))
    driven(plant, SCAN, 0.3, 4e-3)
    before = driven(plant, ZERO, 0.1, 4e-3)
    broken(plant, 'ok all')
    after = plant.step(1e-3)
    assert np.abs(rotation_of(after) - rotation_of(before)).max() < 5e-5
    assert np.abs(after.pose[:3, 3] - before.pose[:3, 3]).max() < 1e-6
    assert np.abs(after.efforts).max() < 1.3 * np.abs(before.efforts).max() + 0.1
    rested = driven(plant, ZERO, 0.8, 0.02)
    # What is left is weight, and what the flexures hold.
    assert np.abs(rested.efforts).max() < 0.3
    assert np.abs(rested.twist).max() < 1e-6
    assert plant.actuator_faults == ('none',) * 4
    end = driven(plant, SCAN, 0.2, 4e-3)
    assert np.allclose((end.values - rested.values) / 0.2, SCAN, atol=4e-6)


def test_a_welded_strut_is_fastened_where_the_platform_has_gone():
    plant = plant_of('mirror_overactuated', 'hard strut_1', 'position theta_4')
    driven(plant, np.array([0.0, 2e-4, -2e-4, 0.0, 0.0]), 0.2, 4e-3)
    before = plant.state
    broken(plant, 'ok theta_1')
    after = plant.step(1e-3)
    assert np.abs(rotation_of(after) - rotation_of(before)).max() < 5e-5
    assert plant.actuator_faults == ('none', 'none', 'none', 'position', 'none')
    # The mirror has tilted by some 2 mrad about x; the locked drive draws it back.
    rested = driven(plant, np.zeros(5), 0.8, 0.02)
    assert abs(rotation_of(rested)[0]) < 0.8 * abs(rotation_of(before)[0])


def test_drives_stop_when_commands_cease():
    plant = plant_of('mirror_4_strut', command_timeout=0.05)
    plant.command(np.full(4, 1e-3))
    for _ in range(20):
        plant.step(0.01)
    assert np.allclose(plant.setpoints, 5e-5)
    assert np.allclose(plant.state.values, 5e-5, rtol=1e-3)


def test_rates_and_strokes_are_limited():
    plant = plant_of('mirror_4_strut')
    state = driven(plant, np.full(4, 1e300), 0.004, 1e-3)
    assert np.allclose(plant.setpoints, 0.05 * 0.004)
    state = driven(plant, np.full(4, 1e300), 0.2, 0.01)
    assert np.allclose(plant.setpoints, 6e-4)
    assert np.allclose(state.values, 6e-4, atol=1e-8)


def test_the_same_seed_gives_the_same_run_and_a_copy_goes_on_alike():
    runs = []
    for seed in (3, 3, 4):
        plant = plant_named('mujoco', MECHANISMS['mirror_4_strut'], rng=seed)
        driven(plant, SCAN, 0.02, 4e-3)
        twin = copy.deepcopy(plant)
        state, alike = (driven(one, SCAN, 0.02, 4e-3) for one in (plant, twin))
        assert np.array_equal(state.measured_values, alike.measured_values)
        assert np.array_equal(state.pose, alike.pose)
        runs.append(state.measured_values)
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_bad_orders_are_refused():
    plant = plant_of('mirror_4_strut')
    with pytest.raises(ArrayError, match='command: holds a number that is not finite'):
        plant.command([1.0, 0.0, 0.0, np.nan])
    with pytest.raises(ArrayError, match='dt: 2.0 s is not between 0 and 1.0 s'):
        plant.step(2.0)
    with pytest.raises(MechanismError, match='given by its Jacobian only cannot be simulated'):
        MujocoPlant(mechanism_from_text(BY_NUMBERS))
    with pytest.raises(MechanismError, match='given by its Jacobian only cannot be simulated'):
        mjcf_text(mechanism_from_text(BY_NUMBERS))
    with pytest.raises(EngineError, match="engine 'bullet' is not one of elastic, mujoco"):
        plant_named('bullet', MECHANISMS['mirror_4_strut'])


def test_a_missing_package_is_named_in_one_line(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    for order in (
        lambda: require_engine('mujoco'),
        lambda: MujocoPlant(MECHANISMS['mirror_4_strut']),
    ):
        with pytest.raises(EngineError, match=r"pip install 'fault_tolerance\[mujoco\]'") as found:
            order()
        assert '\n' not in str(found.value)
    assert main(['demo', '--engine', 'mujoco']) == 2
    complaint = capsys.readouterr().err
    assert complaint.startswith('fault_tolerance: the engine mujoco needs: pip install')
    assert complaint.count('\n') == 1
    require_engine('elastic')
    mjcf_text(MECHANISMS['mirror_4_strut'])


def test_a_simulation_gone_wrong_is_told_of(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its log
    plant = plant_of('mirror_4_strut')
    plant._data.qvel[0] = np.nan
    with pytest.raises(EngineError, match='the simulation has become unstable'):
        plant.step(0.01)


@pytest.mark.parametrize('name', MECHANISMS)
@settings(max_examples=3, deadline=None, derandomize=True)
@given(data=st.data())
def test_whatever_happens_every_number_is_finite(name, data):
    mechanism = MECHANISMS[name]
    plant = MujocoPlant(mechanism)
    names = [*mechanism.actuator_names, *mechanism.strut_names, 'all']
    rate = st.one_of(st.floats(-1.0, 1.0), st.floats(-1e300, 1e300))
    for _ in range(6):
        mode = data.draw(st.sampled_from(ORDERS))
        plant.apply(fault_command(mechanism, f'{mode} {data.draw(st.sampled_from(names))}'))
        count = len(mechanism.actuators)
        plant.command(data.draw(st.lists(rate, min_size=count, max_size=count)))
        dt = data.draw(st.sampled_from([1e-9, 1e-4, 1e-3, 1e-2, 0.1]))
        for _ in range(3):
            state = plant.step(dt)
        for array in vars(state).values():
            assert np.isfinite(array).all()
        assert np.allclose(state.pose[:3, :3] @ state.pose[:3, :3].T, np.eye(3), atol=1e-9)
    plant.apply(fault_command(mechanism, 'ok all'))
    assert np.isfinite(plant.step(1e-3).efforts).all()
