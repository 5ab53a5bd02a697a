# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Loops closed from task coordinates: the twin of actuator values, and exact."""

import numpy as np
import pytest
from core import cases
from core.mechanisms import by_numbers, made
from scipy.spatial.transform import Rotation

from fault_tolerance.errors import ClosureError, MechanismError
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import shipped_names
from fault_tolerance.mechanism.configuration import posed_configuration, solved_configuration
from fault_tolerance.mechanism.screws import rotation_vector_rates
from fault_tolerance.mechanism.task import COORDINATES


def displacement(configuration):
    """Return rotation vector and displacement of the origin from home, by other code."""
    turn = Rotation.from_matrix(configuration.pose[:3, :3].copy()).as_rotvec()
    return np.concatenate([turn, configuration.pose[:3, 3] - configuration.mechanism.origin])


def metres(mechanism, name):
    return mechanism.characteristic_length if name.startswith('w') else 1.0


def major_pose(mechanism, size):
    """Return values of the major coordinates, ``size`` characteristic lengths from home."""
    rng = np.random.default_rng(3)
    length = mechanism.characteristic_length
    return {
        name: size * length * float(rng.uniform(-1.0, 1.0)) / metres(mechanism, name)
        for name in mechanism.task.major
    }


@pytest.mark.parametrize('size', [1e-4, 0.03, 0.2])
@pytest.mark.parametrize('name', shipped_names())
def test_the_platform_is_where_it_was_asked_for(name, size):
    mechanism = cases.named(name)
    # Flexures give way so far, and no farther.
    given = major_pose(mechanism, min(size, 0.03) if mechanism.compliance else size)
    found = posed_configuration(mechanism, given)
    assert found.closure_residual <= 1e-9
    reached = dict(zip(COORDINATES, displacement(found), strict=True))
    for coordinate, value in given.items():
        assert reached[coordinate] == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize('name', shipped_names())
def test_there_and_back_by_actuator_values(name):
    mechanism = cases.named(name)
    posed = posed_configuration(mechanism, major_pose(mechanism, 0.03))
    values = dict(zip(mechanism.actuator_names, posed.actuator_values, strict=True))
    solved = solved_configuration(mechanism, values)
    np.testing.assert_allclose(solved.pose, posed.pose, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(solved.joint_values, posed.joint_values, rtol=0.0, atol=1e-7)
    again = dict(zip(COORDINATES, displacement(solved), strict=True))
    task = {coordinate: again[coordinate] for coordinate in mechanism.task.coordinates}
    back = posed_configuration(mechanism, task)
    np.testing.assert_allclose(back.actuator_values, posed.actuator_values, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize('name', shipped_names())
def test_its_derivative_is_the_jacobian(name):
    """J T^+ times how the actuators move is how the platform moves, by central differences."""
    mechanism = cases.named(name)
    task, given = mechanism.task, major_pose(mechanism, 0.02)
    post = after(mechanism, pose=given)
    step = 1e-5 * mechanism.characteristic_length
    for coordinate in task.major:
        ends = []
        for sign in (-1.0, 1.0):
            moved = {**given, coordinate: given[coordinate] + sign * step}
            ends.append(posed_configuration(mechanism, moved))
        before, behind = ends
        rates = (behind.actuator_values - before.actuator_values) / (2.0 * step)
        turn = Rotation.from_matrix(behind.pose[:3, :3] @ before.pose[:3, :3].T).as_rotvec()
        shift = behind.pose[:3, 3] - before.pose[:3, 3]
        twist = np.concatenate([turn, shift])[task.rows] / (2.0 * step)
        found = post.jacobian @ np.linalg.lstsq(post.mapping, rates, rcond=None)[0]
        # What flexures absorb changes direction on the way, and is not in J.
        atol = 1e-3 if mechanism.compliance else 1e-6
        np.testing.assert_allclose(found, twist, rtol=0.0, atol=atol)


@pytest.mark.parametrize('vector', [[1e-4, -2e-4, 3e-5], [0.3, -0.2, 0.5], [1.5, 2.0, -1.0]])
def test_rates_of_a_rotation_vector(vector):
    vector, step = np.array(vector), 1e-6
    for axis in np.eye(3):
        ends = [
            (Rotation.from_rotvec(sign * step * axis) * Rotation.from_rotvec(vector)).as_rotvec()
            for sign in (-1.0, 1.0)
        ]
        expected = (ends[1] - ends[0]) / (2.0 * step)
        np.testing.assert_allclose(rotation_vector_rates(vector) @ axis, expected, atol=1e-9)


def test_coordinates_left_out_stay_at_home():
    mechanism = cases.named('gough_stewart_8')
    found = displacement(posed_configuration(mechanism, {'wx': 0.1, 'vz': 0.02}))
    np.testing.assert_allclose(found, [0.1, 0.0, 0.0, 0.0, 0.0, 0.02], rtol=0.0, atol=1e-9)


def test_nothing_given_is_home():
    for name in shipped_names():
        found = posed_configuration(cases.named(name), {})
        assert not found.actuator_values.any()


def test_the_freedom_of_a_redundant_arm_is_spent_near_home():
    """No self-motion, at the same place, makes the actuator values smaller."""
    mechanism = cases.named('serial_7r')
    post = after(mechanism, pose={'vx': 0.05, 'wy': -0.1})
    values, present = post.configuration.actuator_values, post.present
    _, sigma, right = np.linalg.svd(present.jacobian)
    idle = present.mapping @ right[int((sigma > 1e-9).sum()):].T
    assert idle.shape[1] >= 1
    np.testing.assert_allclose(idle.T @ values, 0.0, atol=1e-6)


def test_a_lost_strut_bars_nothing():
    mechanism = cases.named('gough_stewart_8')
    found = posed_configuration(mechanism, {'vz': 0.05}, lost=['strut_2'])
    assert displacement(found)[5] == pytest.approx(0.05, abs=1e-12)
    assert found.closure_residual <= 1e-9


def test_a_pose_beyond_a_singularity_is_out_of_reach():
    """The cranks of the hexapod reach a singularity on the way."""
    mechanism = cases.named('rooted_hexapod')
    with pytest.raises(ClosureError, match='out of reach'):
        posed_configuration(mechanism, major_pose(mechanism, 0.5))


@pytest.mark.parametrize(('name', 'given', 'reason'), [
    ('serial_3r', {'vx': 50.0}, 'the pose is out of reach: the loops do not close: residual'),
    ('fsm_4_strut', {'wx': 0.5, 'wy': 0.5}, 'the pose is out of reach: the platform misses it'),
    ('planar_4rpr', {'wz': 3.5}, 'a rotation by 3.5 rad'),
    ('fsm_4_strut', {'vx': 0.1}, "'vx' is not a task coordinate; valid: wx, wy, vz"),
    ('fsm_4_strut', {'roll': 0.1}, "'roll' is not a task coordinate"),
    ('fsm_4_strut', {'wx': float('nan')}, 'pose.wx: nan is not finite'),
    ('fsm_4_strut', {'vz': 1e7}, 'farther than any joint goes'),
])
def test_what_cannot_be(name, given, reason):
    with pytest.raises((ClosureError, MechanismError), match=reason):
        posed_configuration(cases.named(name), given)


def test_given_by_its_jacobian_there_is_no_other_pose():
    mechanism = made(by_numbers())
    assert posed_configuration(mechanism, {}).converged
    with pytest.raises(MechanismError, match='no configuration but its working point'):
        posed_configuration(mechanism, {mechanism.task.coordinates[0]: 0.1})
