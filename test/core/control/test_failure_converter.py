# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Brakes and releases turn failures that must not stand into such as may (section III-F)."""

from dataclasses import replace

import numpy as np
import pytest
from core.detection.detection_cases import ENGINES

from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.simulation.reference import Circle


def braked():
    text = mechanism_path('mirror_3_strut').read_text()
    return mechanism_from_text(text.replace('actuated: true,', 'actuated: true, brake: true,'))


def releasable(name='gough_stewart_8'):
    text = mechanism_path(name).read_text().replace(', major: [wx, wy, vx, vy, vz]', '')
    return mechanism_from_text(text.replace('    joints:', '    release: true\n    joints:'))


def report(supervisor, mode, name, now):
    supervisor.reports([Report(('drive', name), name, mode, ERROR, None)], now)
    return supervisor.step(now)


def running(mechanism, convert='act'):
    supervisor = Supervisor(mechanism, Settings(convert=convert, joint_state_timeout=1e3))
    supervisor.joint_reading(np.zeros(len(mechanism.actuators)), 0.0)
    assert supervisor.step(0.0).state is State.NOMINAL
    return supervisor


def test_what_is_there_already_is_converted_once_that_is_allowed_or_needed():
    supervisor = running(braked(), 'advise')
    converter = supervisor.converter
    assert not converter.consider(report(supervisor, 'torque', 'theta_2', 1.0), 1.0)
    supervisor.apply_settings(replace(supervisor.settings, convert='act'))
    assert converter.consider(supervisor.step(1.1), 1.1)
    assert converter.engaged == ('theta_2',)

    # Tolerated where it happens, and not elsewhere, or by another threshold.
    supervisor = running(mechanism_named('mirror_4_strut'))
    converter = supervisor.converter
    output = report(supervisor, 'torque', 'theta_2', 1.0)
    assert output.state is State.DEGRADED
    assert not converter.consider(output, 1.0)
    supervisor.apply_settings(replace(supervisor.settings, tolerance_threshold=0.6))
    output = supervisor.step(1.1)
    assert output.state is State.STOPPED
    assert converter.consider(output, 1.1)
    assert converter.engaged == ('theta_2',)


def test_a_limp_strut_is_braked_and_goes_on_once_that_is_confirmed():
    supervisor = running(braked())
    converter = supervisor.converter
    output = report(supervisor, 'torque', 'theta_2', 1.0)
    assert output.state is State.STOPPED
    assert converter.consider(output, 1.0)
    assert converter.engaged == ('theta_2',)
    assert str(converter) == 'torque:theta_2 to position:theta_2: commanded'
    # Nothing is believed before somebody says so.
    assert supervisor.step(1.5).state is State.STOPPED
    assert not converter.consider(supervisor.output, 1.5)
    assert report(supervisor, 'position', 'theta_2', 1.6).state is State.DEGRADED
    assert not converter.consider(supervisor.output, 1.6)
    assert converter.engaged == ('theta_2',)
    assert converter.overdue(9.0) is None
    # Repaired and cleared: the brake lets go.
    supervisor.clear(10.0)
    assert converter.consider(supervisor.step(10.0), 10.0)
    assert converter.engaged == ()
    assert str(converter) == ''


def test_a_stuck_leg_is_released():
    supervisor = running(releasable())
    output = report(supervisor, 'position', 'leg_3', 1.0)
    assert output.state is State.STOPPED
    assert supervisor.converter.consider(output, 1.0)
    assert supervisor.converter.engaged == ('strut_3',)
    assert report(supervisor, 'hard', 'strut_3', 1.1).state is State.DEGRADED


def test_what_nobody_confirms_is_told_once_and_stays_stopped():
    supervisor = running(braked())
    supervisor.converter.consider(report(supervisor, 'torque', 'theta_2', 1.0), 1.0)
    assert supervisor.converter.overdue(1.5) is None
    notice = supervisor.converter.overdue(2.5)
    assert 'theta_2' in notice.text
    assert 'not confirmed' in notice.text
    assert supervisor.converter.overdue(3.0) is None
    assert supervisor.step(3.0).state is State.STOPPED


def test_a_stop_for_another_reason_is_not_lifted(monkeypatch):
    """Three internal errors stop it until somebody has looked, not until a brake has closed."""
    supervisor = running(braked())
    output = report(supervisor, 'torque', 'theta_2', 1.0)
    assert supervisor.converter.consider(output, 1.0)
    with monkeypatch.context() as patch:
        patch.setattr('fault_tolerance.control.supervisor.estimate', lambda *_: 1 / 0)
        for step in range(3):
            supervisor.step(1.1 + 0.01 * step)
    assert 'internal error' in supervisor.output.reason
    assert report(supervisor, 'position', 'theta_2', 1.6).state is State.STOPPED


def test_it_is_only_advised_by_default():
    supervisor = running(braked(), 'advise')
    output = report(supervisor, 'torque', 'theta_2', 1.0)
    assert not supervisor.converter.consider(output, 1.0)
    assert supervisor.converter.engaged == ()
    assert str(supervisor.converter) == 'torque:theta_2 to position:theta_2: advised'
    # A stop that nobody has asked to convert is lifted by a clear only.
    assert report(supervisor, 'position', 'theta_2', 1.6).state is State.STOPPED


def test_what_is_tolerated_is_left_as_it_is():
    supervisor = running(mechanism_named('mirror_4_strut'))
    output = report(supervisor, 'torque', 'theta_2', 1.0)
    assert output.state is State.DEGRADED
    assert not supervisor.converter.consider(output, 1.0)


def test_another_failure_meanwhile_is_judged_anew():
    supervisor = running(braked())
    supervisor.converter.consider(report(supervisor, 'torque', 'theta_2', 1.0), 1.0)
    output = report(supervisor, 'position', 'theta_1', 1.1)
    supervisor.converter.consider(output, 1.1)
    assert report(supervisor, 'position', 'theta_2', 1.2).state is State.STOPPED


def test_without_brakes_there_is_nothing_to_convert():
    supervisor = running(mechanism_from_text(mechanism_path('mirror_3_strut').read_text()))
    output = report(supervisor, 'torque', 'theta_2', 1.0)
    assert not supervisor.converter.consider(output, 1.0)
    assert str(supervisor.converter) == ''


@pytest.mark.parametrize('engine', ENGINES)
def test_the_mirror_goes_on_tracking(engine):
    """A torque failure of the three-strut mirror: stopped without a brake, tracking with it."""
    if engine == 'mujoco':
        pytest.importorskip('mujoco')
    errors = {}
    for convert in ('advise', 'act'):
        loop = ClosedLoop(braked(), Circle(5e-4, 1.0), LoopSettings(
            period=0.01, engine=engine, control=Settings(convert=convert)))
        loop.run(0.5)
        healthy = loop.run(1.0).major_error_rms
        loop.inject('torque theta_2')
        loop.run(0.5)
        errors[convert] = loop.run(1.0).major_error_rms / healthy
        state = loop.supervisor.output.state
        assert state is (State.DEGRADED if convert == 'act' else State.STOPPED)
    assert errors['act'] < 1.2
    assert errors['advise'] > 20.0
