# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Strain that a late report or a repair leaves behind is led back, slowly, and nothing else."""

import numpy as np
import pytest
from core.detection.detection_cases import ENGINES, PERIOD, REST, loop_of

from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.settings import Settings
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.relief import SPEED
from fault_tolerance.detection.self_stress import SelfStress
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named


def test_strain_is_what_efforts_have_beside_a_load():
    mechanism = mechanism_named('mirror_4_strut')
    stress = SelfStress(home_rows(mechanism), FailureSet())
    np.testing.assert_allclose(stress.strain(np.full(4, 3.0)), 0.0, atol=1e-18)
    against = np.array([1.0, -1.0, 1.0, -1.0])
    strain = stress.strain(against)
    assert stress.force(strain) == pytest.approx(1.0)
    relieving = stress.relieving(strain)
    np.testing.assert_allclose(1e6 * relieving, -against, atol=1e-9)


def test_drives_that_have_failed_take_no_part_in_relief():
    mechanism = mechanism_named('mirror_4_strut')
    stress = SelfStress(home_rows(mechanism), failure_set(mechanism, [('stuck', 'theta_4')]))
    strain = stress.strain(np.array([1.0, -1.0, 1.0, -1.0]))
    relieving = stress.relieving(strain)
    assert relieving[3] == 0.0
    assert np.abs(relieving[:3]).min() > 1e-7
    none = SelfStress(home_rows(mechanism_named('mirror_3_strut')), FailureSet())
    assert none.strain(np.ones(3)).shape == (0,)
    assert none.force(none.strain(np.ones(3))) == 0.0


def strained(engine, **settings):
    loop = loop_of(engine=engine, monitor=MonitorSettings('advise', **settings))
    loop.run(1.5)
    return loop


@pytest.mark.parametrize('engine', ENGINES)
@pytest.mark.parametrize('end', ['late report', 'clear'])
def test_the_force_goes_and_the_mirror_goes_on(engine, end):
    left, rates, errors = {}, {}, {}
    for relief in (False, True):
        loop = strained(engine, relief=relief)
        loop.inject('silent stuck theta_4')
        loop.run(0.25)
        if end == 'late report':
            report = Report(('drive', 'theta_4'), 'theta_4', 'position', ERROR, loop._now)
            loop.supervisor.reports([report], loop._now)
        else:
            # The drive is well again, with the way that the others went without it in between.
            loop.supervisor.reports([Report(
                ('drive', 'theta_4'), 'theta_4', 'position', ERROR, loop._now)], loop._now)
            loop.run(PERIOD)
            loop.plant._modes[3] = 'none'
            loop.supervisor.reports([Report(
                ('drive', 'theta_4'), 'theta_4', 'none', 0, loop._now)], loop._now)
            loop.clear()
        before = np.abs(loop.run(PERIOD).efforts).max()
        found = loop.run(3.0)
        left[relief] = loop.monitor.internal_force
        rates[relief], errors[relief] = found.rates, loop.run(1.0).error_rms
        assert before > 1.0
    assert left[False] > 1.0, left
    assert left[True] < 0.2, left
    # Directions that strain only: the task goes on as it would have.
    assert errors[True] < 20e-6
    mechanism = loop.mechanism
    fastest = SPEED * mechanism.characteristic_length
    assert np.abs(rates[True] - rates[False]).max() < 5.0 * fastest


def test_it_goes_with_few_readings_a_second_too():
    slow = Settings(joint_state_timeout=0.5, command_timeout=0.5, report_timeout=0.1)
    loop = loop_of(reference=REST, period=0.1, control=slow)
    loop.run(9.0)
    loop.inject('stuck theta_4')
    loop.run(1.0)
    loop.inject('ok theta_4')
    loop.run(1.0)
    loop.plant.command(1e-4 * np.array([1.0, -1.0, 1.0, -1.0]))
    loop.plant.step(0.1)
    loop.clear()
    forces = []
    for _ in range(40):
        loop.run(0.1)
        forces.append(loop.monitor.internal_force)
    assert max(forces) > 5.0
    assert max(forces[-12:]) < 0.2


def test_what_has_always_been_there_is_left_alone():
    loop = strained('elastic')
    loop.plant._servos._goals[:] += 2e-6 * np.array([1.0, -1.0, 1.0, -1.0])
    loop.plant._servos.setpoints[:] = loop.plant._servos._goals
    loop.run(1.0)
    assert loop.monitor.internal_force > 1.0
    assert loop.monitor.rates is None
    # What it was before a hold is not what it is.
    loop.supervisor.pause(True, loop._now)
    loop.run(0.1)
    assert np.isnan(loop.monitor.internal_force)
    loop.supervisor.pause(False, loop._now)
    loop.run(0.3)
    assert loop.monitor.internal_force > 1.0
