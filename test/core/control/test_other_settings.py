# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Settings exchanged while the supervisor works hold from the next step on."""

from dataclasses import replace

import numpy as np
import pytest
from core.control.control_cases import fed, feed, report

from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named

FSM = mechanism_named('fsm_4_strut')
ASKED = [0.01, 0.02, 0.0]


def test_thresholds_judge_what_is_there_already():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    assert supervisor.step(0.0).state is State.DEGRADED
    supervisor.apply_settings(replace(supervisor.settings, tolerance_threshold=0.9))
    assert supervisor.step(0.01).state is State.STOPPED
    # A stop stays until somebody has looked.
    supervisor.apply_settings(replace(supervisor.settings, tolerance_threshold=0.01))
    assert supervisor.step(0.02).state is State.STOPPED
    assert supervisor.failures


def test_timeouts_and_rules_of_reports():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.apply_settings(
        Settings(joint_state_timeout=5.0, command_timeout=5.0, auto_clear=True))
    feed(supervisor, 0.0, ASKED)
    assert supervisor.step(4.9).rates.any()
    assert supervisor.step(5.1).state is State.HOLD
    supervisor.reports([report('stuck', 'theta_4')], 6.0)
    assert supervisor.failures
    supervisor.reports([report('ok', 'theta_4')], 6.0)
    assert not supervisor.failures
    supervisor.apply_settings(Settings(unknown_mode='ignore'))
    supervisor.reports([report('melted', 'theta_4')], 6.0)
    feed(supervisor, 6.0)
    assert supervisor.step(6.0).state is State.NOMINAL


@pytest.mark.parametrize('changes', [
    {'stroke_gain': 1.0}, {'max_acceleration': 0.1}, {'slow_below': 0.9, 'hold_below': 0.1},
])
def test_the_law_is_that_of_a_supervisor_made_with_them(changes):
    mirror = mechanism_named('mirror_4_strut')
    place = 5e-4 * np.array([1.0, 0.0, -1.0, 0.0])
    changed, made = Supervisor(mirror), Supervisor(mirror, Settings(**changes))
    changed.apply_settings(Settings(**changes))
    for supervisor in (changed, made):
        feed(supervisor, 0.0, [0.5, 0.0, 0.0], place)
        supervisor.step(0.0)
    for number in range(1, 4):
        for supervisor in (changed, made):
            feed(supervisor, 0.01 * number, [0.5, 0.0, 0.0], place)
        one, other = changed.step(0.01 * number), made.step(0.01 * number)
        np.testing.assert_array_equal(one.rates, other.rates)
