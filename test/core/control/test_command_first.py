# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The command first, what can wait behind it: nothing else changes by that."""

from __future__ import annotations

import numpy as np
import pytest
from core.control.control_cases import feed, report

from fault_tolerance.control.assessment import Assessment
from fault_tolerance.control.recovery import State
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.situation import Situation
from fault_tolerance.control.supervisor import MOST_ERRORS, Supervisor
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.mechanism.catalogue import mechanism_named

PERIOD = 0.01
FOR_EVER = Settings(joint_state_timeout=1e9, command_timeout=1e9, tolerance_threshold=1e-4)
PLATFORM = mechanism_named('gough_stewart_8')
FREE = (('free', 'leg_1'), ('free', 'leg_3'))


def started(*failures):
    supervisor = Supervisor(PLATFORM, FOR_EVER)
    supervisor.task_velocity(np.full(len(PLATFORM.task.coordinates), 1e-3), 0.0)
    supervisor.reports([report(mode, name) for mode, name in failures], 0.0)
    return supervisor


def through_home():
    """Return joint values on a way through home, where the platform is not held any more."""
    legs = np.array([1.0, -0.4, 0.7, 0.2, -0.9, 0.5, 0.3, -0.6])
    return [share * 0.02 * PLATFORM.characteristic_length * legs
            for share in np.linspace(-1.0, 1.0, 21)]


def outputs_on_the_way(supervisor):
    found = []
    for number, values in enumerate(through_home()):
        now = PERIOD * number
        supervisor.joint_reading(values, now)
        found.append(supervisor.step(now))
    return found


def test_a_verdict_that_waits_is_the_one_of_the_same_step(monkeypatch):
    late = outputs_on_the_way(started(*FREE))
    monkeypatch.setattr(Situation, '_may_be_judged_later', lambda *_: False)
    at_once = outputs_on_the_way(started(*FREE))
    assert {one.state for one in at_once} == {State.DEGRADED, State.STOPPED}
    for one, other in zip(late, at_once, strict=True):
        assert (one.state, one.reason) == (other.state, other.reason)
        np.testing.assert_array_equal(one.rates, other.rates)


def test_with_failures_the_command_does_not_wait_for_the_nominal_kinematics():
    supervisor = started(('stuck', 'leg_2'))
    feed(supervisor, 0.0, values=through_home()[0])
    supervisor.step(0.0)
    supervisor.joint_reading(through_home()[1], PERIOD)
    with pytest.MonkeyPatch.context() as patch:
        for owner, name in ((PostFailure, 'nominal'), (Assessment, 'measures')):
            patch.setattr(owner, name, property(lambda _: pytest.fail('waited for')))
        command = supervisor.command(PERIOD)
    assert command.rates.any()
    assert supervisor.settled().rates is command.rates


def test_new_failures_are_judged_before_the_command():
    supervisor = started()
    feed(supervisor, 0.0)
    assert supervisor.step(0.0).rates.any()
    supervisor.reports([report(mode, name) for mode, name in FREE], PERIOD)
    command = supervisor.command(PERIOD)
    assert command.decision.state is State.STOPPED
    assert not command.rates.any()


def test_what_fails_behind_the_command_ends_the_motion_too(monkeypatch):
    supervisor = started()
    outputs = []
    with monkeypatch.context() as patch:
        patch.setattr(supervisor._plausibility, 'observe', lambda *_: 1 / 0)
        for number in range(MOST_ERRORS):
            feed(supervisor, PERIOD * number, values=through_home()[number])
            assert supervisor.command(PERIOD * number).rates.any()
            outputs.append(supervisor.settled())
    assert not any(one.rates.any() for one in outputs)
    assert [one.state for one in outputs] == [State.HOLD, State.HOLD, State.STOPPED]
    assert all('internal error: ZeroDivisionError' in one.reason for one in outputs)
