# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Where an estimate goes from the last one, and what it keeps of it."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from core.kernel.kernel_cases import modelled, values_at
from core.mechanisms import made, revolute

from fault_tolerance.control.estimate import estimate
from fault_tolerance.control.rate_command import initial_command, rate_command
from fault_tolerance.kernel.array_layout import estimate_of
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.catalogue import mechanism_named


def linkage():
    """Return a planar four-bar linkage with both cranks driven, and a small crank beside it.

    At home both driven cranks are open by 51.3 degrees, links 2, 1.5 and 2 long, 4 apart. With
    the first one where it is at home, the platform may also hang below the line between its
    joint there and the second pivot.
    """
    def strut(name, points, actuated):
        joints = [revolute(f'{name}_{place}', [0, 0, 1], [*point, 0], actuated=place < actuated)
                  for place, point in enumerate(points)]
        return {'name': name, 'joints': joints}

    y = np.sqrt(4.0 - 1.25**2)
    return made({
        'mechanism': 'linkage', 'task': {'coordinates': ['wz'], 'major': ['wz']},
        'platform': {'origin': [2.0, float(y), 0.0]}, 'characteristic_length': 1.0,
        'struts': [
            strut('a', [[0.0, 0.0], [1.25, float(y)]], 1),
            strut('b', [[4.0, 0.0], [2.75, float(y)]], 1),
            strut('c', [[2.0, float(y) + 0.2], [2.04, float(y) + 0.2], [2.0, float(y)]], 0),
        ],
    })


def beyond_the_dead_centre(model, failures):
    """Return an estimate with the first crank as at home, and the platform the other way up."""
    second = pi - np.arctan2(np.sqrt(4.0 - 1.25**2), 2.75)
    turned = 2.0 * (second - (pi - np.arccos(1.25 / 2.0)))
    wanted = second + turned / 2.0 - (pi - np.arccos(1.25 / 2.0))
    found = model.unknown
    for share in np.linspace(0.0, 1.0, 100):
        found = estimate(model, found, np.array([np.nan, share * wanted]), failures)
    return found


def test_a_lost_strut_that_swings_is_no_jump_to_another_assembly_mode():
    lost = FailureSet(free=('b_0',), lost=('c',))
    model = modelled(linkage(), best_kernel())
    found, swings = beyond_the_dead_centre(model, lost), 0
    for turn in np.linspace(0.0, -0.3, 31):
        after = estimate(model, found, np.array([turn, np.nan]), lost)
        swings += np.abs(after.arrays.values[2] - found.arrays.values[2]).max() > 0.3
        assert np.abs(after.actuator_values - found.actuator_values).max() < 0.02
        found = after
    assert swings > 20


def test_a_lost_strut_that_cannot_follow_keeps_no_loop_from_closing():
    lost = FailureSet(free=('b_0',), lost=('c',))
    model = modelled(linkage(), best_kernel())
    last = beyond_the_dead_centre(model, lost)
    numbers = last.numbers.copy()
    estimate_of(model.packed.view, numbers).closure_error[2] = np.inf
    found = estimate(model, replace(last, numbers=numbers), np.array([0.0, np.nan]), lost)
    assert found.hold_reason == ''
    np.testing.assert_allclose(found.pose, last.pose, rtol=0.0, atol=1e-9)


def test_readings_that_contradict_each_other_leave_the_strain_of_the_last_pose():
    mechanism = mechanism_named('mirror_4_strut')
    model = modelled(mechanism, best_kernel())
    values = values_at(mechanism, 0.05, np.random.default_rng(1))
    last = estimate(model, model.unknown, values, FailureSet())
    assert not last.hold_reason
    assert last.flexure_strain > 1e-6
    off = 0.5 * mechanism.characteristic_length / mechanism.rate_scale
    found = estimate(model, last, values + off * np.cos(np.arange(4) ** 2), FailureSet())
    assert 'contradict' in found.hold_reason
    np.testing.assert_array_equal(found.pose, last.pose)
    assert found.flexure_strain == last.flexure_strain


@pytest.mark.parametrize('value', [1e7, -2e6, np.inf])
def test_a_reading_too_large_to_be_true_is_no_reading(value):
    mechanism = mechanism_named('gough_stewart_8')
    model, count = modelled(mechanism, best_kernel()), len(mechanism.actuators)
    stuck = FailureSet(stuck=(mechanism.actuator_names[0],))
    values = np.full(count, 1e-3)
    results = []
    for first in (value, np.nan):
        values[0] = first
        found = estimate(model, model.unknown, values, stuck)
        asked = np.full(len(mechanism.task.coordinates), 1e-3)
        command = rate_command(model, found, asked, initial_command(model), 0.0)
        results.append((found.numbers, command.numbers))
    for one, other in zip(*results, strict=True):
        np.testing.assert_array_equal(one, other)
