# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Many poses at a time are what the definition says of each of them."""

from dataclasses import fields

import numpy as np
import pytest
from core.mechanisms import ALL, made, prismatic, revolute, spherical, universal

from fault_tolerance.design.legs import CRANK, LEG, SLIDE, legs_of
from fault_tolerance.design.pose_measures import PoseMeasures, measured, pose_measures
from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_named

BENT = [[1, 0.2, 0.1], [0.3, 1, -0.2]]


def platform(kind: str, count: int = 8, seed: int = 3):
    """Return a platform without symmetry on ``count`` struts of one kind, such as ``PUS``."""
    rng = np.random.default_rng(seed)
    struts = []
    for i in range(count):
        angle = 2 * np.pi * i / count
        lower = np.array([np.cos(angle), np.sin(angle), 0.0]) * (1 + 0.2 * rng.random())
        turn = angle + (0.4 if i % 2 else -0.4)
        upper = np.array([0.6 * np.cos(turn), 0.6 * np.sin(turn), 0.9 + 0.1 * rng.random()])
        drive = {'actuated': True, 'position': [-0.5, 0.5]}
        joints = []
        for place, letter in enumerate(kind):
            name, point = f'{letter.lower()}{place}_{i}', lower if place < 2 else upper
            if letter == 'S':
                joints.append(spherical(name, lower if place == 0 else point))
            elif letter == 'U':
                joints.append(universal(name, BENT, point))
            elif letter == 'P':
                along = upper - lower if place else [0, 0, 1]
                # A leg need not point from one ball to the other.
                joints.append(prismatic(name, along + 0.1 * rng.normal(size=3), **drive))
            else:
                around = [-np.sin(angle), np.cos(angle), 0.1]
                pivot = lower * [0.8, 0.8, 1] + [0, 0, 0.02]
                joints.append(revolute(name, around, pivot, **drive))
        struts.append({'name': f'strut_{i}', 'joints': joints})
    return made({
        'mechanism': kind, 'platform': {'origin': [0.1, -0.05, 0.8]},
        'task': {'coordinates': ['vz', 'vx', 'vy', 'wy', 'wx', 'wz'], 'major': ALL[:4]},
        'characteristic_length': 0.6, 'struts': struts,
    })


def assert_as_defined(mechanism, failures, poses, scale=1.0):
    names, failed = mechanism.task.coordinates, failure_set(mechanism, failures)
    found = pose_measures(mechanism, names, poses, failed)
    for place, row in enumerate(poses):
        pose = dict(zip(names, map(float, row), strict=True))
        wanted = measured(after(mechanism, failed, pose=pose))
        for one in fields(PoseMeasures):
            np.testing.assert_allclose(
                getattr(found, one.name)[place], getattr(wanted, one.name)[0],
                rtol=1e-9, atol=1e-9 * scale, err_msg=f'{one.name} at {pose}',
            )


@pytest.mark.parametrize('kind', ['UPS', 'SPS', 'SPU', 'PUS', 'PSS', 'RUS', 'RSS'])
def test_struts_of_one_force_are_as_defined(kind):
    mechanism = platform(kind)
    first = {'P': SLIDE, 'R': CRANK}.get(kind[0], LEG)
    assert set(legs_of(mechanism).kind) == {first}
    poses = np.random.default_rng(5).uniform(-0.1, 0.1, (6, 6))
    assert_as_defined(mechanism, [], poses)


@pytest.mark.parametrize('failures', [
    ['free:p1_2'], ['lost:strut_5'], ['stuck:p1_0'], ['free:p1_2', 'lost:strut_5'],
    ['free:p1_2', 'lost:strut_5', 'free:p1_0'], ['stuck:p1_1', 'stuck:p1_3', 'stuck:p1_6'],
])
def test_failures_present_are_as_defined(failures):
    poses = np.random.default_rng(6).uniform(-0.1, 0.1, (3, 6))
    assert_as_defined(platform('UPS'), failures, poses)


def test_next_to_a_singularity_it_is_the_definition():
    """With legs 1 and 3 free, home of this platform is on a surface where t is 0."""
    mechanism = mechanism_named('gough_stewart_8')
    poses = np.zeros((4, 6))
    poses[1:, 3] = 1e-9, 1e-6, 1e-3
    assert_as_defined(mechanism, ['free:leg_1', 'free:leg_3'], poses)


@pytest.mark.parametrize('name', ['mirror_4_strut', 'mirror_overactuated', 'serial_3r'])
def test_other_mechanisms_are_as_defined(name):
    mechanism = mechanism_named(name)
    size = [0.01 * mechanism.characteristic_length if one[0] == 'v' else 0.01
            for one in mechanism.task.coordinates]
    poses = np.random.default_rng(7).uniform(-1, 1, (3, len(size))) * size
    assert legs_of(mechanism) is None
    assert_as_defined(mechanism, [], poses)


def test_coordinates_left_out_are_at_home():
    mechanism = mechanism_named('gough_stewart_8')
    few = pose_measures(mechanism, ['vz', 'wx'], np.array([[0.02, 0.1]]))
    every = pose_measures(mechanism, ALL, np.array([[0.1, 0, 0, 0, 0, 0.02]]))
    np.testing.assert_array_equal(few.torque, every.torque)


def test_out_of_reach_is_no_number():
    mechanism = platform('PUS')
    found = pose_measures(mechanism, ['vx'], np.array([[0.0], [50.0]]))
    assert found.reachable.tolist() == [True, False]
    assert np.isnan(found.torque[1]).all() and not found.tolerable[1]


def test_beyond_a_stroke_is_measured_but_not_reachable():
    mechanism = mechanism_named('gough_stewart_8')
    found = pose_measures(mechanism, ['vz'], np.array([[0.09], [0.15]]))
    assert found.reachable.tolist() == [True, False]
    assert found.tolerable.all()


def test_an_unknown_coordinate_is_named():
    with pytest.raises(MechanismError, match=r"'wz' is not a task coordinate; valid: wx, wy, vz"):
        pose_measures(mechanism_named('mirror_4_strut'), ['wz'], np.zeros((1, 1)))
