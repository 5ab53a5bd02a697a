# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Watchdogs: old values are refused, silence is noticed, a jump of the clock is survived."""

import numpy as np
import pytest

from fault_tolerance.control.input_watchdog import InputWatchdog


def watched(*, ordered: bool = True) -> InputWatchdog:
    return InputWatchdog('joint state', 0.1, ordered=ordered)


def is_stale(entry, now) -> bool:
    return now > entry.deadline


def test_an_input_that_never_came_has_not_ceased():
    assert not is_stale(watched(), 1e9)


@pytest.mark.parametrize(('now', 'ceased'), [(1.0, False), (1.09, False), (1.11, True)])
def test_silence_longer_than_the_timeout_is_noticed(now, ceased):
    entry = watched()
    assert entry.offer(np.zeros(4), 1.0, None) is None

    assert is_stale(entry, now) is ceased


def test_a_value_that_is_old_on_arrival_does_not_refresh():
    entry = watched()
    entry.offer(np.zeros(4), 1.0, None)
    notice = entry.offer(np.ones(4), 1.2, 1.05)

    assert notice.reason == 'stale_joint_state'
    assert '0.150 s old' in notice.text
    assert is_stale(entry, 1.2)
    np.testing.assert_array_equal(entry.value, np.zeros(4))


def test_a_value_older_than_the_last_is_refused_where_order_matters():
    for ordered in (True, False):
        entry = watched(ordered=ordered)
        entry.offer(np.zeros(4), 1.0, 1.0)
        notice = entry.offer(np.ones(4), 1.01, 0.99)

        assert (notice is not None) is ordered
        assert entry.value[0] == (0.0 if ordered else 1.0)
    assert watched().offer(np.ones(4), 1.0, 1.0) is None


@pytest.mark.parametrize('stamp', [1e9, float('inf'), float('nan')])
def test_a_stamp_from_the_future_counts_as_now(stamp):
    entry = watched()
    assert entry.offer(np.zeros(4), 1.0, stamp) is None

    assert entry.offer(np.ones(4), 1.01, 1.005) is None
    assert is_stale(entry, 1.2)


def test_after_the_clock_was_set_back_the_next_value_counts():
    entry = watched()
    entry.offer(np.zeros(4), 1000.0, None)
    entry.restart_clock()

    assert is_stale(entry, 5.0)
    assert entry.offer(np.ones(4), 5.0, 5.0) is None
    assert not is_stale(entry, 5.0)
