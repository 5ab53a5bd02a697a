# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The simulated drives: lag, limits, and independence of the time step."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
from plant_cases import MECHANISMS

from fault_tolerance.simulation.servos import Servos

MIRROR = MECHANISMS['mirror_4_strut']
ALL = np.ones(4, dtype=bool)
RATES = np.array([1e-3, -2e-3, 3e-3, 0.0])


def servos(lag=0.01):
    return Servos(MIRROR, lag, 10.0)


def test_the_rate_follows_as_a_first_order_lag():
    drive = servos()
    drive.advance(RATES, ALL, 0.01)
    assert np.allclose(drive.rates, RATES * (1.0 - exp(-1.0)))
    assert np.allclose(drive.setpoints, RATES * 0.01 * exp(-1.0))


def test_the_way_does_not_depend_on_how_time_is_divided():
    one, many = servos(), servos()
    one.advance(RATES, ALL, 0.03)
    for _ in range(300):
        many.advance(RATES, ALL, 1e-4)
    assert np.allclose(one.setpoints, many.setpoints, rtol=1e-12)
    assert np.allclose(one.rates, many.rates, rtol=1e-12)


def test_without_lag_the_command_is_obeyed_at_once():
    drive = servos(lag=0.0)
    drive.advance(RATES, ALL, 0.1)
    assert np.allclose(drive.setpoints, 0.1 * RATES)
    assert (drive.rates == RATES).all()


def test_rates_are_limited_whatever_is_commanded():
    drive = servos(lag=0.0)
    drive.advance(np.array([1e300, -1e300, 0.04, 0.06]), ALL, 1e-3)
    assert np.allclose(drive.rates, [0.05, -0.05, 0.04, 0.05])


def test_an_actuator_without_a_limit_gets_one_of_its_kind():
    arm = Servos(MECHANISMS['arm'], 0.0, 7.0)
    assert (arm.rate_limits == 7.0).all()
    hexapod = Servos(MECHANISMS['hexapod'], 0.0, 7.0)
    assert hexapod.rate_limits == pytest.approx(np.full(6, 3.5))


def test_the_stroke_ends_the_motion_and_leaves_it_again_at_once():
    drive = servos(lag=0.0)
    drive.advance(np.full(4, 0.05), ALL, 1.0)
    assert (drive.setpoints == 0.0006).all()
    assert (drive.rates == 0.0).all()
    drive.advance(np.full(4, -0.01), ALL, 0.01)
    assert np.allclose(drive.setpoints, 0.0005)


def test_what_is_not_driven_stands_still():
    drive = servos()
    drive.advance(RATES, ALL, 0.01)
    before = drive.setpoints.copy()
    drive.advance(RATES, np.array([True, False, False, True]), 0.01)
    assert (drive.rates[1:3] == 0.0).all()
    assert (drive.setpoints[1:3] == before[1:3]).all()
    assert drive.setpoints[0] > before[0]


def test_rest_is_taken_within_the_stroke():
    drive = servos()
    drive.advance(RATES, ALL, 0.01)
    assert drive.rest_at(2, 1e-4) == 1e-4
    assert drive.rest_at(1, -1.0) == -0.0006
    assert drive.rates[1] == drive.rates[2] == 0.0


def test_a_servo_obeys_in_part_the_wrong_way_or_not_at_all():
    drive = servos(lag=0.0)
    drive.obedience[:] = [0.5, -1.0, 1.0, 0.0]
    drive.own_rates[3] = 1.0
    drive.advance(RATES, ALL, 0.01)
    assert np.allclose(drive.setpoints, [5e-6, 2e-5, 3e-5, 5e-4])
    # Of its largest rate half is left too.
    drive.advance(np.full(4, 1e300), ALL, 1e-3)
    assert np.allclose(drive.rates, [0.025, -0.05, 0.05, 0.05])


def test_static_friction_holds_until_it_is_overcome():
    drive = Servos(MIRROR, 0.0, 10.0, 1.05e-6)
    rates = np.array([1e-4, -1e-4, 0.0, 1e-3])
    places = []
    for _ in range(15):
        drive.advance(rates, ALL, 1e-3)
        places.append(drive.setpoints.copy())
    places = np.array(places)
    assert not places[:10, :3].any()
    # It then goes to where it should be, and sticks there.
    assert np.allclose(places[-1], [1.1e-6, -1.1e-6, 0.0, 1.4e-5], atol=1e-12)
    assert len(np.unique(places[:, 0])) == 2
    drive.rest_at(0, 2e-5)
    drive.advance(0.0 * rates, ALL, 1.0)
    assert drive.setpoints[0] == 2e-5
