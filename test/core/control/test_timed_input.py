# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Watchdogs: old values are refused, silence is noticed, a jump of the clock is survived."""

import numpy as np
import pytest

from fault_tolerance.control.reading_gate import ReadingGate
from fault_tolerance.control.timed_input import TaskVelocity, TimedInput
from fault_tolerance.mechanism.catalogue import mechanism_named


@pytest.fixture(params=['joint state', 'task velocity'])
def entry(request) -> TimedInput:
    if request.param == 'joint state':
        return ReadingGate(mechanism_named('mirror_4_strut'), 0.1, lambda values, _: values)
    return TaskVelocity(4, 0.1)


def is_stale(entry, now) -> bool:
    return now > entry.deadline


def test_an_input_that_never_came_has_not_ceased(entry):
    assert not is_stale(entry, 1e9)


@pytest.mark.parametrize(('now', 'ceased'), [(1.0, False), (1.09, False), (1.11, True)])
def test_silence_longer_than_the_timeout_is_noticed(entry, now, ceased):
    assert entry.offer(np.zeros(4), 1.0, None) is None

    assert is_stale(entry, now) is ceased


def test_a_value_that_is_old_on_arrival_does_not_refresh(entry):
    entry.offer(np.zeros(4), 1.0, None)
    notice = entry.offer(np.ones(4), 1.2, 1.05)

    assert notice.reason in ('stale_joint_state', 'stale_task_velocity')
    assert '0.150 s old' in notice.text
    assert is_stale(entry, 1.2)
    np.testing.assert_array_equal(entry.value, np.zeros(4))


@pytest.mark.parametrize(('age', 'asked'), [(0.15, False), (4.0, False), (3600.0, True)])
def test_an_age_that_no_way_takes_is_asked_about(entry, age, asked):
    notice = entry.offer(np.zeros(4), 5000.0, 5000.0 - age)
    assert 'more than 0.1 s' in notice.text
    assert ('use_sim_time' in notice.text) is asked


def test_a_value_older_than_the_last_is_refused_where_order_matters(entry):
    entry.offer(np.zeros(4), 1.0, 1.0)
    notice = entry.offer(np.ones(4), 1.01, 0.99)
    ordered = isinstance(entry, ReadingGate)
    assert (notice is not None) is ordered
    assert entry.value[0] == (0.0 if ordered else 1.0)


@pytest.mark.parametrize('stamp', [1e9, float('inf'), float('nan')])
def test_a_stamp_from_the_future_counts_as_now(entry, stamp):
    assert entry.offer(np.zeros(4), 1.0, stamp) is None

    assert entry.offer(np.ones(4), 1.01, 1.005) is None
    assert is_stale(entry, 1.2)


def test_after_the_clock_was_set_back_the_next_value_counts(entry):
    entry.offer(np.zeros(4), 1000.0, None)
    entry.restart_clock()

    assert is_stale(entry, 5.0)
    assert entry.offer(np.ones(4), 5.0, 5.0) is None
    assert not is_stale(entry, 5.0)
