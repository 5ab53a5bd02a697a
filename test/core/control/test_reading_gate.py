# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Readings that cannot be true are not believed; encoders that wrap, die or come in parts are."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.control.control_model import control_model
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.joint_states import JointStateReader
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.control.unwrapping import closing_turns
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path
from fault_tolerance.mechanism.files import mechanism_from_text

PERIOD = 0.01
TURN = 2.0 * np.pi


class Machine:
    """A supervisor that is given readings, one a period."""

    def __init__(self, mechanism, **changes):
        self.mechanism = mechanism
        self.supervisor = Supervisor(mechanism, Settings(**changes))
        self.now = 0.0
        self.zeros = np.zeros(len(mechanism.actuators))
        self.read(self.zeros)
        assert self.state is State.NOMINAL

    @property
    def state(self):
        return self.supervisor.output.state

    @property
    def reason(self):
        return self.supervisor.output.reason

    def read(self, values, passed=PERIOD, stamped=True):
        self.now += passed
        stamp = self.now if stamped else None
        notice = self.supervisor.joint_reading(np.array(values), self.now, stamp)
        velocity = np.zeros(len(self.mechanism.task.coordinates))
        self.supervisor.task_velocity(velocity, self.now)
        self.supervisor.step(self.now)
        return notice

    def report(self, mode, name):
        self.supervisor.reports([Report(('drive', name), name, mode, ERROR, None)], self.now)
        self.supervisor.step(self.now)

    def estimated(self):
        return self.supervisor.output.estimate.actuator_values


@pytest.fixture
def hexapod():
    return Machine(mechanism_named('gough_stewart_8'))


def arm(period=True):
    text = mechanism_path('serial_3r').read_text()
    if period:
        text = text.replace('velocity: 2', f'velocity: 2, period: {TURN!r}')
    return mechanism_from_text(text.replace('[-2, 2]', '[-7, 7]'))


def displaced(machine, joint, jump):
    values = machine.estimated().copy()
    values[joint] += jump
    return values


def test_a_jump_that_no_drive_makes_is_refused_and_named(hexapod):
    notice = hexapod.read(displaced(hexapod, 2, 0.05))
    assert (notice.reason, notice.rejected) == ('jump', True)
    assert 'leg_3 by 0.05 m in 10 ms' in notice.text
    np.testing.assert_allclose(hexapod.estimated(), 0.0, atol=1e-9)
    assert hexapod.state is State.NOMINAL
    # One bit that flips costs one reading.
    assert hexapod.read(hexapod.zeros) is None
    assert hexapod.state is State.NOMINAL


@pytest.mark.parametrize('alternating', [False, True])
def test_jumps_that_last_lead_to_a_hold(hexapod, alternating):
    """An encoder that has been reset, and a second publisher between the true readings."""
    false = displaced(hexapod, 0, -0.08)
    for _ in range(60):
        assert hexapod.read(false, 0.005).reason == 'jump'
        if alternating:
            assert hexapod.read(hexapod.zeros, 0.005) is None
    assert hexapod.state is State.HOLD
    assert 'leg_1 by -0.08 m' in hexapod.reason
    np.testing.assert_allclose(hexapod.estimated(), 0.0, atol=1e-9)
    for _ in range(30):
        hexapod.read(hexapod.zeros)
    assert hexapod.state is State.NOMINAL


@pytest.mark.parametrize('operation', ['clear', 'pause'])
def test_an_operator_says_that_a_jump_is_true(hexapod, operation):
    moved = 1e-3 * np.ones(8) + 0.06
    for _ in range(30):
        hexapod.read(moved)
    assert hexapod.state is State.HOLD
    if operation == 'clear':
        hexapod.supervisor.clear(hexapod.now)
    else:
        hexapod.supervisor.pause(True, hexapod.now)
        hexapod.read(moved)
        hexapod.supervisor.pause(False, hexapod.now)
    assert hexapod.read(moved) is None
    assert hexapod.state is State.NOMINAL
    np.testing.assert_allclose(hexapod.estimated(), moved, atol=1e-6)


def test_what_has_always_been_accepted_still_is():
    far = 0.09 * np.ones(8)
    machine = Machine(mechanism_named('gough_stewart_8'))
    for passed in (0.3, 1e3):  # after a gap
        assert machine.read(far, passed) is None
        assert machine.read(0.0 * far, passed) is None
    # Five readings a second, each after a gap or not, at full speed.
    slow = Machine(mechanism_named('gough_stewart_8'), joint_state_timeout=0.5)
    for turn in range(10):
        assert slow.read((-1) ** turn * 0.02 * np.ones(8), 0.2) is None
    # By hand, while it is paused.
    machine.read(0.0 * far)
    machine.supervisor.pause(True, machine.now)
    for values in (far, -far, far):
        assert machine.read(values) is None
    first = Supervisor(mechanism_named('gough_stewart_8'))
    assert first.joint_reading(far, 0.0) is None


def test_bursts_are_no_jumps(hexapod):
    """A stall, and then two readings at once; at the speed limit, without stamps."""
    step = 0.2 * PERIOD
    values = hexapod.zeros
    for passed in (PERIOD, 0.06, 0.0, 0.0, PERIOD, PERIOD):
        values = values + step * max(1.0, passed / PERIOD)
        assert hexapod.read(values, passed, stamped=False) is None


def test_a_limp_drive_may_go_as_fast_as_it_likes(hexapod):
    hexapod.report('torque', 'leg_3')
    assert hexapod.read(displaced(hexapod, 2, 0.05)) is None


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(-0.02, 0.02), min_size=5, max_size=60), st.integers(-2, 2))
def test_encoders_that_wrap_are_unwrapped(steps, turns):
    machine = Machine(arm())
    machine.supervisor.clear(machine.now)
    true = np.zeros(3)
    for step in steps:
        true = true + 12.0 * step * np.array([0.0, 0.0, 1.0])
        true = np.clip(true, -6.9, 6.9)
        wrapped = (true + np.pi) % TURN - np.pi + [0.0, TURN * turns, 0.0]
        assert machine.read(wrapped, 0.09) is None
        np.testing.assert_allclose(machine.supervisor.output.estimate.readings, true, atol=1e-9)


def planar(period):
    """Return a planar platform whose legs read the same after a period, and how they read."""
    text = mechanism_path('planar_4rpr').read_text()
    mechanism = mechanism_from_text(
        text.replace('velocity: 0.5', f'velocity: 0.5, period: {period}'))
    chains = [(one.joints[0].point[:2], one.joints[-1].point[:2])
              for one in mechanism.struts]

    def legs(x, y, angle):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return np.array([
            np.linalg.norm(turn @ tip + (x, y) - base) - np.linalg.norm(tip - base)
            for base, tip in chains])

    return mechanism, legs


@pytest.mark.parametrize(('place', 'near'), [
    ((0.02, 0.03, 0.1), True), ((0.16, 0.0, 0.0), False), ((-0.1, 0.12, 0.25), False),
])
def test_at_the_start_it_is_in_the_turn_that_closes_the_loops(place, near):
    mechanism, legs = planar(0.2)
    values = legs(*place)
    wrapped = (values + 0.1) % 0.2 - 0.1
    assert np.allclose(wrapped, values) is near
    machine = Machine(mechanism)
    supervisor = Supervisor(mechanism)
    assert supervisor.joint_reading(wrapped, 0.0) is None
    supervisor.step(0.0)
    np.testing.assert_allclose(supervisor.output.estimate.readings, values, atol=1e-12)
    # Driven there, and paused: it is where it was.
    for share in np.linspace(0.0, 1.0, 40):
        values = legs(*share * np.array(place))
        assert machine.read((values + 0.1) % 0.2 - 0.1) is None
    machine.supervisor.pause(True, machine.now)
    machine.supervisor.pause(False, machine.now)
    assert machine.read(wrapped, 10.0) is None
    np.testing.assert_allclose(machine.supervisor.output.estimate.readings, values, atol=1e-12)


@pytest.mark.parametrize(('misfit', 'compiled', 'most'), [
    (0.0, True, 1), (2e-3, True, 6), (4e-3, False, 6), (0.1, True, 250), (0.1, False, 50),
])
def test_few_turns_are_tried_where_encoders_agree_well_enough_to_go_on(misfit, compiled, most):
    """Each is an estimate in the callback; nothing moves while none of them closes the loops."""
    mechanism, legs = planar(0.2)
    kernel, calls = best_kernel(), []

    def counted(*given):
        calls.append(0)
        kernel.estimate(*given)

    model = control_model(
        mechanism, Settings(), replace(kernel, estimate=counted, compiled=compiled))
    against = misfit * mechanism.characteristic_length * np.array([1.0, -1.0, 1.0, -1.0])
    values = legs(0.02, 0.03, 0.1) + against
    calls.clear()
    found = closing_turns(model, (values + 0.1) % 0.2 - 0.1, np.zeros(4), FailureSet())
    assert 1 <= len(calls) <= most
    if misfit < 5e-3:
        np.testing.assert_allclose(found, values, atol=1e-12)


def test_without_redundancy_it_is_where_it_was_before_a_pause():
    machine = Machine(arm())
    for angle in np.arange(0.0, 5.0, 0.1):
        machine.read([0.0, 0.0, (angle + np.pi) % TURN - np.pi])
    machine.supervisor.pause(True, machine.now)
    machine.read([0.0, 0.0, 5.0 - TURN], 100.0)
    assert machine.supervisor.output.estimate.readings[2] == pytest.approx(5.0)


def test_a_wrap_that_the_file_does_not_know_is_not_followed():
    machine = Machine(arm(period=False))
    for angle in np.arange(0.0, np.pi, 0.05):
        assert machine.read([0.0, 0.0, angle], 0.05) is None
    notice = machine.read([0.0, 0.0, 3.15 - TURN], 0.05)
    assert 'joint_3 by' in notice.text
    assert 'period' in notice.text


def pieces(reader, names, values, now, failed=()):
    return [reader.readings([name], [value], failed, now)[0]
            for name, value in zip(names, values, strict=True)]


def test_one_message_per_joint():
    mechanism = mechanism_named('mirror_4_strut')
    names, reader = mechanism.joint_state_names, JointStateReader(mechanism)
    for turn in range(5):
        values = 1e-5 * np.arange(4) + 1e-6 * turn
        *early, last = pieces(reader, names, values, 0.01 * turn)
        assert early == [None] * 3  # one step for all of them
        np.testing.assert_array_equal(last, values)
    # One that comes more often than the others has commands follow it.
    found = [reader.readings([names[1]], [value], (), 0.05)[0] for value in (0.0, 1e-6, 2e-6)]
    assert found[0] is None
    np.testing.assert_allclose(found[2], [4e-6, 2e-6, 2.4e-5, 3.4e-5])


def test_parts_that_are_too_old_are_not_put_together():
    mechanism = mechanism_named('mirror_4_strut')
    names, reader = mechanism.joint_state_names, JointStateReader(mechanism, 0.1)
    pieces(reader, names[:3], np.zeros(3), 0.0)
    assert reader.readings([names[3]], [0.0], (), 0.2)[0] is None
    values, notice = reader.readings([names[3]], [0.0], (), 0.21)
    assert values is None
    assert notice.reason == 'missing_joint'
    assert all(name in notice.text for name in names[:3])
    assert names[3] not in notice.text


def test_strangers_are_nobodys_business():
    reader = JointStateReader(mechanism_named('mirror_4_strut'))
    for _ in range(3):
        assert reader.readings(['gripper', 'finger'], [0.0, float('nan')]) == (None, None)


@pytest.mark.parametrize('mode', ['position', 'torque'])
@pytest.mark.parametrize('dead', ['nan', 'absent', 'frozen'])
def test_an_encoder_that_dies_with_its_drive(mode, dead):
    machine = Machine(mechanism_named('mirror_4_strut'))
    machine.report(mode, 'theta_2')
    reader, mechanism = JointStateReader(machine.mechanism), machine.mechanism
    names, failures = mechanism.joint_state_names, machine.supervisor.failures.parts
    post = machine.supervisor.output.estimate.post
    way = 1e-5 * post.present.rate_map[:, 0]
    for turn in range(1, 20):
        true = turn * way
        values = [one for place, one in enumerate(true) if place != 1]
        kept = [name for name in names if name != 'theta_2']
        if dead != 'absent':
            values.insert(1, float('nan') if dead == 'nan' else 0.0)
            kept = names
        found, _ = reader.readings(list(kept), values, failures, machine.now)
        assert machine.read(found) is None
    assert machine.state is State.DEGRADED
    np.testing.assert_allclose(machine.estimated(), true, atol=2e-9)
    silent = machine.supervisor.output.sensorless
    assert silent == (() if (mode, dead) == ('position', 'frozen') else ('theta_2',))
    assert machine.supervisor.metrics().sensorless == silent


def test_too_few_readings_hold():
    supervisor = Supervisor(mechanism_named('mirror_4_strut'))
    supervisor.reports([
        Report(('drive', name), name, mode, ERROR, None)
        for mode, name in (('position', 'theta_1'), ('torque', 'theta_2'))
    ], 0.0)
    assert supervisor.joint_reading(np.array([np.nan, np.nan, 0.0, 0.0]), 0.0) is None
    output = supervisor.step(0.0)
    assert output.state is State.HOLD
    assert 'pose not determined' in output.reason
    # Where one of them has been read, the others say where the other one is.
    assert supervisor.joint_reading(np.array([0.0, np.nan, 0.0, 0.0]), PERIOD) is None
    assert supervisor.step(PERIOD).state is State.DEGRADED
    assert supervisor.joint_reading(np.array([np.nan, np.nan, 0.0, 0.0]), 2.0 * PERIOD) is None
    assert supervisor.step(2.0 * PERIOD).state is State.DEGRADED
    assert supervisor.output.sensorless == ('theta_1', 'theta_2')


def test_without_a_failure_a_missing_reading_is_refused():
    machine = Machine(mechanism_named('mirror_4_strut'))
    assert machine.read([0.0, np.nan, 0.0, 0.0]).reason == 'not_finite'


def test_it_says_when_it_does_nothing():
    machine = Machine(mechanism_named('mirror_4_strut'))
    limits = machine.mechanism.position_limits
    for share in np.linspace(0.0, 1.0, 40):
        machine.read(share * limits[:, 1])
    machine.supervisor.watch()
    assert machine.supervisor.output.standstill == ''
    machine.now += PERIOD
    machine.supervisor.task_velocity(np.array([0.0, 0.0, 1e-3]), machine.now)
    machine.supervisor.step(machine.now)
    (notice,) = machine.supervisor.watch()
    assert notice.reason == 'standstill'
    assert not notice.rejected
    assert 'theta_1' in notice.text
    machine.supervisor.step(machine.now)
    assert 'nothing moves' in machine.reason
    assert machine.supervisor.metrics().level == 1
    machine.supervisor.task_velocity(np.array([0.0, 0.0, -1e-3]), machine.now)
    machine.supervisor.step(machine.now)
    assert machine.supervisor.watch() == ()
