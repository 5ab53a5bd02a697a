# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Limits: kept by slowing down, secondary motion first, never by leaving the range of T."""

from dataclasses import replace

import numpy as np
import pytest
from core.mechanisms import hexapod, made
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fault_tolerance.control.limits import (
    LARGEST_RATE,
    RateBounds,
    limited_rate,
    rate_bounds,
    singularity_scale,
)
from fault_tolerance.control.resolved_rate import resolved_rate
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named

FSM = mechanism_named('fsm_4_strut')
NAMES = FSM.actuator_names


def resolved(asked, *failures, mechanism=FSM):
    kinematics = differential_kinematics(home_rows(mechanism), failure_set(mechanism, failures))
    return resolved_rate(kinematics, np.array(asked, dtype=float))


def bounds(limit) -> RateBounds:
    upper = np.broadcast_to(np.asarray(limit, dtype=float), (4,))
    return RateBounds(-upper, upper)


def test_a_command_within_bounds_is_left_alone():
    whole = resolved([0.01, 0.02, 0.03])
    found = limited_rate(whole, bounds(1.0), NAMES)

    assert found.command is whole
    assert (found.scale, found.secondary_scale, found.saturation) == (1.0, 1.0, ())


def test_the_secondary_motion_gives_way_first():
    # theta_1 = (wx + vz / ...) : 0.5 of major and 1.0 of secondary rate, at most 0.8 together.
    whole = resolved([0.5 * np.sqrt(2.0), 0.0, 1.0])
    found = limited_rate(whole, bounds(0.8), NAMES)

    assert found.scale == pytest.approx(1.0)
    assert found.secondary_scale == pytest.approx(0.3)
    assert found.saturation == ('theta_1', 'theta_2', 'theta_4')
    np.testing.assert_allclose(found.command.rates, [0.8, 0.3, -0.2, 0.3], atol=1e-12)


def test_then_everything_slows_down_by_one_factor():
    whole = resolved([np.sqrt(2.0), 0.5, 1.0])
    found = limited_rate(whole, bounds(0.25), NAMES)

    assert found.secondary_scale == 0.0
    assert found.scale == pytest.approx(0.25)
    np.testing.assert_allclose(found.command.achieved, [0.25 * np.sqrt(2), 0.125, 0], atol=1e-12)


def test_one_slow_actuator_slows_all_and_is_the_only_one_named():
    found = limited_rate(resolved([1.0, 1.0, 0.0]), bounds([9.0, 9.0, 0.1, 9.0]), NAMES)

    assert found.saturation == ('theta_3',)
    np.testing.assert_allclose(np.abs(found.command.rates), 0.1, atol=1e-12)


def test_a_stuck_actuator_never_binds():
    whole = resolved([0.3, 0.4, 0.0], ('position', 'theta_4'))
    found = limited_rate(whole, bounds([1.0, 1.0, 1.0, 0.0]), NAMES)

    assert found.command is whole


def test_rounding_at_the_end_of_a_stroke_does_not_stop_everything():
    whole = resolved([1.0, 0.0, 0.0])
    whole = replace(whole, secondary=np.array([0.0, 1e-16, 0.0]))
    found = limited_rate(whole, bounds([1.0, 0.0, 1.0, 0.0]), NAMES)

    assert found.scale == 1.0


def test_an_initial_scale_is_part_of_the_result():
    found = limited_rate(resolved([1.0, 0.0, 0.0]), bounds(9.0), NAMES, 0.25)

    assert found.scale == 0.25
    np.testing.assert_allclose(found.command.achieved, [0.25, 0.0, 0.0], atol=1e-15)
    assert limited_rate(resolved([1.0, 0, 0]), bounds(9.0), NAMES, 0.0).command.rates.any() == 0


@pytest.mark.parametrize('size', [1e20, 1e300, 1.7e308])
def test_a_huge_velocity_keeps_its_direction(size):
    limit = rate_bounds(made(hexapod()), np.zeros(6), 10.0)
    whole = resolved(size * np.array([0, 0, 0, 1.0, 1.0, 0.5]), mechanism=made(hexapod()))
    found = limited_rate(whole, limit, made(hexapod()).actuator_names)

    assert np.abs(found.command.rates).max() == pytest.approx(LARGEST_RATE)
    achieved = found.command.achieved[3:] / found.command.achieved[3]
    np.testing.assert_allclose(achieved, [1.0, 1.0, 0.5], atol=1e-9)
    assert np.isfinite(found.command.residual).all()


RATES = st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3)
LIMITS = st.lists(st.floats(0.0, 5.0), min_size=4, max_size=4)
FAILURES = st.sampled_from(
    [(), ('position', 'theta_1'), ('torque', 'theta_2'), ('hard', 'strut_3')]
)


@settings(deadline=None, max_examples=150)
@given(RATES, LIMITS, LIMITS, FAILURES)
def test_bounds_are_kept_within_the_range_of_the_mapping(asked, low, high, failure):
    whole = resolved(asked, *([failure] if failure else []))
    found = limited_rate(whole, RateBounds(-np.array(low), np.array(high)), NAMES)
    rates, present = found.command.rates, whole.kinematics

    size = max(1.0, np.abs(whole.rates).max())
    assert (rates <= np.array(high) + 1e-9 * size).all()
    assert (rates >= -np.array(low) - 1e-9 * size).all()
    active = rates[present.active]
    inside = present.active_mapping @ (present.active_mapping.T @ active)
    np.testing.assert_allclose(active, inside, atol=1e-12 * size)
    np.testing.assert_allclose(
        found.command.achieved[:2], found.scale * whole.achieved[:2], atol=1e-12 * size
    )
    assert 0.0 <= found.scale <= 1.0
    assert 0.0 <= found.secondary_scale <= 1.0
    # The major task is slowed down only when the secondary motion is gone already.
    assert found.scale == 1.0 or found.secondary_scale == 0.0
    assert bool(found.saturation) is (found.command is not whole)


@settings(deadline=None, max_examples=60)
@given(RATES, st.floats(0.01, 5.0))
def test_no_more_is_given_up_than_need_be(asked, limit):
    assume(np.abs(asked[:2]).max() > 1e-3)
    whole = resolved(asked)
    found = limited_rate(whole, bounds(limit), NAMES)

    if found.saturation:
        assert np.abs(found.command.rates).max() == pytest.approx(limit, rel=1e-9)


def test_speed_falls_off_towards_the_ends_of_the_stroke():
    mechanism = mechanism_named('mirror_4_strut')
    low, high = mechanism.position_limits[0]
    speed = mechanism.velocity_limits[0]
    values = np.array([high - 1e-5, low + 1e-5, high + 1e-5, 0.0])
    found = rate_bounds(mechanism, values, 10.0)

    np.testing.assert_allclose(found.upper, [1e-4, 10 * (high - values[1]), 0.0, 10 * high])
    np.testing.assert_allclose(found.lower[:2], [10 * (low - values[0]), -1e-4])
    assert (found.lower <= 0.0).all()
    assert (found.upper >= 0.0).all()
    stiff = rate_bounds(mechanism, np.zeros(4), 1e9)
    np.testing.assert_allclose(stiff.upper, speed)
    np.testing.assert_allclose(stiff.lower, -speed)


def test_without_a_reading_only_the_rate_limit_holds():
    mechanism = mechanism_named('mirror_4_strut')
    found = rate_bounds(mechanism, np.array([np.nan, 0.0, 0.0, 0.0]), 10.0)

    assert found.upper[0] == mechanism.velocity_limits[0]
    assert found.lower[0] == -mechanism.velocity_limits[0]


def test_an_actuator_without_limits_is_still_bounded():
    found = rate_bounds(made(hexapod()), np.zeros(6), 10.0)

    np.testing.assert_array_equal(found.upper, LARGEST_RATE)
    np.testing.assert_array_equal(found.lower, -LARGEST_RATE)


@pytest.mark.parametrize(
    ('margin', 'scale'), [(0.0, 0.0), (0.01, 0.0), (0.02, 0.25), (0.05, 1.0), (1.0, 1.0)]
)
def test_speed_falls_off_towards_a_singularity(margin, scale):
    assert singularity_scale(margin, 0.01, 0.05) == pytest.approx(scale)
