# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Transitions: no bump at a failure, a clearing, a resumption; ends are ends at once."""

from itertools import pairwise

import numpy as np
import pytest
from core.control.control_cases import fed, feed, report
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st

from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names

FSM = mechanism_named('fsm_4_strut')
PERIOD, LONG = 0.001, 1e4
ASKED = [0.01, 0.02, 0.0]
STUCK_4 = np.array([-1, -4, -3, 0]) * 0.01 / np.sqrt(2)
NOMINAL = np.array([1, -2, -1, 2]) * 0.01 / np.sqrt(2)


class Run:
    """A supervisor at home that is asked for one velocity, stepped at 1 kHz."""

    def __init__(self, mechanism=FSM, asked=ASKED, **options) -> None:
        self.supervisor: Supervisor = fed(mechanism, **options)
        self.asked = np.asarray(asked, dtype=float)
        self.now = 0.0

    def step(self, period=PERIOD):
        self.now += period
        feed(self.supervisor, self.now, self.asked)
        return self.supervisor.step(self.now)

    def steps(self, count):
        return [self.step() for _ in range(count)]

    def settled(self):
        """Return the output that nothing changes any more."""
        for _ in range(1000):
            before = self.supervisor.output.rates
            output = self.step()
            if (output.rates == before).all():
                return output
        raise AssertionError('it never settles')

    def fail(self, *failures):
        self.supervisor.reports([report(*failure) for failure in failures], self.now)

    def release(self):
        self.fail(*(('none', target) for target in self.supervisor.failures.stuck))
        assert self.supervisor.clear(self.now).success


def scales(mechanism):
    """Return what makes task velocities and rates metres per second, written out by hand."""
    length = mechanism.characteristic_length
    turning = np.array([name[0] == 'w' for name in mechanism.task.coordinates])
    kinds = np.array([actuator.kind == 'revolute' for actuator in mechanism.actuators])
    return np.where(turning, length, 1.0), np.where(kinds, length, 1.0)


def jumps(mechanism, before, after):
    """Return by how much major velocity and rates differ, m/s."""
    twist_scale, rate_scale = scales(mechanism)
    change = (after.achieved - before.achieved)[mechanism.task.rows] * twist_scale
    major = change[mechanism.task.major_rows]
    return np.linalg.norm(major), np.linalg.norm(rate_scale * (after.rates - before.rates))


def test_after_a_clear_the_secondary_motion_is_eased_in_and_the_major_task_goes_on():
    run = Run(max_acceleration=1.0)
    run.settled()
    run.fail(('stuck', 'theta_4'))
    before = run.settled()
    np.testing.assert_allclose(before.rates, STUCK_4, atol=1e-12)
    run.release()
    outputs = [before, *run.steps(40)]

    changes = [np.linalg.norm(b.rates - a.rates) for a, b in pairwise(outputs)]
    assert max(changes) <= 1.0 * PERIOD * (1.0 + 1e-9)
    for output in outputs:
        np.testing.assert_allclose(output.achieved[:2], ASKED[:2], atol=1e-12)
    # The rates change by twice the piston's velocity, 28.3 mm/s: 29 steps of 1 mm/s.
    way = 2.0 * abs(before.achieved[5])
    assert way == pytest.approx(0.02 * np.sqrt(2.0))
    for number in (1, 14, 28):
        left = 1.0 - number * PERIOD / way
        assert outputs[number].achieved[5] == pytest.approx(left * before.achieved[5], abs=1e-12)
    np.testing.assert_array_equal(outputs[30].rates, outputs[40].rates)
    np.testing.assert_allclose(outputs[40].rates, NOMINAL, atol=1e-15)


def test_at_a_failure_the_major_task_is_followed_from_the_first_command_on():
    run = Run(max_acceleration=1e-3)
    run.settled()
    run.fail(('stuck', 'theta_4'))
    first = run.step()

    np.testing.assert_allclose(first.rates, STUCK_4, atol=1e-12)
    assert first.rates[3] == 0.0
    assert first.command.major_jump == pytest.approx(0.0, abs=1e-12)
    assert first.command.rate_jump == pytest.approx(np.linalg.norm(STUCK_4 - NOMINAL))


def test_a_resumption_starts_from_rest_in_the_direction_asked_for():
    run = Run(max_acceleration=2.0)
    target = run.settled()
    run.supervisor.pause(True, run.now)
    assert not run.step().rates.any()
    run.supervisor.pause(False, run.now)
    outputs = run.steps(20)

    for number, output in enumerate(outputs[:5], start=1):
        share = min(1.0, number * 2.0 * PERIOD / np.linalg.norm(NOMINAL))
        np.testing.assert_allclose(output.rates, share * target.rates, atol=1e-12)
        assert output.state is State.NOMINAL
        np.testing.assert_allclose(
            output.residual, run.asked - output.achieved[[0, 1, 5]], atol=1e-12
        )
    np.testing.assert_array_equal(outputs[-1].rates, target.rates)
    assert outputs[-1].command.rate_jump == pytest.approx(2.0 * PERIOD)
    twist_scale, _ = scales(FSM)
    first = outputs[0].achieved[[0, 1]] * twist_scale[:2]
    assert outputs[-1].command.major_jump == pytest.approx(np.linalg.norm(first))
    metrics = run.supervisor.metrics()
    assert (metrics.major_jump, metrics.rate_jump) == (
        outputs[-1].command.major_jump, outputs[-1].command.rate_jump
    )


def test_a_resumption_without_a_task_velocity_is_eased_when_there_is_one():
    run = Run(max_acceleration=1.0)
    run.settled()
    run.supervisor.pause(True, run.now)
    run.step()
    run.supervisor.pause(False, run.now)
    run.asked = np.zeros(3)
    run.steps(5)
    run.asked = np.array(ASKED)

    assert np.linalg.norm(run.step().rates) == pytest.approx(1.0 * PERIOD)


def test_what_is_asked_for_between_transitions_is_given_at_once():
    run = Run(max_acceleration=1e-3)
    run.settled()
    run.asked = -10.0 * run.asked
    output = run.step()

    np.testing.assert_allclose(output.achieved[:2], run.asked[:2], atol=1e-12)


@pytest.mark.parametrize('end', ['stop', 'pause', 'rest', 'silence'])
def test_an_end_does_not_wait_for_a_transition(end):
    run = Run(max_acceleration=0.1)
    run.settled()
    run.supervisor.pause(True, run.now)
    run.step()
    run.supervisor.pause(False, run.now)
    assert run.steps(3)[-1].rates.any()
    if end == 'stop':
        run.fail(('stuck', 'theta_1'), ('stuck', 'theta_4'))
    elif end == 'pause':
        run.supervisor.pause(True, run.now)
    elif end == 'rest':
        run.asked = np.zeros(3)
    else:
        run.now += run.supervisor.settings.command_timeout + PERIOD
        feed(run.supervisor, run.now)
        assert not run.supervisor.step(run.now).rates.any()
        return

    assert not run.step().rates.any()


def test_without_a_limit_the_target_is_given_at_once():
    run = Run(max_acceleration=1e9)
    target = run.settled()
    run.fail(('stuck', 'theta_4'))
    run.settled()
    run.release()

    np.testing.assert_array_equal(run.step().rates, target.rates)


def test_a_clock_that_stands_still_moves_nothing_and_divides_by_nothing():
    run = Run(max_acceleration=1.0)
    run.settled()
    run.supervisor.pause(True, run.now)
    run.step()
    run.supervisor.pause(False, run.now)
    output = run.supervisor.step(run.now)

    assert output.state is State.NOMINAL
    assert not output.rates.any()
    assert 'internal error' not in output.reason


FAILURES = st.tuples(st.sampled_from(['stuck', 'free', 'lost']), st.integers(0, 7))


@settings(deadline=None, max_examples=40, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(
    st.sampled_from(shipped_names()),
    st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12),
    st.lists(FAILURES, max_size=2),
    st.lists(FAILURES, min_size=1, max_size=2),
    st.sampled_from(['failure', 'clear', 'resume']),
    st.floats(-2.0, 3.0),
)
def test_no_velocity_jumps_more_than_without_easing(name, asked, early, late, kind, power):
    """At any transition, whatever is asked for before and after it."""
    mechanism = mechanism_named(name)
    count, size = len(mechanism.task.coordinates), 0.1 * mechanism.characteristic_length
    parts = mechanism.actuator_names
    first, then = size * np.array(asked[:count]), size * np.array(asked[6 : 6 + count])
    found = []
    for acceleration in (10.0**power, 1e9):
        run = Run(mechanism, first, max_acceleration=acceleration)
        run.fail(*((mode, parts[index % len(parts)]) for mode, index in early))
        # After hours any transition is over: the way there is the same for both.
        before = [run.step(LONG), run.step(LONG)][-1]
        if kind == 'failure':
            run.fail(*((mode, parts[index % len(parts)]) for mode, index in late))
        elif kind == 'clear':
            run.now += 10.0
            run.supervisor.clear(run.now)
            before = run.supervisor.output
        else:
            run.supervisor.pause(True, run.now)
            before = run.step()
            run.supervisor.pause(False, run.now)
        run.asked = then
        after = run.step()
        assume(after.state is not State.STOPPED)
        found.append(jumps(mechanism, before, after))

        kinematics = after.estimate.post.present
        active = after.rates[kinematics.active]
        mapping = kinematics.mapping[kinematics.active]
        inside = mapping @ (mapping.T @ active)
        np.testing.assert_allclose(active, inside, atol=1e-12)
        limits = mechanism.velocity_limits
        assert (np.abs(after.rates) <= limits * (1.0 + 1e-9)).all()
        for index, actuator in enumerate(mechanism.actuator_names):
            if after.failures.mode_of(mechanism, actuator).value in ('position', 'hard'):
                assert after.rates[index] == 0.0
        # What is too slow to be squared is an end of motion, not a transition.
        moves = np.linalg.norm(after.rates) > 0.0
        if moves and (kind != 'failure' or after.failures != before.failures):
            told = [after.command.major_jump, after.command.rate_jump]
            np.testing.assert_allclose(told, found[-1], rtol=1e-9, atol=1e-12)
        assert all(not step.reason.startswith('internal error') for step in (after, run.step()))

    (major, rates), (major_without, rates_without) = found
    assert major <= major_without * (1.0 + 1e-6) + 1e-12
    assert rates <= rates_without * (1.0 + 1e-6) + 1e-12
