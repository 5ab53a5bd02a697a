# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""After a failure that is not tolerable, what is left goes to the park pose, if it is held."""

import re

import numpy as np
import pytest
from core.control.control_cases import failing, place, report
from core.detection.detection_cases import ENGINES

from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.control.parking import DELAY, GOAL, SPEED
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_path
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.mechanism.screws import difference
from fault_tolerance.mechanism.targets import pose_target
from fault_tolerance.simulation.reference import Circle

NAME = 'mirror_4_strut'
STUCK = ('stuck theta_1', 'stuck theta_2')
PERIOD = 0.02


def parkable(park='{vz: 0.0001}'):
    text = mechanism_path(NAME).read_text()
    return mechanism_from_text(f'{text}park: {park}\n' if park else text)


class Machine:
    """A supervisor whose drives go exactly as commanded, from some place off home."""

    def __init__(self, mechanism, values=None, **settings):
        self.supervisor = Supervisor(mechanism, Settings(**settings))
        self.values, self.now = place(NAME, 3) if values is None else values, 0.0
        self.outputs = []
        self.run(0.1)
        assert self.supervisor.output.state is State.NOMINAL

    def fail(self, *words, **more):
        reports = [report(*one.split(), **more) for one in words]
        self.supervisor.reports(reports, self.now)

    def run(self, duration, *, readings=True):
        """Return the largest rates of each actuator meanwhile, (N,)."""
        begin = len(self.outputs)
        for _ in range(round(duration / PERIOD)):
            self.now += PERIOD
            if readings:
                assert self.supervisor.joint_reading(self.values, self.now) is None
            output = self.supervisor.step(self.now)
            self.values = self.values + PERIOD * output.rates
            self.outputs.append(output)
        return np.max([np.abs(one.rates) for one in self.outputs[begin:]], axis=0)

    def error(self):
        """Return how far the platform is from the park pose (6,), and the rows that count."""
        target = pose_target(self.supervisor.mechanism, self.supervisor.mechanism.park)
        pose = self.supervisor.output.estimate.pose
        return target.values - difference(pose, target.home), list(target.given)


def parking(mechanism=None, words=STUCK, **settings):
    """Return a machine that has failed, and has been under way for some time."""
    machine = Machine(mechanism or parkable(), **settings)
    machine.fail(*words)
    assert not machine.run(DELAY - PERIOD).any()
    assert machine.supervisor.output.state is State.STOPPED
    assert machine.run(0.2).any()
    return machine


def test_it_goes_to_the_park_pose_slowly_and_stays_stopped():
    machine = parking()
    reason = machine.supervisor.output.reason
    assert reason.startswith('theta_1 stuck, theta_2 stuck; ')
    assert reason.endswith('; parking')
    fastest = machine.run(4.0)
    assert (fastest <= SPEED * machine.supervisor.mechanism.velocity_limits * 1.000001).all()
    assert fastest[:2].max() == 0.0  # those that are stuck
    assert fastest[2:].min() > 0.0
    error, rows = machine.error()
    length = machine.supervisor.mechanism.characteristic_length
    assert np.abs(error[rows]).max() <= 1.01 * GOAL * length
    assert machine.supervisor.output.reason.endswith('; parked')
    stopped = [one.state for one in machine.outputs if one.failures]
    assert set(stopped) == {State.STOPPED}
    assert not machine.run(1.0).any()


def test_what_cannot_be_reached_is_approached_and_told():
    """One motion is left of three: it ends where the distance (in metres) is the smallest."""
    machine = parking(parkable('{wx: 0.002, wy: -0.001, vz: 0.0001}'))
    machine.run(5.0)
    error, rows = machine.error()
    mechanism = machine.supervisor.mechanism
    scale = np.repeat([mechanism.characteristic_length, 1.0], 3)
    (motion,) = after(mechanism, [('stuck', 'theta_1'), ('stuck', 'theta_2')]).jacobian.T
    motion = scale[rows] * motion
    left = (scale * error)[rows]
    assert np.linalg.norm(left) > 20 * GOAL * mechanism.characteristic_length
    along = abs(left @ motion) / np.linalg.norm(motion)
    assert along < 2.0 * GOAL * mechanism.characteristic_length
    reason = machine.supervisor.output.reason
    assert f'parked as far as it goes, off in wx by {error[0]:.2g} rad' in reason
    assert not machine.run(0.5).any()


def test_the_end_of_a_stroke_ends_it():
    machine = parking(parkable('{vz: 0.004}'))
    machine.run(10.0)
    assert 'as far as it goes, off in vz by 0.003' in machine.supervisor.output.reason
    limits = machine.supervisor.mechanism.position_limits
    assert (machine.values <= limits[:, 1]).all()
    assert machine.values.max() > 0.98 * limits.max()


def test_it_ends_before_a_singularity_where_the_drives_hold_the_platform_no_longer():
    """Turned by about 70 degrees the platform of the hexapod is held less and less well."""
    text = re.sub(r'position: \[.*?\], ', '', mechanism_path('gough_stewart_6').read_text())
    mechanism = mechanism_from_text(f'{text}park: {{wz: 1.8}}\n')
    machine = Machine(mechanism, np.zeros(6))
    machine.fail('stuck leg_1', 'stuck leg_2')
    machine.run(14.0)
    reason, gain = machine.supervisor.output.reason, []
    assert 'parked as far as it goes, off in wz by 0.' in reason
    for post in (after(mechanism), machine.supervisor.output.estimate.post):
        scale = np.repeat([mechanism.characteristic_length, 1.0], 3)[:, None]
        gain.append(np.linalg.norm(scale * post.present.twist_jacobian))
    assert 5.0 * gain[0] < gain[1] < 15.0 * gain[0]
    assert not machine.run(0.5).any()


def test_nothing_is_parked_that_is_not_held_or_tolerated_or_has_no_place_for_it():
    for mechanism, words in (
        (parkable(), ('free theta_1', 'free theta_2')),
        (parkable(), ('stuck theta_1',)),
        (parkable(''), STUCK),
    ):
        machine = Machine(mechanism)
        machine.fail(*words)
        assert not machine.run(DELAY + 1.0).any()
        assert 'park' not in machine.supervisor.output.reason


def test_a_stop_for_another_reason_does_not_park():
    machine = Machine(parkable())
    machine.fail(*STUCK)
    machine.fail('burning theta_3')
    assert not machine.run(DELAY + 1.0).any()
    # Neither does a machine whose controller goes on as if nothing had failed.
    machine = Machine(parkable(), recovery=False)
    machine.fail(*STUCK)
    assert not machine.run(DELAY + 1.0).any()


def paused(machine):
    machine.supervisor.pause(True, machine.now)


def unread(machine):
    # The first of them is not late yet.
    machine.run(machine.supervisor.settings.joint_state_timeout, readings=False)


def set_back(machine):
    machine.supervisor.restart_clock(machine.now)
    assert not machine.supervisor.step(machine.now).rates.any()


def broken(machine):
    failing(machine.supervisor, 'command')


@pytest.mark.parametrize('happens', [
    paused, unread, broken,
    lambda machine: machine.fail('stuck theta_3'),
    lambda machine: machine.fail('burning theta_3'),
    lambda machine: machine.supervisor.clear(machine.now),
    set_back,
], ids=['pause', 'no readings', 'internal error', 'failure', 'unknown mode', 'clear', 'clock'])
def test_whatever_happens_ends_it_at_once_and_for_good(happens):
    machine = parking()
    kernel = machine.supervisor.kernel
    happens(machine)
    first = machine.run(PERIOD, readings=happens is not unread)
    assert not first.any()
    assert '; park move broken off' in machine.supervisor.output.reason
    machine.supervisor.kernel = kernel
    machine.supervisor.pause(False, machine.now)
    assert not machine.run(2.0 * DELAY).any()
    assert machine.supervisor.output.state is State.STOPPED


def test_the_next_stop_has_a_park_move_of_its_own():
    machine = parking()
    machine.now += 10.0  # nothing is reported any more
    machine.supervisor.clear(machine.now)
    machine.run(0.1)
    assert machine.supervisor.output.state is State.NOMINAL
    assert 'park' not in machine.supervisor.output.reason
    machine.fail('stuck theta_3', 'stuck theta_4')
    assert not machine.run(DELAY - PERIOD).any()
    assert machine.run(0.2).any()


def test_a_further_failure_before_it_begins_puts_it_off():
    machine = Machine(parkable())
    machine.fail(*STUCK)
    assert not machine.run(0.8 * DELAY).any()
    machine.fail('free theta_3')
    assert not machine.run(0.8 * DELAY).any()
    assert machine.run(0.4 * DELAY).any()


def test_a_conversion_comes_first():
    """Where a strut is to be released nobody knows what holds until that is confirmed."""
    text = mechanism_path('gough_stewart_8').read_text()
    text = text.replace(', major: [wx, wy, vx, vy, vz]', '')
    text = text.replace('    joints:', '    release: true\n    joints:')
    for convert in ('act', 'advise'):
        mechanism = mechanism_from_text(f'{text}park: {{vz: -0.02}}\n')
        machine = Machine(mechanism, np.zeros(8), convert=convert)
        machine.fail('stuck leg_3')
        machine.run(PERIOD)
        machine.supervisor.converter.consider(machine.supervisor.output, machine.now)
        assert bool(machine.run(DELAY + 0.2).any()) is (convert == 'advise')


def test_a_failure_that_nobody_reports_ends_it_where_detection_acts():
    settings = LoopSettings(period=0.01, monitor=MonitorSettings('act'))
    loop = ClosedLoop(parkable('{vz: 0.0003}'), Circle(1e-3, 1.0), settings)
    loop.run(1.0)
    for words in STUCK:
        loop.inject(words)
    loop.run(DELAY + 0.05)
    assert loop.supervisor.output.parking == 'parking'
    loop.inject('silent stuck theta_3')
    loop.run(0.5)
    assert loop.supervisor.output.parking == 'park move broken off'
    assert loop.supervisor.failures.stuck == ('theta_1', 'theta_2', 'theta_3')


@pytest.mark.parametrize('engine', ENGINES)
def test_a_mirror_is_parked(engine):
    if engine == 'mujoco':
        pytest.importorskip('mujoco')
    loop = ClosedLoop(parkable(), Circle(3e-3, 1.0), LoopSettings(period=0.01, engine=engine))
    loop.run(0.6)
    for words in STUCK:
        loop.inject(words)
    first = loop.run(DELAY)
    assert set(first.states) == {State.STOPPED}
    assert not first.rates.any()
    moved = loop.run(3.0)
    assert set(moved.states) == {State.STOPPED}
    assert moved.rates.any()
    assert loop.supervisor.output.reason.endswith('; parked')
    assert not loop.supervisor.output.rates.any()
    height = loop.plant.step(1e-3).pose[2, 3] - loop.mechanism.origin[2]
    assert height == pytest.approx(1e-4, abs=6e-6)
    # No drive pushes against those that are stuck.
    assert np.abs(moved.efforts - first.efforts[-1]).max() < 0.1
