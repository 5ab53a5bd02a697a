# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Readings that show that a brake holds a limp drive, and all that look like it."""

from dataclasses import replace

import numpy as np
import pytest
from core.control.test_failure_converter import braked, report
from core.detection.detection_cases import ENGINES

from fault_tolerance.control.brake_evidence import BrakeEvidence
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.simulation.engines import plant_named
from fault_tolerance.simulation.faults import fault_command
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.pointing import PointingLoop
from fault_tolerance.simulation.reference import Circle

MIRROR = braked()
PERIOD = 0.01


def shown_after(
    course, noise=1e-8, seconds=2.0, engaged_at=0.02, seed=0, stroke=None, period=PERIOD
):
    """Return when a drive whose readings follow ``course`` is shown to be held; None: never."""
    rng, drive = np.random.default_rng(seed), MIRROR.actuators[1]
    drive = replace(drive, position=stroke or drive.position)
    evidence = BrakeEvidence(drive, MIRROR.characteristic_length)
    for now in np.arange(0.0, seconds, period):
        evidence.add(now, course(now) + noise * rng.standard_normal())
        if evidence.shows_a_stop(engaged_at):
            return now
    return None


@pytest.mark.parametrize('closing', [0.05, 0.1, 0.2])
@pytest.mark.parametrize('noise', [0.0, 1e-8, 5e-8])
def test_a_load_moves_it_and_a_brake_ends_that(closing, noise):
    for course in (lambda t: 3e-4 * min(t, closing), lambda t: -5e-3 * min(t, closing) ** 2):
        found = shown_after(course, noise)
        assert 0.3 <= found - closing <= max(0.3, 3.0 * closing) + 0.04


@pytest.mark.parametrize(('rate', 'closing'), [
    (1000, 0.1), (1000, 0.45), (1000, 0.6), (1000, 0.8), (1000, 3.0), (100, 2.4), (100, 6.0),
])
def test_however_many_readings_there_are_until_the_brake_has_closed(rate, closing):
    found = shown_after(
        lambda t: 1e-4 * min(t / closing, 1.0), 1e-8, 4.1 * closing + 0.3, period=1 / rate)
    assert max(0.3, 2.9 * closing) <= found - closing <= 3.05 * closing + 0.04


def ending(way, time):
    """Return how a limp drive moves by 30 um that comes to rest without a brake."""
    return {
        'spring': lambda t: 3e-5 * (1.0 - np.exp(-t / time)),
        'damped spring': lambda t: 3e-5 * (1.0 - (1.0 + t / time) * np.exp(-t / time)),
        'friction': lambda t: 3e-5 * (1.0 - max(1.0 - t / time, 0.0) ** 2),
        'swinging': lambda t: 3e-5 * np.sin(t / time),
        'swinging to rest': lambda t: 3e-5 * (1.0 - np.cos(t / time) * np.exp(-0.3 * t / time)),
        'falling on': lambda t: 3e-5 * t / time,
        'standing': lambda t: 0.0,
        # Down to the end of the stroke, 0.6 mm away.
        'at its end': lambda t: 0.57e-3 + 3e-5 * min(t / time, 1.0),
        # Before the brake was asked for.
        'too early': lambda t: 3e-5 * min(t / time, 0.01 / time),
        'from one reading to the next': lambda t: 3e-5 * (t > 0.02),
    }[way]


@pytest.mark.parametrize('noise', [0.0, 1e-7])
@pytest.mark.parametrize('way', [
    'spring', 'damped spring', 'friction', 'swinging', 'swinging to rest', 'falling on',
    'standing', 'at its end', 'too early', 'from one reading to the next',
])
def test_what_comes_to_rest_by_itself_is_not_held(way, noise):
    for time in (0.005, 0.02, 0.06, 0.2, 1.0):
        assert shown_after(ending(way, time), noise, seed=round(1e3 * time)) is None


@pytest.mark.parametrize('begin', [0.004, 0.013, 0.3, 1.0])
@pytest.mark.parametrize('way', ['spring', 'damped spring', 'friction', 'swinging to rest'])
def test_what_stands_first_and_slips_then_is_not_held(way, begin):
    """Standing before the motion makes its end no more abrupt, nor do few readings of it."""
    for period in (0.01, 0.05):
        for time in (0.024, 0.036, 0.06, 0.136, 0.2, 0.6):
            course = ending(way, time)
            for delay in (begin, begin + 0.7 * period):
                assert shown_after(
                    lambda t, course=course, delay=delay: course(max(t - delay, 0.0)),
                    seconds=4.0 * (time + delay) + 1.5, period=period) is None


def test_what_stands_first_and_is_stopped_then_is_held():
    found = shown_after(lambda t: 3e-4 * min(max(t - 0.3, 0.0), 0.1), seconds=3.0)
    assert found == pytest.approx(0.4 + 1.2, abs=0.04)


@pytest.mark.parametrize(('stroke', 'at'), [
    ((-np.inf, 0.6e-3), 0.57e-3), ((-0.6e-3, np.inf), -0.57e-3),
])
def test_nor_at_the_end_of_a_stroke_that_has_one_end_only(stroke, at):
    def course(now, start=at):
        return start + np.copysign(3e-5, start) * min(now / 0.06, 1.0)

    assert shown_after(course, stroke=stroke) is None
    assert shown_after(lambda now: course(now, -at), stroke=stroke)


def test_noise_alone_shows_nothing():
    assert all(shown_after(lambda _: 0.0, 1e-6, seed=seed) is None for seed in range(20))


class Braked:
    """The three-strut mirror, whose brakes close after a while and report nothing."""

    def __init__(self, engine, holds=True):
        self.plant = plant_named(engine, MIRROR, PlantSettings(), 1)
        self.supervisor = Supervisor(MIRROR, Settings(convert='act'))
        self.holds, self.closes, self.now = holds, np.inf, 0.0
        self.notices = []

    def run(self, seconds):
        supervisor, converter = self.supervisor, self.supervisor.converter
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            if self.now >= self.closes and self.holds:
                self.closes = np.inf
                self.plant.apply(fault_command(MIRROR, 'silent stuck theta_2'))
            seen = self.plant.step(PERIOD)
            angle, rate = (of(self.now) for of in (Circle(5e-4).angle, Circle(5e-4).rate))
            twist = PointingLoop().velocity(seen.pose, MIRROR.origin, angle, rate)
            supervisor.task_velocity(twist[MIRROR.task.rows], self.now)
            supervisor.joint_reading(seen.measured_values, self.now)
            output = supervisor.step(self.now)
            shown = converter.observe(output, self.now)
            if shown and supervisor.reports([shown], self.now):
                output = supervisor.step(self.now)
            self.plant.command(output.rates)
            if converter.consider(output, self.now) and converter.engaged:
                self.closes = self.now + 0.08
            self.notices.append(converter.overdue(self.now))
        return output

    def fail(self):
        self.plant.apply(fault_command(MIRROR, 'silent free theta_2'))
        assert report(self.supervisor, 'torque', 'theta_2', self.now).state is State.STOPPED


@pytest.mark.parametrize('engine', ENGINES)
@pytest.mark.parametrize('holds', [True, False])
def test_a_mirror_whose_brakes_report_nothing(engine, holds):
    if engine == 'mujoco':
        pytest.importorskip('mujoco')
    machine = Braked(engine, holds)
    assert machine.run(0.3).state is State.NOMINAL
    machine.fail()
    output = machine.run(0.8)
    assert output.state is (State.DEGRADED if holds else State.STOPPED)
    if holds:
        assert output.failures.stuck == ('theta_2',) and not output.failures.free
        # It gives way after all, and is not believed again.
        machine.plant.apply(fault_command(MIRROR, 'silent free theta_2'))
        assert machine.run(0.4).state is State.STOPPED
        machine.plant.apply(fault_command(MIRROR, 'silent stuck theta_2'))
        assert machine.run(0.5).state is State.STOPPED
    assert not any(machine.notices)


@pytest.mark.parametrize('failed', [['theta_2'], ['theta_2', 'theta_1'], ['theta_2', 'strut_3']])
@pytest.mark.parametrize(('way', 'time'), [
    ('friction', 0.06), ('friction', 0.2), ('damped spring', 0.01),
])
def test_steps_without_a_new_reading_show_nothing(way, time, failed):
    """Joint states at 20 Hz and a watchdog at 100: what is seen once has been read once."""
    counts = {}
    for steps in (1, 5):
        supervisor = Supervisor(MIRROR, Settings(convert='act', joint_state_timeout=9.0))
        converter, shown = supervisor.converter, []
        supervisor.joint_reading(np.zeros(3), 0.0)
        for name in failed:
            output = report(supervisor, 'hard' if 'strut' in name else 'torque', name, 0.0)
        converter.consider(output, 0.0)
        for number in range(1, 100):
            now = 0.01 * number
            if number % 5 == 0:
                place = ending(way, time)(max(now - 0.04, 0.0))
                values = np.array([0.1 * place, place, np.nan if 'strut_3' in failed else 0.0])
                assert supervisor.joint_reading(values, now) is None
            if number % (5 // steps) == 0:
                output = supervisor.step(now)
                shown.append(converter.observe(output, now))
        counts[steps] = sum(one is not None for one in shown)
        assert output.reading == 20
    assert counts == {1: 0, 5: 0}


@pytest.mark.parametrize('way', ['spring', 'friction', 'swinging', 'falling on'])
def test_nor_at_a_high_rate_for_a_long_time(way):
    for time in (0.1, 1.0):
        assert shown_after(ending(way, time), 1e-8, 7.0, period=1e-3) is None


def test_a_clock_set_back_neither_shows_nor_silences_anything():
    """Readings of another time are no evidence for this one; what stands now may be told now."""
    evidence = BrakeEvidence(MIRROR.actuators[1], MIRROR.characteristic_length)
    for now in np.arange(100.0, 100.05, PERIOD):
        evidence.add(now, 3e-4 * (now - 100.0))
    for now in np.arange(3.0, 5.0, PERIOD):
        evidence.add(now, 1.5e-5)
        assert not evidence.shows_a_stop(2.9)
    supervisor = Supervisor(MIRROR, Settings(convert='act', joint_state_timeout=9.0))
    converter, told = supervisor.converter, []
    for begin in (100.0, 3.0):
        for now in np.arange(begin, begin + 0.7, PERIOD):
            place = 3e-4 * min(now - begin, 0.1)
            supervisor.joint_reading(np.array([0.0, place, 0.0]), now, now)
            output = supervisor.step(now)
            if now == 100.0:
                output = report(supervisor, 'torque', 'theta_2', now)
            if converter.observe(output, now):
                told.append(now)
            converter.consider(output, now)
    assert told == pytest.approx([100.4, 3.4], abs=4.0 * PERIOD)


@pytest.mark.parametrize('step', [1e-9, 1e-7])
@pytest.mark.parametrize('dies', [None, 0.0, 0.05])
def test_an_encoder_with_steps_repeats_itself_where_the_brake_holds(step, dies):
    """Others change by a step now and then. What a dead encoder reads is no evidence."""
    supervisor = Supervisor(MIRROR, Settings(convert='act', joint_state_timeout=9.0))
    converter, told, sensorless = supervisor.converter, [], set()
    engages = 0.02 if dies is None else 0.15
    for number, now in enumerate(np.arange(0.0, 0.8, PERIOD)):
        place = 3e-4 * min(now, 0.1 if dies is None else dies)
        values = np.array([number % 2, round(place / step), number // 3 % 2]) * step
        supervisor.joint_reading(values, now)
        output = supervisor.step(now)
        if now == 0.0:
            output = report(supervisor, 'torque', 'theta_2', now)
        if converter.observe(output, now):
            told.append(now)
        if now >= engages:
            converter.consider(output, now)
        sensorless.update(output.sensorless)
    assert told == ([pytest.approx(0.4, abs=0.04)] if dies is None else [])
    # Where it is, the others do not tell; once it is stuck, its reading counts again.
    assert sensorless == {'theta_2'}
    if told:
        assert report(supervisor, 'position', 'theta_2', 0.8).failures.stuck
        supervisor.joint_reading(values, 0.8)
        output = supervisor.step(0.8)
        assert (output.state, output.sensorless) == (State.DEGRADED, ())
    assert converter.engaged == ('theta_2',)


def test_what_is_shown_is_told_once_a_second_until_it_is_heard():
    supervisor = Supervisor(MIRROR, Settings(convert='act', joint_state_timeout=9.0))
    converter, told = supervisor.converter, []
    for now in np.arange(0.0, 2.5, PERIOD):
        supervisor.joint_reading(np.array([0.0, 3e-4 * min(now, 0.1), 0.0]), now)
        output = supervisor.step(now)
        if now == 0.0:
            output = report(supervisor, 'torque', 'theta_2', now)
        shown = converter.observe(output, now)
        converter.consider(output, now)
        if shown:
            assert (shown.target, shown.mode) == ('theta_2', 'position')
            told.append(now)
    assert told == pytest.approx([0.4, 1.4, 2.4], abs=4.0 * PERIOD)


def test_what_has_not_moved_cannot_be_told():
    supervisor = Supervisor(MIRROR, Settings(convert='act', joint_state_timeout=9.0))
    converter = supervisor.converter
    supervisor.joint_reading(np.zeros(3), 0.0)
    supervisor.step(0.0)
    converter.consider(report(supervisor, 'torque', 'theta_2', 0.0), 0.0)
    for now in np.arange(0.01, 0.99, 0.02):
        supervisor.joint_reading(np.zeros(3), now)
        assert converter.observe(supervisor.step(now), now) is None
    assert converter.overdue(1.1).text == (
        'brake or release not confirmed within 1 s: theta_2; theta_2 did not move before, so '
        'readings do not tell')
