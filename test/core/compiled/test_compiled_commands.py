# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The shortcuts to a command: the same command, output and state as by the long way."""

import numpy as np
import pytest
from core.cases import named
from core.compiled.test_compiled_kinematics import path, same
from core.control.control_cases import report
from core.mechanisms import by_numbers, made

from fault_tolerance.compiled.activation import Active
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.shortcut import Shortcut
from fault_tolerance.control.situation import Situation
from fault_tolerance.control.supervisor import Supervisor

pytestmark = pytest.mark.needs_numba

NAMES = ('fsm_3_strut', 'fsm_4_strut', 'mirror_4_strut', 'mirror_overactuated', 'fsm_overactuated',
         'gough_stewart_6', 'gough_stewart_8', 'planar_4rpr')


class Both:
    """One supervisor by the shortest way, one by the long one; what is told both must agree."""

    def __init__(self, mechanism, kernels, **settings):
        self.kernels = kernels
        self.pair = [Supervisor(mechanism, Settings(auto_clear=True, **settings)) for _ in 'ab']
        self.now = 0.0
        self.short = self.first = 0

    def each(self, do):
        """Return what both say."""
        Active.kernels = self.kernels
        try:
            one = do(self.pair[0])
        finally:
            Active.kernels = None
        return one, do(self.pair[1])

    def tell(self, do):
        one, other = self.each(do)
        assert one == other

    def step(self):
        """Step both, and compare everything that comes of it."""
        one, other = self.each(lambda each: each.step(self.now))
        assert (one.state, one.reason) == (other.state, other.reason)
        assert one.failures == other.failures
        scale = max(1e-9, float(np.abs(other.rates).max()))
        for name in ('rates', 'achieved', 'residual'):
            assert not getattr(one, name).flags.writeable
            assert not getattr(other, name).flags.writeable
            np.testing.assert_allclose(
                getattr(one, name), getattr(other, name), atol=1e-9 * scale, err_msg=name
            )
        same(one.scale, other.scale)
        same(one.secondary_scale, other.secondary_scale)
        for name in ('saturation', 'out_of_range', 'inconsistent', 'notices', 'input_lost'):
            assert getattr(one, name) == getattr(other, name), name
        same(one.jump.major, other.jump.major)
        same(one.jump.rates, other.jump.rates)
        assert (one.post is None) == (other.post is None)
        if one.post is not None:
            assert one.post.failures == other.post.failures
            assert one.post.present.mobility == other.post.present.mobility
            assert one.post.verdict == other.post.verdict
            same(one.configuration.pose, other.configuration.pose)
            same(one.configuration.misfit, other.configuration.misfit)
        assert self.pair[0].assessed_by == self.pair[1].assessed_by
        return one

    def move(self, values, velocity, seconds=0.01):
        self.now += seconds
        self.tell(lambda each: each.joint_reading(values, self.now))
        self.tell(lambda each: each.task_velocity(velocity, self.now))
        return self.step()

    def anticipate(self):
        self.each(lambda each: [None for _ in iter(each.anticipate, False)])

    def report(self, mode, name):
        self.now += 0.001
        self.tell(lambda each: each.reports([report(mode, name)], self.now).changed)
        return self.step()


@pytest.fixture
def taken(monkeypatch):
    """Return how often each shortcut was taken."""
    count = {'shortcut': 0, 'first': 0}

    def counted(cls, name, key):
        real = getattr(cls, name)

        def call(self, *given):
            found = real(self, *given)
            count[key] += found is not None
            return found

        monkeypatch.setattr(cls, name, call)

    counted(Shortcut, 'command', 'shortcut')
    counted(Situation, 'first_command', 'first')
    return count


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('acceleration', [1e-3, 1e3])
def test_through_failures_and_back(kernels, taken, name, acceleration):
    mechanism = named(name)
    both = Both(mechanism, kernels, max_acceleration=acceleration)
    count = len(mechanism.task.coordinates)
    rng = np.random.default_rng(2)
    velocity = 1e-3 * rng.normal(size=count)
    places = path(mechanism, size=0.01, count=40)
    words = ('position', 'torque', *(['hard'] if len(mechanism.struts) > 1 else []))
    for word in words:
        for drive in mechanism.actuator_names[:2]:
            for values in places[:4]:
                both.move(values, velocity)
            both.anticipate()
            both.report(word, drive)
            for values in places[4:8]:
                both.move(values, velocity)
            both.report('none', drive)
            both.each(lambda each: each.clear(both.now))
            both.step()
    if not mechanism.rates_alike:  # radians and metres: the long way
        assert not taken['shortcut'] + taken['first']
        return
    assert taken['shortcut'] >= 2 * len(words)
    # Those without redundancy tolerate none.
    assert taken['first'] or name in ('fsm_3_strut', 'gough_stewart_6')


@pytest.mark.parametrize('acceleration', [0.1, 10.0])
@pytest.mark.parametrize('major', [['wx'], ['wx', 'wy'], ['wx', 'wy', 'vz']], ids=len)
def test_a_mechanism_given_by_numbers(kernels, taken, major, acceleration):
    """It knows nothing of the twist outside its task."""
    document = by_numbers()
    document['task']['major'] = major
    mechanism = made(document)
    both = Both(mechanism, kernels, max_acceleration=acceleration)
    first = 0
    for mode in ('position', 'torque'):
        for name in mechanism.actuator_names:
            for _ in range(3):
                both.move(np.zeros(4), np.array([1e-3, -2e-3, 5e-4]))
            both.anticipate()
            output = both.report(mode, name)
            if mode == 'position':
                assert output.rates[mechanism.actuator_names.index(name)] == 0.0
            first += bool(output.rates.any())
            both.move(np.zeros(4), np.array([1e-3, -2e-3, 5e-4]))
            both.report('none', name)
            both.each(lambda each: each.clear(both.now))
            both.step()
    # Where all three coordinates are major, none may be stuck.
    assert taken['first'] == first == (8 if len(major) < 3 else 4)


@pytest.mark.parametrize('name', ['mirror_4_strut', 'gough_stewart_8'])
def test_the_arrays_of_a_shortcut_are_those_of_the_objects_made_of_it(
    kernels, monkeypatch, name
):
    given, real = [], Shortcut.command

    def command(self, *arguments):
        given.append(real(self, *arguments))
        return given[-1]

    monkeypatch.setattr(Shortcut, 'command', command)
    mechanism = named(name)
    both = Both(mechanism, kernels)
    for values in path(mechanism, size=0.01, count=8):
        both.move(values, np.full(len(mechanism.task.coordinates), 1e-3))
    found = [taken for taken in given if taken is not None]
    assert len(found) > 4
    for taken in found:
        post = taken.assessed().post
        for name, expected in (
            ('pose', taken.assessed().configuration.pose),
            ('drives', post.rows.actuator_rows),
            ('jacobian', post.present.jacobian),
            ('mapping', post.present.mapping),
            ('rates', taken.rates),
        ):
            np.testing.assert_array_equal(taken.part(name), expected)


def test_what_does_not_fit_is_declined(kernels):
    """Nothing is read or written beyond an array."""
    drives, task, part, mobility = 4, 3, 2, 2
    effects = drives + 6 + part
    prepared = np.ones(
        2 + 3 * drives + mobility * (2 * task + drives + part + mobility + effects)
    )
    out = np.zeros(3 * (drives + 6) + 2 * part + 4 * mobility + 2)
    motion = np.zeros(drives), np.full(task, 1e-3), np.zeros(drives), np.zeros(part), 1.0
    prepared[2:14] = 1e3
    assert kernels.begin(prepared, mobility, *motion, out) == 1
    for wrong in (prepared[:-1], np.append(prepared, 0.0)):
        assert kernels.begin(wrong, mobility, *motion, out) == 0
    for wrong in (out[:-1], np.append(out, 0.0)):
        assert kernels.begin(prepared, mobility, *motion, wrong.copy()) == 0


def test_a_first_command_stays_as_it_was_given(kernels, taken):
    """Also when what had been anticipated is used once more, for other velocities."""
    mechanism = named('mirror_4_strut')
    both = Both(mechanism, kernels)
    values = path(mechanism, size=0.01, count=2)[1]
    given = []
    for factor in (1.0, -2.0, 3.0):
        both.move(values, factor * np.array([1e-3, 7e-4, 0.0]))
        if factor == 1.0:
            both.anticipate()
        found = both.report('position', 'theta_4')
        given.append((found, found.rates.copy(), found.achieved.copy()))
        both.report('none', 'theta_4')
    assert taken['first'] == 3
    for found, rates, achieved in given:
        np.testing.assert_array_equal(found.rates, rates)
        np.testing.assert_array_equal(found.achieved, achieved)
        assert found.rates[3] == 0.0
        assert found.rates.any()


@pytest.mark.parametrize('name', ['mirror_4_strut', 'gough_stewart_8'])
@pytest.mark.parametrize('seed', range(15))
def test_whatever_comes(kernels, name, seed):
    mechanism = named(name)
    rng = np.random.default_rng(seed)
    both = Both(mechanism, kernels, max_acceleration=10.0 ** rng.uniform(-3, 2))
    count = len(mechanism.task.coordinates)
    parts = (*mechanism.actuator_names, *mechanism.strut_names)
    places = path(mechanism, size=10.0 ** rng.uniform(-3, -0.5), count=60)
    place, velocity = 0, np.zeros(count)
    for _ in range(80):
        what = rng.integers(12)
        if what < 6:
            place = (place + int(rng.integers(1, 3))) % len(places)
            both.move(places[place], velocity, float(rng.choice([1e-3, 1e-2, 0.3])))
        elif what == 6:
            velocity = 10.0 ** rng.uniform(-4, 2) * rng.normal(size=count) * rng.integers(0, 2)
        elif what == 7:
            both.anticipate()
        elif what == 8:
            word = str(rng.choice(['position', 'torque', 'hard', 'none', 'none', 'none']))
            both.report(word, parts[rng.integers(len(parts))])
        elif what == 9:
            both.tell(lambda each: each.clear(both.now).success)
        elif what == 10:
            paused = bool(rng.integers(4) == 0)
            both.tell(lambda each, paused=paused: each.pause(paused, both.now))
        else:
            both.now += 0.05
            both.step()


def test_at_the_limits_the_long_way_is_taken(kernels, taken):
    """What would be too fast, or beyond a stroke, is slowed down as it always is."""
    mechanism = named('mirror_4_strut')
    both = Both(mechanism, kernels)
    fast = np.array([50.0, 20.0, 0.0])
    for values in path(mechanism, count=5):
        output = both.move(values, fast)
    assert output.saturation
    assert not taken['shortcut']


def test_an_error_after_the_command_brings_it_to_rest(kernels, monkeypatch):
    mechanism = named('mirror_4_strut')
    supervisor = Supervisor(mechanism)
    Active.kernels = kernels
    try:
        for number, values in enumerate(path(mechanism, count=4)):
            now = 0.01 * number
            supervisor.joint_reading(values, now)
            supervisor.task_velocity(np.array([1e-3, 0.0, 0.0]), now)
            supervisor.step(now)
        supervisor.joint_reading(path(mechanism, count=5)[1], 0.05)
        monkeypatch.setattr(Situation, 'prepare', lambda self, *, moves: 1 / 0)
        assert supervisor.command(0.05).rates.any()
        output = supervisor.settled()
    finally:
        Active.kernels = None
    assert 'internal error' in output.reason
    assert not output.rates.any()
