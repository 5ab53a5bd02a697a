# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What is said to be separable differs in a plant by far more than the noise; the rest does not.

Of redundant mechanisms: without redundancy a platform is loose after a failure, and goes as
friction has it.
"""

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from core.detection.detection_cases import ENGINES
from core.simulation.plant_cases import UNLOADED, broken

from fault_tolerance.detection.hypotheses import HEALTHY
from fault_tolerance.detection.isolability import isolability
from fault_tolerance.detection.responses import Sensors
from fault_tolerance.detection.separation import self_stress
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.simulation.engines import plant_named
from fault_tolerance.simulation.plant_settings import PlantSettings

SIZE = 2e-5
"""Metres of every motion."""

WAYS = [(sensors, probe)
        for sensors in (Sensors(), Sensors(efforts=True), Sensors(pose=True))
        for probe in (False, True)]
MODES = {'position': 'stuck', 'torque': 'free', 'hard': 'lost', 'encoder': 'frozen'}


def motions(rows):
    """Return motions of the setpoints that the mechanism follows, and those that strain it."""
    stress = self_stress(rows, differential_kinematics(rows, FailureSet()))
    left, sigma, _ = np.linalg.svd(np.eye(len(stress)) - stress @ stress.T)
    return left[:, sigma > 0.5].T, stress.T


def channels(plant, settings):
    state, mechanism = plant.state, plant.mechanism
    scale, length = mechanism.rate_scale, mechanism.characteristic_length
    turned = np.array([state.pose[2, 1], state.pose[0, 2], state.pose[1, 0]])
    return np.concatenate([
        scale * state.measured_values, scale * state.efforts / settings.actuator_stiffness,
        length * turned, state.pose[:3, 3],
    ])


def shown(engine, mechanism, suspect, ways):
    """Return what all channels show of motions one by one, (k, c) in metres."""
    settings = PlantSettings(
        encoder_noise=0.0, disturbance=UNLOADED, command_timeout=1e3,
        encoders=mechanism.actuators[0].encoder,
    )
    plant = plant_named(engine, mechanism, settings)
    if suspect != HEALTHY:
        mode, name = str(suspect).split(':')
        broken(plant, f'silent {MODES[mode]} {name}')
    # A heavy platform swings and sinks when something lets go of it.
    plant.step(1.0)
    if mechanism.name == 'gough_stewart_8':
        plant.step(1.0)
    found = [channels(plant, settings)]
    for way in ways:
        plant.command(10.0 * SIZE * way / mechanism.rate_scale)
        plant.step(0.1)
        plant.command(0.0 * way)
        plant.step(0.4)
        found.append(channels(plant, settings))
    return np.diff(found, axis=0)


@cache
def recorded(engine, name, side):
    """Return what every hypothesis shows of all motions, and how many of them strain nothing.

    Of legs four to eight nothing is shown: they are as the first three.
    """
    mechanism = mechanism_named(name).with_encoders(side)
    followed, straining = motions(home_rows(mechanism))
    classes = isolability(home_rows(mechanism)).classes
    ways = [*followed, *straining]
    suspects = [one for group in classes for one in group if one.name[-1:] not in set('45678')]
    return {one: shown(engine, mechanism, one, ways) for one in suspects}, len(followed)


@pytest.mark.parametrize(('sensors', 'probe'), WAYS)
@pytest.mark.parametrize(('name', 'side'), [
    ('mirror_4_strut', 'load'), ('mirror_4_strut', 'motor'), ('gough_stewart_8', 'load'),
])
@pytest.mark.parametrize('engine', ENGINES)
def test_all_pairs(engine, name, side, sensors, probe):
    if engine == 'mujoco':
        pytest.importorskip('mujoco')
    mechanism = mechanism_named(name).with_encoders(side)
    found, followed = recorded(engine, name, side)
    count = len(mechanism.actuators)
    heard = np.repeat([True, sensors.efforts, sensors.pose], [count, count, 6])
    group = {
        one: place for place, alike in enumerate(isolability(
            home_rows(mechanism), sensors=sensors, probe=probe).classes) for one in alike
    }
    apart, alike = [], [0.0]
    for first, second in combinations(found, 2):
        off = (found[first] - found[second])[: None if probe else followed, heard]
        (alike if group[first] == group[second] else apart).append(float(np.linalg.norm(off)))
    assert min(apart) > 10.0 * PlantSettings().encoder_noise
    assert max(alike) < 0.01 * min(apart)
