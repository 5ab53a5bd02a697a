# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The controller's geometry against MuJoCo's, for every shipped mechanism.

MuJoCo places the bodies and linearises the closures; nothing of the package's kinematics goes in
but what is being checked.
"""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
import pytest
from plant_cases import MECHANISMS, UNLOADED, driven

from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.mechanism.catalogue import shipped_names
from fault_tolerance.mechanism.configuration import fitted_configuration, home_configuration
from fault_tolerance.mechanism.screws import rotation_vector
from fault_tolerance.simulation.mjcf import PLATFORM, Masses, ball_of, mjcf_text
from fault_tolerance.simulation.mujoco import MujocoPlant
from fault_tolerance.simulation.plant_settings import PlantSettings

EQUALITY = mujoco.mjtConstraint.mjCNSTR_EQUALITY
# Rates that take the platform some way from home within this time, seconds.
LONG = 0.25
SHIPPED = [name for name in MECHANISMS if name in shipped_names()]


@cache
def model_of(name):
    return mujoco.MjModel.from_xml_string(mjcf_text(MECHANISMS[name]))


def away_from_home(name):
    """Return a configuration with the platform a tenth of its size (or of the stroke) off."""
    mechanism = MECHANISMS[name]
    mapping = differential_kinematics(home_rows(mechanism)).mapping
    values = mapping @ np.linspace(1.0, -0.7, mapping.shape[1])
    room = np.minimum(np.abs(mechanism.position_limits).min(axis=1), 0.1)
    configuration = fitted_configuration(
        mechanism, values * 0.6 * float((room / np.maximum(np.abs(values), 1e-9)).min()))
    assert configuration.converged
    return configuration


def placed(configuration, pose=None):
    """Return MuJoCo's data with all its joints, and the platform, as in the configuration."""
    mechanism = configuration.mechanism
    model = model_of(mechanism.name)
    data = mujoco.MjData(model)
    for i, strut in enumerate(mechanism.struts):
        ball = len(ball_of(strut, mechanism.characteristic_length))
        for j, joint in enumerate(strut.joints[:len(strut.joints) - ball]):
            data.joint(joint.name).qpos[0] = configuration.joint_values[i, j]
    pose = configuration.pose if pose is None else pose
    data.joint(PLATFORM).qpos[:3] = pose[:3, 3]
    mujoco.mju_mat2Quat(data.joint(PLATFORM).qpos[3:], pose[:3, :3].flatten())
    mujoco.mj_forward(model, data)
    return model, data


def left_open(data):
    """Return the largest gap in a closure, metres or radians."""
    return float(np.abs(data.efc_pos[data.efc_type == EQUALITY]).max())


def weightless(mechanism):
    settings = PlantSettings(encoder_noise=0.0, disturbance=UNLOADED, unlimited_rate=100.0)
    return MujocoPlant(mechanism, settings, masses=Masses(gravity=(0.0, 0.0, 0.0)))


def gone(plant, way):
    """Let the drives go ``way`` (N,) and come to rest; return where the kinematics see it."""
    limits = plant.mechanism.velocity_limits
    duration = float(max(LONG, 1.1 * (np.abs(way) / limits).max()))
    count = max(1, round(duration / 0.01))
    driven(plant, way / (0.01 * count), 0.01 * count, 0.01)
    driven(plant, np.zeros(len(way)), 0.5, 0.02)
    return fitted_configuration(plant.mechanism, plant.state.values)


CONFIGURATIONS = {
    'home': lambda name: home_configuration(MECHANISMS[name]),
    'away': away_from_home,
}


@pytest.mark.parametrize('where', CONFIGURATIONS)
@pytest.mark.parametrize('name', MECHANISMS)
def test_forward_kinematics_close_the_loops_of_mujoco(name, where):
    configuration = CONFIGURATIONS[where](name)
    _, data = placed(configuration)
    # The four-strut mirrors' flexures take up what their hinges bar twice.
    assert left_open(data) <= 1e-9 + configuration.flexure_strain
    length = configuration.mechanism.characteristic_length
    shift = 1e-5 * length + 10.0 * configuration.flexure_strain
    wrong = configuration.pose.copy()
    wrong[:3, 3] += shift
    _, data = placed(configuration, wrong)
    assert left_open(data) > 0.5 * shift


@pytest.mark.parametrize('where', CONFIGURATIONS)
@pytest.mark.parametrize('name', MECHANISMS)
def test_the_jacobian_is_that_of_the_closures_of_mujoco(name, where):
    configuration = CONFIGURATIONS[where](name)
    mechanism = configuration.mechanism
    kinematics = differential_kinematics(strut_rows(configuration))
    model, data = placed(configuration)
    rows = data.efc_J.reshape(-1, model.nv)[data.efc_type == EQUALITY]
    # Rotations as lengths, or small entries would count for nothing.
    scale = np.ones(model.nv)
    scale[model.joint(PLATFORM).dofadr[0] + 3:][:3] /= mechanism.characteristic_length
    *_, directions = np.linalg.svd(rows * scale)
    motions = scale[:, None] * directions[-kinematics.mobility:].T
    start = model.joint(PLATFORM).dofadr[0]
    # MuJoCo gives the rotation of a free body in its own axes.
    platform = np.vstack([
        configuration.pose[:3, :3] @ motions[start + 3:start + 6], motions[start:start + 3]])
    drives = motions[[model.joint(one.joint).dofadr[0] for one in mechanism.actuators]]
    found = platform @ np.linalg.pinv(drives)
    expected = kinematics.twist_jacobian @ kinematics.mapping.T
    metric = np.repeat([mechanism.characteristic_length, 1.0], 3)[:, None]
    error = np.abs(metric * (found - expected)).max() / np.abs(metric * expected).max()
    # What the flexures absorb is strictly a constraint in MuJoCo's rows.
    assert error < (1e-8 if where == 'home' or mechanism.compliance == 0.0 else 2e-2)


@pytest.mark.parametrize('name', SHIPPED)
def test_mujoco_moves_where_the_kinematics_say(name):
    mechanism = MECHANISMS[name]
    length = mechanism.characteristic_length
    wanted = away_from_home(name).actuator_values
    plant = weightless(mechanism)
    reached = gone(plant, wanted)
    state = plant.state
    assert np.abs(state.values - wanted).max() < 0.03 * np.abs(wanted).max()
    assert np.abs(reached.pose[:3, :3] - state.pose[:3, :3]).max() < 1e-5
    assert np.abs(reached.pose[:3, 3] - state.pose[:3, 3]).max() < 1e-5 * length

    # From rest to rest: the mean velocity is that of half-way, but for the third order.
    kinematics = differential_kinematics(strut_rows(reached))
    # Whatever the choice of columns of T.
    asked = np.linspace(1.0, 0.5, len(mechanism.actuators)) * 1e-3 * length
    gone(plant, kinematics.mapping @ (kinematics.mapping.T @ asked))
    after = plant.state
    half_way = fitted_configuration(mechanism, 0.5 * (state.values + after.values))
    kinematics = differential_kinematics(strut_rows(half_way))
    expected = kinematics.twist_jacobian @ (kinematics.mapping.T @ (after.values - state.values))
    turned = rotation_vector(after.pose[:3, :3] @ state.pose[:3, :3].T)
    moved = np.concatenate([turned, after.pose[:3, 3] - state.pose[:3, 3]])
    metric = np.repeat([length, 1.0], 3)
    assert np.linalg.norm(metric * (moved - expected)) < 2e-3 * np.linalg.norm(metric * expected)
