# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Mirrors made by rule: what they are, and the measures that hold for every number of struts."""

from math import pi, sqrt

import numpy as np
import pytest
from core import cases
from core.mechanisms import even_mirror, made

from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.measures import next_failure
from fault_tolerance.mechanism.configuration import home_configuration
from fault_tolerance.mechanism.generators import evenly_spaced_mirror


@pytest.mark.parametrize('count', [3, 4, 5, 6, 8, 13, 100])
@pytest.mark.parametrize(('radius', 'length', 'turn'), [(1.0, 1.0, 0.0), (0.02, 0.3, 0.4)])
def test_measures_of_every_mirror(count, radius, length, turn):
    mirror = evenly_spaced_mirror(count, radius=radius, length=length, first_angle=turn)
    ahead = next_failure(cases.state(home_configuration(mirror)))
    np.testing.assert_allclose(ahead.position, 1.0 / sqrt(3.0), atol=1e-12)
    np.testing.assert_allclose(ahead.torque, sqrt((count - 3) / count), atol=1e-12)
    # Both are as good as any mechanism with so many drives and freedoms can be.
    assert ahead.position_bound == pytest.approx(1.0 / sqrt(3.0))
    assert ahead.torque_bound == pytest.approx(sqrt((count - 3) / count))


def test_the_generated_three_strut_mirror_is_the_papers():
    generated, shipped = evenly_spaced_mirror(3, compliance=0.0), cases.named('fsm_3_strut')
    first = cases.state(home_configuration(generated)).nominal
    second = cases.state(home_configuration(shipped)).nominal
    np.testing.assert_allclose(
        first.jacobian @ first.mapping.T, second.jacobian @ second.mapping.T, atol=1e-14
    )


def test_the_same_joints_as_the_document():
    generated, written = evenly_spaced_mirror(5, radius=0.3, length=2.0), made(
        even_mirror(5, 0.3, 2.0))
    for first, second in zip(generated.struts, written.struts, strict=True):
        for one, other in zip(first.joints, second.joints, strict=True):
            assert (one.name, one.kind) == (other.name, other.kind)
            np.testing.assert_allclose(one.screw, other.screw, atol=1e-15)


def test_limits_and_places():
    mirror = evenly_spaced_mirror(4, radius=0.5, first_angle=pi / 2, stroke=0.1, velocity=2.0)
    np.testing.assert_array_equal(mirror.position_limits, [[-0.1, 0.1]] * 4)
    np.testing.assert_array_equal(mirror.velocity_limits, [2.0] * 4)
    np.testing.assert_allclose(mirror.struts[0].joints[0].point, [0.0, 0.5, 0.0], atol=1e-16)
    assert mirror.characteristic_length == 0.5


@pytest.mark.parametrize('count', [2, 0, -1])
def test_too_few(count):
    with pytest.raises(MechanismError, match=f'mirror: count: {count} struts do not hold'):
        evenly_spaced_mirror(count)
