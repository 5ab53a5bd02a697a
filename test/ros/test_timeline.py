# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps are placed on the monotonic time line by their age on the clock they were read from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from builtin_interfaces.msg import Time as Stamp
from rclpy.clock import JumpThreshold
from rclpy.time import Time

from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.timeline import TimeLine

SECOND = 1_000_000_000


class Clock:
    """A ROS clock that shows what it is told to."""

    ros_time_is_active = True

    def __init__(self, nanoseconds: int) -> None:
        self.nanoseconds = nanoseconds

    def now(self) -> Time:
        return Time(nanoseconds=self.nanoseconds)

    def create_jump_callback(self, threshold: JumpThreshold, *, post_callback: Callable) -> None:
        pass


def test_the_age_of_a_stamp_is_kept():
    line = TimeLine(Clock(1000 * SECOND))
    assert line.monotonic(Stamp(sec=998)) == pytest.approx(line.now() - 2.0, abs=0.5)
    assert line.monotonic(Stamp(sec=1003)) == pytest.approx(line.now() + 3.0, abs=0.5)


def test_zero_says_nothing():
    assert TimeLine(Clock(SECOND)).monotonic(Stamp()) is None


def test_equal_stamps_lie_at_the_same_place():
    clock = Clock(1000 * SECOND)
    line = TimeLine(clock)
    first = line.monotonic(Stamp(sec=999))
    clock.nanoseconds += 300_000  # the clocks are not read at the same time
    assert line.monotonic(Stamp(sec=999)) == first


def test_setting_the_clock_moves_nothing_that_is_stamped_by_it():
    clock = Clock(1000 * SECOND)
    line = TimeLine(clock)
    before = line.monotonic(Stamp(sec=1000))
    for jump in (3600, -3600):
        clock.nanoseconds += jump * SECOND
        stamp = Stamp(sec=clock.nanoseconds // SECOND)
        assert line.monotonic(stamp) == pytest.approx(before, abs=0.1)


@pytest.mark.parametrize('jump', [3600, -3600])
def test_setting_the_wall_clock_by_an_hour_is_no_matter_for_the_controller(jump):
    clock = Clock(10_000 * SECOND)
    line = TimeLine(clock)
    mechanism = mechanism_named('fsm_4_strut')
    supervisor, start = Supervisor(mechanism), line.now()
    states, notices = [], []
    for number in range(40):
        now = start + 0.01 * number
        if number == 20:
            clock.nanoseconds += jump * SECOND
        # What is stamped now by the clock as it stands; the true clock has stood still meanwhile.
        stamp = line.monotonic(Stamp(sec=clock.nanoseconds // SECOND)) + 0.01 * number
        notices.append(supervisor.joint_reading(np.zeros(4), now, stamp))
        notices.append(supervisor.task_velocity(np.array([0.01, 0.02, 0.0]), now, stamp))
        output = supervisor.step(now)
        states.append(output.state)
        assert output.rates.any()
    assert set(notices) == {None}
    assert set(states) == {State.NOMINAL}


@pytest.mark.parametrize('stamp', [Stamp(sec=-1), Stamp(sec=2**31 - 1, nanosec=2**32 - 1)])
def test_no_stamp_is_too_odd(stamp):
    assert isinstance(TimeLine(Clock(SECOND)).monotonic(stamp), float)
