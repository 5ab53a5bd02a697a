# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration's loop in the deterministic core: what recovery is worth."""

from copy import deepcopy
from functools import cache

import numpy as np
import pytest

from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.mechanism.catalogue import mechanism_named

MECHANISM = mechanism_named('mirror_4_strut')


TURNS = 1.0
"""Seconds: periods of the circle, as many before a failure, at once after it, and later."""


@cache
def before_a_failure(recovery, seed):
    """Return a loop that has settled, and the trace of the healthy mirror; to be copied."""
    settings = LoopSettings(control=Settings(recovery=recovery), seed=seed)
    loop = ClosedLoop(MECHANISM, settings=settings)
    loop.run(TURNS)
    return loop, loop.run(TURNS)


def run_with_failure(words, *, recovery=True, seed=1):
    """Return the loop, and the traces before and after a failure."""
    loop, healthy = deepcopy(before_a_failure(recovery, seed))
    for word in words:
        loop.inject(word)
    at_once = loop.run(TURNS)
    return loop, healthy, at_once, loop.run(TURNS)


def test_a_copy_of_a_loop_goes_on_as_the_loop_itself_would():
    first, second = (deepcopy(before_a_failure(True, 1)[0]).run(0.2) for _ in range(2))
    loop = ClosedLoop(MECHANISM, settings=LoopSettings(seed=1))
    loop.run(2.0 * TURNS)
    third = loop.run(0.2)

    for other in (second, third):
        np.testing.assert_array_equal(first.error, other.error)
        np.testing.assert_array_equal(first.efforts, other.efforts)


@pytest.mark.parametrize('seed', [1, 2])
def test_recovery_keeps_a_mirror_with_a_stuck_strut_pointing(seed):
    _, healthy, at_once, recovered = run_with_failure(['stuck theta_4'], seed=seed)
    _, _, fighting, unrecovered = run_with_failure(['stuck theta_4'], seed=seed, recovery=False)

    assert set(recovered.states) == {State.DEGRADED}
    assert recovered.error_rms <= 1.2 * healthy.error_rms
    assert unrecovered.error_rms >= 8.0 * healthy.error_rms
    preload = healthy.mean_efforts
    with_recovery = max(at_once.peak_force(preload), recovered.peak_force(preload))
    without = max(fighting.peak_force(preload), unrecovered.peak_force(preload))
    assert with_recovery <= 0.1 * without


@pytest.mark.parametrize(
    'words',
    [['free theta_2'], ['hard strut_3'], ['stuck theta_1', 'free theta_3']],
    ids=' '.join,
)
def test_tolerated_failures_leave_the_pointing_error_below_a_microradian(words):
    _, _, _, after = run_with_failure(words)

    assert set(after.states) == {State.DEGRADED}
    assert after.error_rms < 1e-6


def test_an_intolerable_failure_stops_the_drives_within_one_period():
    loop, _, at_once, _ = run_with_failure(['stuck theta_1', 'stuck theta_2'])

    assert at_once.states[0] is State.STOPPED
    assert not at_once.rates.any()
    assert 'cannot be given independently' in loop.supervisor.output.reason


@pytest.mark.parametrize('word', ['weak', 'reversed', 'frozen', 'biased'])
def test_a_drive_that_reports_a_misbehaviour_is_left_alone(word):
    _, healthy, _, after = run_with_failure([f'{word} theta_4'])

    assert set(after.states) == {State.DEGRADED}
    assert not after.rates[:, 3].any()
    assert after.error_rms < 1e-6
    assert np.abs(after.efforts - healthy.mean_efforts).max() < 1.0


def test_a_drive_that_reports_that_it_runs_away_stops_the_others_until_it_is_mended():
    loop, _, at_once, after = run_with_failure(['runaway theta_4'])

    assert {*at_once.states, *after.states} == {State.STOPPED}
    assert not at_once.rates.any()
    assert 'runaway' in loop.supervisor.output.reason
    loop.inject('ok all')
    loop.clear()
    assert loop.run(LoopSettings().period).states == (State.NOMINAL,)


def test_mending_and_clearing_returns_to_nominal_without_a_jump():
    loop, healthy, _, failed = run_with_failure(['stuck theta_4'])
    loop.inject('ok all')
    loop.clear()
    first = loop.run(LoopSettings().period)
    loop.run(TURNS)
    healed = loop.run(TURNS)

    assert first.states == (State.NOMINAL,)
    swept_in_a_period = 2.0 * np.pi * 1e-3 * LoopSettings().period
    assert np.linalg.norm(first.error[0] - failed.error[-1]) < 0.1 * swept_in_a_period
    assert healed.error_rms <= 1.2 * healthy.error_rms


def test_the_same_seed_gives_the_same_run():
    first, second = (ClosedLoop(MECHANISM).run(0.2) for _ in range(2))

    np.testing.assert_array_equal(first.error, second.error)
    np.testing.assert_array_equal(first.efforts, second.efforts)
