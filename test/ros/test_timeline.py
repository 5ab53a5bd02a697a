# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Stamps are placed on the monotonic time line by their age on the clock they were read from."""

from __future__ import annotations

import pytest
from builtin_interfaces.msg import Time as Stamp
from rclpy.time import Time

from fault_tolerance.nodes.timeline import TimeLine

SECOND = 1_000_000_000


class Clock:
    """A ROS clock that shows what it is told to."""

    def __init__(self, nanoseconds: int) -> None:
        self.nanoseconds = nanoseconds

    def now(self) -> Time:
        return Time(nanoseconds=self.nanoseconds)


def test_the_age_of_a_stamp_is_kept():
    line = TimeLine(Clock(1000 * SECOND))
    assert line.placed(Stamp(sec=998)) == pytest.approx(line.now() - 2.0, abs=0.1)
    assert line.placed(Stamp(sec=1003)) == pytest.approx(line.now() + 3.0, abs=0.1)


def test_zero_says_nothing():
    assert TimeLine(Clock(SECOND)).placed(Stamp()) is None


def test_equal_stamps_lie_at_the_same_place():
    clock = Clock(1000 * SECOND)
    line = TimeLine(clock)
    first = line.placed(Stamp(sec=999))
    clock.nanoseconds += 300_000  # the clocks are not read at the same time
    assert line.placed(Stamp(sec=999)) == first


def test_setting_the_clock_moves_nothing_that_is_stamped_by_it():
    clock = Clock(1000 * SECOND)
    line = TimeLine(clock)
    before = line.placed(Stamp(sec=1000))
    for jump in (3600, -3600):
        clock.nanoseconds += jump * SECOND
        stamp = Stamp(sec=clock.nanoseconds // SECOND)
        assert line.placed(stamp) == pytest.approx(before, abs=0.1)


@pytest.mark.parametrize('stamp', [Stamp(sec=-1), Stamp(sec=2**31 - 1, nanosec=2**32 - 1)])
def test_no_stamp_is_too_odd(stamp):
    assert isinstance(TimeLine(Clock(SECOND)).placed(stamp), float)
