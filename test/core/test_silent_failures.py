# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Failures that nobody reports, in the closed loop: controller, detection, simulated machine."""

from __future__ import annotations

import numpy as np
import pytest

from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.state_machine import State
from fault_tolerance.detection.hypotheses import Symptom
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.simulation.reference import Circle

PERIOD = 0.01
ENGINES = ('elastic', 'mujoco')


def loop_of(name='mirror_4_strut', detect='act', engine='elastic', amplitude=1e-3, **settings):
    if engine == 'mujoco':
        pytest.importorskip('mujoco')
    return ClosedLoop(
        mechanism_named(name), Circle(amplitude, 1.0),
        LoopSettings(
            period=PERIOD, lead=0.006, engine=engine, monitor=MonitorSettings(detect, **settings)
        ),
    )


def probed(loop):
    """Return the loop after a probe, and what it has found."""
    assert loop.monitor.prober.request() == ''
    while loop.monitor.prober.probing:
        loop.run(PERIOD)
    return loop.monitor.prober.finding


@pytest.mark.parametrize('engine', ENGINES)
def test_a_stuck_drive_is_named_at_once_and_costs_little(engine):
    errors = {}
    for detect in ('off', 'act'):
        loop = loop_of(detect=detect, engine=engine)
        loop.run(1.5)
        onset = 1.5
        loop.inject('silent stuck theta_4')
        trace = loop.run(2.0)
        errors[detect] = trace.error_rms
    (found,) = loop.monitor.detector.suspicions
    assert [str(one) for one in found.candidates] == ['position:theta_4']
    assert 1e-9 * found.onset - onset <= 0.02
    degraded = [state is State.DEGRADED for state in trace.states]
    assert degraded.index(True) * PERIOD <= 0.05
    assert trace.states[-1] is State.DEGRADED
    assert errors['off'] > 300e-6
    assert errors['act'] < 20e-6


def test_what_is_found_shows_in_the_period_in_which_it_is_found():
    loop = loop_of()
    loop.run(1.5)
    loop.inject('silent stuck theta_4')
    while not loop.monitor.detector.suspicions:
        trace = loop.run(PERIOD)
    assert trace.states == (State.DEGRADED,)
    np.testing.assert_array_equal(trace.rates[0], loop.supervisor.output.rates)
    assert trace.rates[0, 3] == 0.0


def test_advice_changes_no_command():
    rates = {}
    for detect in ('off', 'advise'):
        loop = loop_of(detect=detect)
        loop.run(1.0)
        loop.inject('silent stuck theta_4')
        rates[detect] = loop.run(1.0).rates
    assert loop.monitor.detector.suspicions
    np.testing.assert_array_equal(rates['off'], rates['advise'])


@pytest.mark.parametrize('engine', ENGINES)
@pytest.mark.parametrize(('fault', 'named'), [
    ('free theta_2', {'torque:theta_2'}),
    ('lost strut_3', {'hard:strut_1', 'hard:strut_2', 'hard:strut_3', 'hard:strut_4'}),
])
def test_what_is_latent_is_found_by_the_next_probe(engine, fault, named):
    loop = loop_of(engine=engine)
    loop.run(1.5)
    assert probed(loop).startswith('no latent failure')
    loop.inject(f'silent {fault}')
    loop.run(1.0)
    assert not loop.monitor.detector.suspicions
    probed(loop)
    (found,) = loop.monitor.detector.suspicions
    assert {str(one) for one in found.candidates} == named
    # The wrong one of several struts left alone would be a second failure.
    assert loop.supervisor.failures.failures == () if len(named) > 1 else True
    assert loop.run(1.0).error_rms < 20e-6


def test_a_drive_reported_stuck_that_moves_is_named():
    loop = loop_of('gough_stewart_8', amplitude=1e-4)
    loop.run(1.5)
    loop.inject('silent runaway leg_2')
    loop.supervisor.reports(
        [Report(('drive', 'leg_2'), 'leg_2', 'position', ERROR, 1.5)], 1.5
    )
    loop.run(1.0)
    found = loop.monitor.detector.suspicions
    assert [(one.verdict.symptom, one.name) for one in found] == [(Symptom.RUNAWAY, 'leg_2')]
    assert found[0].moves_though_stuck(loop.supervisor.failures)
    assert loop.supervisor.output.state is State.DEGRADED


@pytest.mark.parametrize('engine', ENGINES)
def test_strain_left_by_a_late_report_is_led_back(engine):
    left = {}
    for relief in (False, True):
        loop = loop_of(detect='advise', engine=engine, relief=relief)
        loop.run(1.5)
        loop.inject('silent stuck theta_4')
        loop.run(0.25)
        loop.supervisor.reports(
            [Report(('drive', 'theta_4'), 'theta_4', 'position', ERROR, 1.75)], 1.75
        )
        loop.run(2.5)
        left[relief] = loop.monitor.internal_force
    assert left[False] > 1.0
    assert left[True] < 0.2
