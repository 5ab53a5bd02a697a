# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The real controller core on a mechanism in MuJoCo: it tracks if, and only if, it says so."""

from __future__ import annotations

import numpy as np
import pytest

from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.simulation.pointing import PointingLoop
from fault_tolerance.simulation.reference import Circle

PERIOD = 0.01
TURN = 0.2
# A loop that forgets within a turn, so that every failure can be judged by itself.
QUICK = LoopSettings(
    period=PERIOD, lead=0.5 * PERIOD + 0.001, pointing=PointingLoop(gain=30.0), engine='mujoco')


def single_failures(name):
    """Return the single failures of a mechanism as words, the tolerated ones and the others."""
    mechanism = mechanism_named(name)
    every = [
        *((mode, part) for mode in ('position', 'torque') for part in mechanism.actuator_names),
        *(('hard', part) for part in mechanism.strut_names),
    ]
    found = {True: [], False: []}
    for failure in every:
        state = reconfigured(home_rows(mechanism), failure_set(mechanism, [failure]))
        found[state.verdict.tolerable].append(' '.join(failure))
    return found[True], found[False]


# How many single failures each bears, and how many it does not.
MECHANISMS = {
    'mirror_3_strut': (3, 6),
    'mirror_4_strut': (12, 0),
    'mirror_overactuated': (10, 3),
    'gough_stewart_6': (6, 12),
    'gough_stewart_8': (24, 0),
}


@pytest.mark.parametrize('name', MECHANISMS)
def test_every_failure_that_is_tolerated_is_tracked_and_can_be_mended(name):
    tolerated, _ = single_failures(name)
    assert len(tolerated) == MECHANISMS[name][0]
    loop = ClosedLoop(mechanism_named(name), Circle(1e-3, 1.0 / TURN), QUICK)
    loop.run(0.3)
    healthy = loop.run(TURN)
    assert set(healthy.states) == {State.NOMINAL}
    assert healthy.error_rms < 5e-6
    for words in tolerated:
        loop.inject(words)
        loop.run(TURN)
        tracking = loop.run(TURN)
        assert set(tracking.states) == {State.DEGRADED}, words
        # Of a circle of 1 mrad; a mirror that has lost a strut and gained a soft mode lags 3 %.
        assert tracking.error_rms < 1.2 * healthy.error_rms + 40e-6, words
        loop.inject('ok all')
        loop.clear()
        loop.run(0.5 * TURN)
        assert loop.supervisor.output.state is State.NOMINAL, words


@pytest.mark.parametrize('name', [name for name, (_, count) in MECHANISMS.items() if count])
def test_every_failure_that_is_not_tolerated_stops_the_drives(name):
    _, others = single_failures(name)
    assert len(others) == MECHANISMS[name][1]
    for words in others:
        loop = ClosedLoop(mechanism_named(name), Circle(1e-3, 1.0 / TURN), QUICK)
        loop.run(2.0 * PERIOD)
        loop.inject(words)
        stopped = loop.run(5.0 * PERIOD)
        assert set(stopped.states) == {State.STOPPED}, words
        assert not stopped.rates.any(), words
        held = loop.plant.setpoints
        lost = loop.run(TURN)
        assert np.array_equal(loop.plant.setpoints, held), words
        assert lost.error_rms > 0.5e-3, words


def test_recovery_keeps_a_mirror_with_a_stuck_strut_pointing():
    errors, forces = {}, {}
    for recovery in (True, False):
        settings = LoopSettings(
            period=PERIOD, lead=QUICK.lead, control=Settings(recovery=recovery), engine='mujoco')
        loop = ClosedLoop(mechanism_named('mirror_4_strut'), settings=settings)
        loop.run(2.0)
        healthy = loop.run(1.0)
        loop.inject('stuck theta_4')
        at_once = loop.run(1.0)
        stuck = loop.run(1.0)
        assert set(stuck.states) == {State.DEGRADED}
        errors[recovery] = stuck.error_rms / healthy.error_rms
        forces[recovery] = max(
            trace.peak_force(healthy.mean_efforts) for trace in (at_once, stuck))
    assert errors[True] <= 1.2
    assert errors[False] >= 8.0
    assert forces[True] <= 0.1 * forces[False]
