# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Limits: kept by slowing down, secondary motion first, never by leaving the range of T."""

import numpy as np
import pytest
from core.control.control_cases import modelled
from core.mechanisms import hexapod, made
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fault_tolerance.control.estimate import estimate
from fault_tolerance.control.rate_command import initial_command, rate_command
from fault_tolerance.kernel.law import (
    actuator_rates,
    asked_velocity,
    limited,
    prioritised,
    rate_bounds,
)
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.tolerances import LARGEST_RATE

FSM = mechanism_named('fsm_4_strut')
NAMES = FSM.actuator_names
MODEL = modelled(FSM)
DRIVES = MODEL.packed.view.actuators.scale


class Limited:
    """A task velocity of the mirror at home, within bounds ``low`` and ``high`` (N,)."""

    def __init__(self, asked, low, high, failures=(), scale=1.0):
        found = estimate(MODEL, MODEL.unknown, np.zeros(4), failure_set(FSM, failures)).arrays
        self.mapping = found.driving[:, None] * found.follow
        self.jacobian = found.jacobian
        task, law = MODEL.packed.view.task, MODEL.packed.view.law
        work = MODEL.packed.work
        work[0] = 1.0
        wanted = asked_velocity(task, np.array(asked, float), np.empty(len(asked)))
        whole = prioritised(
            work, task, found.motions, wanted, law.singular_below)
        low, high = (np.broadcast_to(np.asarray(one, float), (4,)) for one in (low, high))
        saturated = np.empty(4)
        self.scale, self.share = limited(
            work, DRIVES, found.motions, whole.first, whole.second, scale, -low, high, saturated)
        self.saturation = tuple(
            name for name, over in zip(NAMES, saturated, strict=True) if over)
        self.whole = whole.first + whole.second
        self.reduced = self.scale * (whole.first + self.share * whole.second)
        self.rates = actuator_rates(DRIVES, found.motions, self.reduced, 1.0, np.empty(4))
        self.whole_rates = actuator_rates(DRIVES, found.motions, self.whole, 1.0, np.empty(4))
        scale = MODEL.packed.view.task.scale
        self.achieved = (found.jacobian @ self.reduced / scale)[task.rows]
        self.whole_achieved = (found.jacobian @ self.whole / scale)[task.rows]


def test_a_command_within_bounds_is_left_alone():
    found = Limited([0.01, 0.02, 0.03], 1.0, 1.0)

    np.testing.assert_array_equal(found.reduced, found.whole)
    assert (found.scale, found.share, found.saturation) == (1.0, 1.0, ())


def test_the_secondary_motion_gives_way_first():
    # theta_1 = (wx + vz / ...) : 0.5 of major and 1.0 of secondary rate, at most 0.8 together.
    found = Limited([0.5 * np.sqrt(2.0), 0.0, 1.0], 0.8, 0.8)

    assert found.scale == pytest.approx(1.0)
    assert found.share == pytest.approx(0.3)
    assert found.saturation == ('theta_1', 'theta_2', 'theta_4')
    np.testing.assert_allclose(found.rates, [0.8, 0.3, -0.2, 0.3], atol=1e-12)


def test_then_everything_slows_down_by_one_factor():
    found = Limited([np.sqrt(2.0), 0.5, 1.0], 0.25, 0.25)

    assert found.share == 0.0
    assert found.scale == pytest.approx(0.25)
    np.testing.assert_allclose(found.achieved, [0.25 * np.sqrt(2), 0.125, 0], atol=1e-12)


def test_one_slow_actuator_slows_all_and_is_the_only_one_named():
    slow = [9.0, 9.0, 0.1, 9.0]
    found = Limited([1.0, 1.0, 0.0], slow, slow)

    assert found.saturation == ('theta_3',)
    np.testing.assert_allclose(np.abs(found.rates), 0.1, atol=1e-12)


def test_a_stuck_actuator_never_binds():
    bounds = [1.0, 1.0, 1.0, 0.0]
    found = Limited([0.3, 0.4, 0.0], bounds, bounds, [('position', 'theta_4')])

    assert (found.scale, found.share, found.saturation) == (1.0, 1.0, ())


def test_rounding_at_the_end_of_a_stroke_does_not_stop_everything():
    bounds = np.array([1.0, 0.0, 1.0, 0.0])
    major, noise = np.array([1.0, 1e-16, -1.0, 0.0]), np.array([0.0, 1e-17, 0.0, -1e-17])
    motions = np.hstack([np.zeros((4, 6)), np.eye(4)])
    work = MODEL.packed.work
    work[0] = 1.0
    saturated = np.empty(4)
    scale, _ = limited(
        work, np.ones(4), motions, major, noise, 1.0, -bounds, bounds, saturated)

    assert scale == 1.0
    assert not saturated.any()


def test_an_initial_scale_is_part_of_the_result():
    found = Limited([1.0, 0.0, 0.0], 9.0, 9.0, scale=0.25)

    assert found.scale == 0.25
    np.testing.assert_allclose(found.achieved, [0.25, 0.0, 0.0], atol=1e-15)
    assert not Limited([1.0, 0.0, 0.0], 9.0, 9.0, scale=0.0).rates.any()


@pytest.mark.parametrize('size', [1e20, 1e300, 1.7e308])
def test_a_huge_velocity_keeps_its_direction(size):
    """Of a platform whose drives have no limits: they have one all the same."""
    mechanism = made(hexapod())
    model = modelled(mechanism)
    found = estimate(model, model.unknown, np.zeros(6), failure_set(mechanism, []))
    asked = size * np.array([0, 0, 0, 1.0, 1.0, 0.5])
    command = rate_command(model, found, asked, initial_command(model), 0.0)

    assert np.abs(command.rates).max() == pytest.approx(LARGEST_RATE)
    np.testing.assert_allclose(command.twist[3:] / command.twist[3], [1.0, 1.0, 0.5], atol=1e-9)
    assert command.saturated(mechanism.actuator_names) == mechanism.actuator_names


RATES = st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3)
LIMITS = st.lists(st.floats(0.0, 5.0), min_size=4, max_size=4)
FAILURES = st.sampled_from(
    [(), (('position', 'theta_1'),), (('torque', 'theta_2'),), (('hard', 'strut_3'),)]
)


@settings(deadline=None, max_examples=150)
@given(RATES, LIMITS, LIMITS, FAILURES)
def test_bounds_are_kept_within_the_range_of_the_mapping(asked, low, high, failures):
    found = Limited(asked, low, high, failures)

    size = max(1.0, np.abs(found.whole_rates).max())
    assert (found.rates <= np.array(high) + 1e-9 * size).all()
    assert (found.rates >= -np.array(low) - 1e-9 * size).all()
    driving = np.abs(found.mapping).max(axis=1) > 0.0
    active = (DRIVES * found.rates)[driving]
    inside = found.mapping[driving] @ (found.mapping[driving].T @ active)
    np.testing.assert_allclose(active, inside, atol=1e-12 * size)
    np.testing.assert_allclose(
        found.achieved[:2], found.scale * found.whole_achieved[:2], atol=1e-12 * size
    )
    assert 0.0 <= found.scale <= 1.0
    assert 0.0 <= found.share <= 1.0
    # The major task is slowed down only when the secondary motion is gone already.
    assert found.scale == 1.0 or found.share == 0.0
    assert bool(found.saturation) or (found.scale, found.share) == (1.0, 1.0)


@settings(deadline=None, max_examples=60)
@given(RATES, st.floats(0.01, 5.0))
def test_no_more_is_given_up_than_need_be(asked, limit):
    assume(np.abs(asked[:2]).max() > 1e-3)
    found = Limited(asked, limit, limit)

    if found.saturation:
        assert np.abs(found.rates).max() == pytest.approx(limit, rel=1e-9)


def bounds_of(mechanism, values, gain):
    lower, upper = np.empty(len(values)), np.empty(len(values))
    drives = modelled(mechanism).packed.view.actuators
    rate_bounds(drives, gain, np.asarray(values, float), lower, upper)
    return lower, upper


def test_speed_falls_off_towards_the_ends_of_the_stroke():
    mechanism = mechanism_named('mirror_4_strut')
    low, high = mechanism.position_limits[0]
    speed = mechanism.velocity_limits[0]
    values = np.array([high - 1e-5, low + 1e-5, high + 1e-5, 0.0])
    lower, upper = bounds_of(mechanism, values, 10.0)

    np.testing.assert_allclose(upper, [1e-4, 10 * (high - values[1]), 0.0, 10 * high])
    np.testing.assert_allclose(lower[:2], [10 * (low - values[0]), -1e-4])
    assert (lower <= 0.0).all()
    assert (upper >= 0.0).all()
    lower, upper = bounds_of(mechanism, np.zeros(4), 1e9)
    np.testing.assert_allclose(upper, speed)
    np.testing.assert_allclose(lower, -speed)


def test_without_a_reading_only_the_rate_limit_holds():
    mechanism = mechanism_named('mirror_4_strut')
    lower, upper = bounds_of(mechanism, [np.nan, 0.0, 0.0, 0.0], 10.0)

    assert upper[0] == mechanism.velocity_limits[0]
    assert lower[0] == -mechanism.velocity_limits[0]


def test_an_actuator_without_limits_is_still_bounded():
    lower, upper = bounds_of(made(hexapod()), np.zeros(6), 10.0)

    np.testing.assert_array_equal(upper, LARGEST_RATE)
    np.testing.assert_array_equal(lower, -LARGEST_RATE)
