# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What is watched beside the commands, and what is warned of."""

from dataclasses import replace

import numpy as np
import pytest
from core.control.control_cases import fed, feed, report

from fault_tolerance.control.failure_reports import OK, WARN
from fault_tolerance.mechanism.catalogue import mechanism_named

MIRROR = mechanism_named('mirror_4_strut')
ARM = mechanism_named('serial_3r')
PERIOD = 0.01
ASKED = [5e-3, 0.0, 0.0]


def run(
    mechanism, shares, asked, seconds=0.5, force=np.nan, failures=(), step=1e-12, **options
):
    """Let actuators move by their shares of what they are told; return also what is missing.

    Encoders have steps of ``step``.
    """
    supervisor = fed(mechanism, **options)
    supervisor.reports([report(*failure) for failure in failures], 0.0)
    values, news, told = np.zeros(len(mechanism.actuators)), [], []
    for number in range(1, round(seconds / PERIOD)):
        feed(supervisor, number * PERIOD, asked, step * np.round(values / step))
        output = supervisor.step(number * PERIOD)
        news += supervisor.watch(force)
        missing = (1.0 - np.asarray(shares)) * output.rates * mechanism.rate_scale
        told.append(np.abs(missing).max())
        values = values + PERIOD * np.asarray(shares) * output.rates
    return supervisor, news, np.array(told[-25:])


@pytest.mark.parametrize('shares', [(1.0, 1.0, 1.0, 1.0), (1.0, 0.5, 1.0, 0.5)])
def test_the_tracking_error_is_what_is_missing_of_the_commanded_rate(shares):
    supervisor, news, missing = run(MIRROR, shares, ASKED)
    assert supervisor.metrics().tracking_error == pytest.approx(missing.mean(), rel=0.05, abs=1e-9)
    assert not news


@pytest.mark.parametrize(('share', 'warned'), [(0.0, True), (0.05, False)])
def test_drives_that_do_not_follow_at_all_are_told_of(share, warned):
    supervisor, news, _ = run(MIRROR, 4 * (share,), ASKED, seconds=0.7)
    assert [one.reason for one in news] == ['not_followed'] * warned
    assert ('no drive follows' in supervisor.metrics().message) is warned
    feed(supervisor, 0.7, [0.0, 0.0, 0.0])
    supervisor.step(0.7)
    supervisor.watch()
    supervisor.step(0.7)
    assert 'no drive follows' not in supervisor.metrics().message


def test_drives_too_slow_for_their_encoders_are_not_taken_for_deaf():
    for asked in (1e-7, 1e-6, 1e-5):
        _, news, _ = run(MIRROR, 4 * (1.0,), [asked, 0.0, 0.0], seconds=2.5, step=1e-6)
        assert not news


@pytest.mark.parametrize('failure', [(), ('stuck', 'theta_2'), ('free', 'theta_2'),
                                     ('lost', 'strut_2')])
def test_steps_between_two_readings_measure_no_travel(failure):
    """A watchdog steps more often than readings come; each of them is compared once."""
    errors = []
    for steps in (1, 10):
        supervisor = fed(MIRROR, joint_state_timeout=9.0, command_timeout=9.0)
        if failure:
            supervisor.reports([report(*failure)], 0.0)
        values = np.zeros(4)
        for number in range(1, 80):
            now = 0.05 * (number // 10) + 0.005 * (number % 10)
            if number % 10 == 0:
                feed(supervisor, now, (number % 3 + 1.0) * np.array(ASKED), values)
            if number % (10 // steps) == 0:
                output = supervisor.step(now)
                supervisor.watch()
            values = values + 0.005 * output.rates if number > 10 else values
        errors.append(supervisor.metrics().tracking_error)
    assert errors == pytest.approx([0.0, 0.0], abs=1e-9)


def test_turning_drives_count_at_the_characteristic_length():
    asked = [0.01, 0.0, 0.0][: len(ARM.task.coordinates)]
    supervisor, _, missing = run(ARM, (0.5, 1.0, 1.0), asked)
    assert 0.0 < missing.min() <= supervisor.metrics().tracking_error <= missing.max()


def test_a_lost_strut_has_no_tracking_error_and_a_pause_begins_anew():
    supervisor, *_ = run(MIRROR, (0.0, 1.0, 1.0, 1.0), [0.0, 5e-3, 0.0],
                         failures=[('lost', 'strut_1')])
    assert supervisor.metrics().tracking_error == pytest.approx(0.0, abs=1e-9)
    feed(supervisor, 50.0, ASKED, 1e-4 * np.array([1.0, 0.0, -1.0, 0.0]))
    supervisor.step(50.0)
    supervisor.watch()
    assert supervisor.metrics().tracking_error == pytest.approx(0.0, abs=1e-9)


def test_each_limit_warns_once_and_for_as_long_as_it_lasts():
    limits = {'internal_force_limit': 3.0, 'tracking_error_limit': 1e-6, 'saturation_limit': 0.2}
    supervisor, news, _ = run(
        MIRROR, (0.0, 0.0, 0.0, 0.0), [50.0, 0.0, 0.0], force=4.0, **limits
    )
    assert [one.reason for one in news] == ['internal_force', 'tracking_error', 'saturation']
    assert not any(one.rejected for one in news)
    metrics = supervisor.metrics()
    assert (metrics.level, metrics.internal_force) == (WARN, 4.0)
    assert 'internal force of 4 N (limit 3)' in metrics.message
    assert 'theta_1, theta_3 at a limit for 0.2 s' in metrics.message

    for number in range(100, 130):
        feed(supervisor, number * PERIOD, [0.0, 0.0, 0.0])
        supervisor.step(number * PERIOD)
        assert supervisor.watch() == ()
    metrics = supervisor.metrics()
    assert (metrics.level, metrics.message) == (OK, 'nominal: no failure')
    assert metrics.internal_force is None


def test_a_limit_that_is_set_anew_counts_what_lasts_from_then():
    supervisor, news = fed(MIRROR, saturation_limit=0.2), []
    for number in range(1, 130):
        now = number * PERIOD
        if number in (10, 61):  # at a limit from 0.6 s on
            limit = 0.0 if number == 10 else 0.2
            supervisor.apply_settings(replace(supervisor.settings, saturation_limit=limit))
        feed(supervisor, now, [50.0, 0.0, 0.0] if number >= 60 else [0.0, 0.0, 0.0])
        supervisor.step(now)
        news += [(one.reason, now) for one in supervisor.watch() if one.reason == 'saturation']
    assert news == [('saturation', pytest.approx(0.8, abs=1.5 * PERIOD))]


def test_without_limits_nothing_is_warned_of():
    _, news, _ = run(MIRROR, (0.0, 0.0, 0.0, 0.0), [50.0, 0.0, 0.0], force=1e6)
    assert not news


def test_a_stop_has_no_worst_next_failure_and_tells_since_when_nothing_was_reported():
    supervisor = fed(MIRROR)
    supervisor.step(0.0)
    assert supervisor.metrics().time_since_report is None
    supervisor.reports([report('free', 'theta_4')], 1.0)
    feed(supervisor, 1.0)
    supervisor.step(1.0)
    assert supervisor.metrics().worst_next
    supervisor.reports([report('lost', 'strut_1')], 2.0)
    supervisor.step(3.5)
    metrics = supervisor.metrics()
    assert (metrics.state, metrics.worst_next, metrics.worst_next_measure) == ('stopped', '', 0.0)
    assert metrics.time_since_report == pytest.approx(1.5)
