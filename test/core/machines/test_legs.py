# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Legs of every type against their inverse kinematics, written down as textbooks have them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.machines.assembly import assembled_legs, require_height
from fault_tolerance.machines.leg_types import LEG_TYPES, Leg, strut_of
from fault_tolerance.machines.presets import HexapodSize, hexapod_legs
from fault_tolerance.mechanism.parts import Actuator

STEP = 1e-5


def uneven(kind):
    """Return the legs of a hexapod (or tripod) whose points and axes have no symmetry."""
    rng = np.random.default_rng(LEG_TYPES.index(kind))
    legs = []
    for leg in hexapod_legs(kind, HexapodSize()):
        moved = {'base': leg.base + rng.uniform(-0.02, 0.02, 3),
                 'platform': leg.platform + rng.uniform(-0.02, 0.02, 3)}
        for key in ('slide', 'hinge'):
            if getattr(leg, key) is not None:
                moved[key] = getattr(leg, key) + rng.uniform(-0.1, 0.1, 3)
        if leg.knee is not None:
            moved['knee'] = leg.knee + rng.uniform(-0.01, 0.01, 3)
        legs.append(replace(leg, **moved))
    return legs


def drive_value(leg, point):
    """Return what a drive's joint value is when the last joint of its leg is at a point."""
    if leg.kind in ('UPS', 'SPS', 'RPS'):
        return np.linalg.norm(point - leg.base) - np.linalg.norm(leg.platform - leg.base)
    length = np.linalg.norm(leg.rod)
    if leg.kind in ('PUS', 'PSS', 'PRS'):
        # |to - s u| = length
        unit = leg.slide / np.linalg.norm(leg.slide)
        to, start = point - leg.base, leg.platform - leg.base
        along, half = unit @ to, np.sqrt((unit @ to)**2 - to @ to + length**2)
        return along - np.copysign(half, unit @ start)
    # |to - Rot(axis, angle) arm| = length, with a cos + b sin = c
    axis = leg.hinge / np.linalg.norm(leg.hinge)
    arm, to = leg.knee - leg.base, point - leg.base
    on_axis = axis * (axis @ arm)
    a, b = to @ (arm - on_axis), to @ np.cross(axis, arm)
    c = (to @ to + arm @ arm - length**2) / 2 - to @ on_axis
    middle, half = np.arctan2(b, a), np.arccos(c / np.hypot(a, b))
    return min((middle + half, middle - half), key=abs)


def values(mechanism, legs, pose):
    points = [pose[:3, :3] @ (leg.platform - mechanism.origin) + pose[:3, 3] for leg in legs]
    return np.array([drive_value(leg, point) for leg, point in zip(legs, points, strict=True)])


@pytest.mark.parametrize('away', [0.0, 1.0], ids=['home', 'away'])
@pytest.mark.parametrize('kind', LEG_TYPES)
def test_drives_follow_the_platform_as_inverse_kinematics_say(kind, away):
    legs = uneven(kind)
    mechanism = assembled_legs('machine', legs, np.array([0.01, -0.02, 0.3]))
    given = {name: away * 0.03 * (-1)**place / (1 + place % 3)
             for place, name in enumerate(mechanism.actuator_names)}
    post = after(mechanism, at=given)
    assert post.verdict.mobility == len(legs)
    assert post.verdict.stable
    pose = post.configuration.pose
    np.testing.assert_allclose(
        values(mechanism, legs, pose), post.configuration.actuator_values, atol=1e-9)
    for twist, rates in zip(post.present.twist_jacobian.T, post.mapping.T, strict=True):
        found = []
        for step in (STEP, -STEP):
            moved = pose.copy()
            moved[:3, :3] = Rotation.from_rotvec(step * twist[:3]).as_matrix() @ pose[:3, :3]
            moved[:3, 3] += step * twist[3:]
            found.append(values(mechanism, legs, moved))
        difference = (found[0] - found[1]) / (2 * STEP)
        np.testing.assert_allclose(difference, rates, atol=1e-6)


def leg(kind='RSS', **changes):
    given = {'base': np.zeros(3), 'platform': np.array([0.1, 0.0, 0.3]),
             'hinge': np.array([0.0, 1.0, 0.0]), 'knee': np.array([0.1, 0.0, 0.0])} | changes
    return Leg(kind, drive=Actuator('leg_1'), **given)


@pytest.mark.parametrize(('changes', 'message'), [
    ({'knee': np.array([0.1, 0.0, 0.3])}, 'leg_1: knee and platform points are the same'),
    ({'knee': np.zeros(3)}, 'hinge: its axis is along the crank, or the crank has no length'),
    ({'hinge': np.array([1.0, 0.0, 0.0])}, 'hinge: its axis is along the crank'),
    ({'hinge': np.zeros(3)}, 'hinge: is a direction of no length'),
    ({'hinge': None}, 'hinge: is missing for a leg of type RSS'),
    ({'kind': 'RPS', 'knee': None, 'hinge': np.array([1.0, 0.0, 3.0])}, 'is along the leg'),
    ({'kind': 'UPS', 'knee': None, 'platform': np.zeros(3)}, 'base and platform points are the'),
])
def test_what_makes_no_leg(changes, message):
    with pytest.raises(MechanismError, match=message):
        strut_of(leg(**changes), 1)


def test_an_upright_leg_has_two_axes_across_it():
    upright = leg('UPS', platform=np.array([0.0, 0.0, 0.3]), knee=None, hinge=None)
    first, second, slide, *_ = strut_of(upright, 1).joints
    np.testing.assert_allclose([first.axis @ slide.axis, second.axis @ slide.axis,
                                first.axis @ second.axis], 0.0, atol=1e-15)


def test_a_flat_machine_is_asked_for_its_height():
    legs = [replace(leg, platform=leg.platform * [1, 1, 0])
            for leg in hexapod_legs('UPS', HexapodSize())]
    with pytest.raises(MechanismError, match='lie in one plane.*--origin X,Y,Z --relative'):
        require_height(legs, 'flat.csv')
