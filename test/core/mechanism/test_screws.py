# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Exponentials, adjoints and pose differences against scipy and against each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from fault_tolerance.mechanism.screws import (
    cross,
    difference,
    displaced,
    exponential,
    joint_displacements,
    powers,
    rotation_vector,
    skew,
    transformed,
)

number = st.floats(-3.0, 3.0, allow_subnormal=False)
vectors = st.tuples(number, number, number).map(np.array)
twists = st.tuples(vectors, vectors).map(np.concatenate)
ANGLES = [0.0, 1e-300, 1e-12, 1e-6, 9.99e-4, 1.001e-3, 0.1, 1.0, np.pi - 1e-9, np.pi, 3.5, 20.0]


def hat(twist):
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = skew(twist[:3])
    matrix[:3, 3] = twist[3:]
    return matrix


@given(twists)
@settings(deadline=None)
def test_exponential_is_the_matrix_exponential(twist):
    np.testing.assert_allclose(exponential(twist), expm(hat(twist)), atol=1e-12)


@pytest.mark.parametrize('angle', ANGLES)
def test_exponential_at_every_size_of_angle(angle):
    twist = np.concatenate([angle * np.array([0.6, 0.0, -0.8]), [0.3, -2.0, 1.0]])
    pose = exponential(twist)
    np.testing.assert_allclose(pose, expm(hat(twist)), rtol=0.0, atol=3e-14 * (1.0 + angle))
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-14)


def test_exponential_of_a_small_angle_keeps_all_digits():
    for angle in (1e-9, 1e-5, 9.9e-4, 1.01e-3):
        pose = exponential(np.array([angle, 0.0, 0.0, 0.0, 0.0, 0.0]))
        assert pose[2, 1] == pytest.approx(np.sin(angle), rel=1e-15)


@pytest.mark.parametrize('value', [0.0, 1e-12, -1e-4, 0.1, -2.0, np.pi, 7.0])
@pytest.mark.parametrize('kind', ['revolute', 'prismatic', 'none'])
def test_joint_displacements_are_exponentials(kind, value):
    axis, point = np.array([0.6, 0.0, -0.8]), np.array([10.0, -20.0, 30.0])
    screw = {
        'revolute': np.concatenate([axis, np.cross(point, axis)]),
        'prismatic': np.concatenate([np.zeros(3), axis]),
        'none': np.zeros(6),  # what shorter struts are padded with
    }[kind]
    found = joint_displacements(powers(screw[None]), np.array([value]))[0]
    np.testing.assert_allclose(found, expm(hat(value * screw)), rtol=1e-13, atol=1e-13)


@given(twists, twists, vectors)
@settings(deadline=None)
def test_transformed_carries_a_twist_along(twist, moving, point):
    pose = exponential(moving)
    carried = pose @ hat(twist) @ np.linalg.inv(pose)
    found = transformed(pose, twist, np.zeros(3))
    np.testing.assert_allclose(hat(found), carried, atol=1e-11)
    # Elsewhere v is the velocity of the body point that is there.
    elsewhere = transformed(pose, twist, point)
    np.testing.assert_array_equal(elsewhere[:3], found[:3])
    velocity = (carried @ np.append(point, 1.0))[:3]
    np.testing.assert_allclose(elsewhere[3:], velocity, atol=1e-11)


@given(vectors, vectors)
@settings(deadline=None)
def test_cross_is_numpys(first, second):
    np.testing.assert_allclose(cross(first, second), np.cross(first, second), atol=1e-14)


@given(vectors)
@settings(deadline=None)
def test_rotation_vector_is_scipys(vector):
    rotation = Rotation.from_rotvec(vector)
    found = rotation_vector(rotation.as_matrix())
    assert np.linalg.norm(found) <= np.pi + 1e-12
    again = Rotation.from_rotvec(found)
    assert (again * rotation.inv()).magnitude() < 1e-12


@pytest.mark.parametrize('angle', [value for value in ANGLES if value <= np.pi])
@pytest.mark.parametrize('axis', [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0, -0.8), (1, 1, 1)])
def test_rotation_vector_up_to_half_a_turn(angle, axis):
    vector = angle * np.array(axis) / np.linalg.norm(axis)
    found = rotation_vector(Rotation.from_rotvec(vector).as_matrix())
    if angle == np.pi and found @ vector < 0.0:
        found = -found  # the same rotation
    np.testing.assert_allclose(found, vector, rtol=0.0, atol=2e-15 + 1e-14 * angle)


@given(twists, twists)
@settings(deadline=None)
def test_difference_and_displaced_are_inverse(first, second):
    start, goal = exponential(first), exponential(second)
    np.testing.assert_allclose(displaced(start, difference(goal, start)), goal, atol=1e-12)


def test_difference_is_the_twist_to_first_order():
    pose = exponential(np.array([0.3, -0.2, 0.5, 1.0, 2.0, -1.0]))
    twist = np.array([0.4, 0.1, -0.3, 0.2, -0.5, 0.6])  # v at the platform's origin
    about_base = np.concatenate([twist[:3], twist[3:] - np.cross(twist[:3], pose[:3, 3])])
    step = 1e-6
    moved = exponential(step * about_base) @ pose
    np.testing.assert_allclose(difference(moved, pose) / step, twist, atol=1e-6)


def test_batches_are_the_single_ones():
    rng = np.random.default_rng(1)
    several = rng.normal(size=(2, 3, 6))
    poses = exponential(several)
    point = np.array([1.0, 2.0, 3.0])
    carried = transformed(poses, several[::-1], point)
    vectors_ = rotation_vector(poses[..., :3, :3])
    for index in np.ndindex(2, 3):
        np.testing.assert_allclose(poses[index], exponential(several[index]), atol=1e-15)
        one = transformed(poses[index], several[::-1][index], point)
        np.testing.assert_allclose(carried[index], one, atol=1e-15)
        np.testing.assert_allclose(
            vectors_[index], rotation_vector(poses[index][:3, :3]), atol=1e-15
        )


def test_poses_stay_orthonormal():
    """However many displacements follow one another."""
    pose, rng = np.eye(4), np.random.default_rng(0)
    for _ in range(3000):
        pose = displaced(pose, 0.3 * rng.normal(size=6))
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-15)
    np.testing.assert_array_equal(pose[3], [0, 0, 0, 1])
