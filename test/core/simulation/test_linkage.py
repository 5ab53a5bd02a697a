# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The simulated struts against the controller's geometry and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from plant_cases import BY_NUMBERS, MECHANISMS

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.chains import chains_of, forward_kinematics
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.mechanism.screws import displaced, transformed
from fault_tolerance.simulation.elastic import attached_values
from fault_tolerance.simulation.linkage import Linkage


def some_values(linkage, size, seed=0):
    rng = np.random.default_rng(seed)
    scale = np.where(linkage.turning, 1.0, linkage.length)
    return size * scale * rng.uniform(-1.0, 1.0, linkage.real.shape) * linkage.real


@pytest.mark.parametrize('name', MECHANISMS)
def test_two_independent_forward_kinematics_agree(name):
    mechanism = MECHANISMS[name]
    linkage = Linkage(mechanism)
    for seed in range(5):
        values = some_values(linkage, 1.0, seed)
        placement = linkage.placement(values)
        screws, tips = forward_kinematics(chains_of(mechanism), values)
        assert np.allclose(placement.rotations, tips[:, :3, :3], atol=1e-12)
        assert np.allclose(placement.origins, tips[:, :3, 3], atol=1e-12)
        twists = np.stack([
            transformed(np.eye(4), screws[i], tips[i, :3, 3]) for i in range(len(tips))])
        twists[..., :3] *= mechanism.characteristic_length
        assert np.allclose(np.swapaxes(placement.motions, 1, 2), twists, atol=1e-12)


@pytest.mark.parametrize('name', MECHANISMS)
def test_motions_are_the_derivative_of_the_gaps(name):
    mechanism = MECHANISMS[name]
    linkage = Linkage(mechanism)
    values = some_values(linkage, 0.5)
    placement = linkage.placement(values)
    for strut in range(len(mechanism.struts)):
        pose = np.eye(4)
        pose[:3, :3] = placement.rotations[strut]
        pose[:3, 3] = placement.origins[strut]
        for joint in range(len(mechanism.struts[strut].joints)):
            step = np.zeros(values.shape)
            step[strut, joint] = 1e-6
            ahead = linkage.gaps(linkage.placement(values + step), pose)[strut]
            behind = linkage.gaps(linkage.placement(values - step), pose)[strut]
            expected = placement.motions[strut, :, joint]
            assert np.allclose((ahead - behind) / 2e-6, expected, atol=1e-8)


@pytest.mark.parametrize('name', MECHANISMS)
def test_struts_meet_the_platform_at_home_and_miss_it_elsewhere(name):
    mechanism = MECHANISMS[name]
    linkage = Linkage(mechanism)
    placement = linkage.placement(np.zeros(linkage.real.shape))
    pose = np.eye(4)
    pose[:3, 3] = mechanism.origin
    assert np.abs(linkage.gaps(placement, pose)).max() < 1e-15
    shift = np.array([1e-6, 2e-6, 3e-6, 4e-6, 5e-6, 6e-6])
    gaps = linkage.gaps(placement, displaced(pose, -shift))
    metric = np.repeat([mechanism.characteristic_length, 1.0], 3)
    assert np.allclose(gaps, metric * shift, atol=1e-11)


def test_a_strut_is_brought_to_the_platform_with_its_movable_joints_only():
    mechanism = MECHANISMS['two_stages']
    linkage = Linkage(mechanism)
    pose = displaced(
        np.block([[np.eye(3), mechanism.origin[:, None]], [np.zeros(3), 1.0]]),
        np.array([0.02, 0.01, 0.0, 0.0, 0.0, 0.01]),
    )
    movable = np.ones(6)
    movable[1] = 0.0
    found = attached_values(linkage, 1, movable, pose, np.zeros((3, 6)))
    assert found[1, 1] == 0.0
    assert abs(found[1, 2]) > 1e-3
    assert (found[[0, 2]] == 0.0).all()
    gap = linkage.gaps(linkage.placement(found), pose)[1]
    # Five joints cannot close six directions; what is left is across the hinge.
    assert np.linalg.norm(gap) < 1e-3
    assert np.abs(linkage.placement(found).motions[1].T @ gap)[movable > 0.0].max() < 1e-12


def test_a_mechanism_given_by_numbers_is_refused():
    with pytest.raises(MechanismError, match='numbers: struts: .*cannot be simulated'):
        Linkage(mechanism_from_text(BY_NUMBERS))
