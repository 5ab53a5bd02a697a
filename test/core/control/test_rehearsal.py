# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A rehearsed failure leaves nothing behind, whatever the state."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import numpy as np
import pytest

from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.kernel.compilation import python_kernel
from fault_tolerance.mechanism.catalogue import mechanism_named

MODES = ('position', 'torque', 'hard', 'none', 'melted')


def outcomes(name, rehearsed):
    """Return what a supervisor commands in a run with failures, and its states."""
    mechanism, random = mechanism_named(name), np.random.default_rng(5)
    supervisor, made = Supervisor(mechanism), np.random.default_rng(6)
    count, found = len(mechanism.actuators), []

    def rehearse(now):
        target = mechanism.actuator_names[int(made.integers(count))]
        report = Report(('made', 'up'), target, MODES[int(made.integers(5))], ERROR, now)
        if rehearsed:
            supervisor.rehearse([report], now)

    rehearse(0.0)
    speed = 1e-3 * np.ones(len(mechanism.task.coordinates))
    for step in range(1, 90):
        now = 0.01 * step
        supervisor.task_velocity(speed, now)
        if step % 7:
            values = 1e-7 * random.normal(size=count)
            values[[name in supervisor.failures.parts for name in mechanism.actuator_names]] = nan
            supervisor.joint_reading(values, now)
        if step % 20 == 0:
            target = mechanism.actuator_names[step // 20 % count]
            supervisor.reports([Report(('drive', 'drive'), target, MODES[step // 40], ERROR)], now)
        if step == 70:
            supervisor.clear(now)
        rehearse(now)
        output = supervisor.step(now)
        rehearse(now)
        found.append((
            output.rates.tobytes(), output.estimate.numbers.tobytes(), output.state,
            output.failures, output.reason,
        ))
    return found


@pytest.mark.parametrize('name', ['mirror_4_strut', 'mirror_3_strut', 'planar_4rpr', 'serial_3r'])
def test_a_rehearsal_changes_nothing(name):
    told = outcomes(name, True)
    assert told == outcomes(name, False)
    assert len({state for _, _, state, _, _ in told}) > 1


def test_with_a_failure_in_force_nothing_is_estimated_twice():
    """There the steps keep the code in the caches, and joints without a reading take long."""
    mechanism, estimates = mechanism_named('mirror_4_strut'), []
    kernel = python_kernel()

    def counted(*given):
        estimates.append(given)
        kernel.estimate(*given)

    supervisor = Supervisor(mechanism, kernel=replace(kernel, compiled=True, estimate=counted))
    made = [Report(('made', 'up'), 'theta_2', 'position', ERROR)]
    supervisor.joint_reading(np.zeros(4), 0.0)
    supervisor.step(0.0)
    before = len(estimates)
    supervisor.rehearse(made, 0.0)
    assert len(estimates) == before + 1
    supervisor.reports([Report(('drive', 'drive'), 'theta_1', 'position', ERROR)], 0.01)
    supervisor.joint_reading(np.array([nan, 0.0, 0.0, 0.0]), 0.01)
    supervisor.step(0.01)
    before = len(estimates)
    supervisor.rehearse(made, 0.01)
    assert len(estimates) == before
