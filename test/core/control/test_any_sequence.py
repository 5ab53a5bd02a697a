# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whatever comes in, in whatever order and at whatever time: the promises hold in every cycle."""

from dataclasses import replace

import numpy as np
from core.control.control_cases import report
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from fault_tolerance.control.failure_reports import ERROR, OK, STALE
from fault_tolerance.control.parking import SPEED
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named

PARKED = {
    'mirror_4_strut': {'wx': 0.01, 'vz': -0.0003}, 'mirror_overactuated': {'wy': 0.01},
    'planar_4rpr': {'wz': 0.2},
}
MECHANISMS = {
    name: replace(mechanism_named(name), park=PARKED.get(name, {}))
    for name in ('fsm_4_strut', 'serial_3r', *PARKED)
}
WORDS = ('stuck', 'free', 'lost', 'none', 'none', 'jammed')
LEVELS = (OK, ERROR, ERROR, STALE, 200)
ANY = st.floats(allow_nan=True, allow_infinity=True)
SHARES = st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8)
MOVING = (State.NOMINAL, State.DEGRADED)


class Everything(RuleBasedStateMachine):
    """A supervisor, and whatever may happen to it."""

    @initialize(
        name=st.sampled_from(list(MECHANISMS)),
        auto_clear=st.booleans(),
        power=st.sampled_from([-3.0, 1.0, 9.0]),
    )
    def begin(self, name, auto_clear, power):
        self.mechanism = MECHANISMS[name]
        options = Settings(auto_clear=auto_clear, max_acceleration=10.0**power)
        self.supervisor = Supervisor(self.mechanism, options)
        self.now = 0.0
        self.output = self.supervisor.output
        self.stopped = False
        self.parts = (*self.mechanism.actuator_names, *self.mechanism.strut_names)
        limits = self.mechanism.position_limits
        self.stroke = np.where(np.isfinite(limits[:, 1]), limits[:, 1], 0.5)

    def stepped(self):
        """Step, and look at what has come of it."""
        self.output = self.supervisor.step(self.now)
        self.supervisor.watch()
        self.stopped = self.stopped or self.output.state is State.STOPPED

    @rule(seconds=st.sampled_from([0.0, 0.001, 0.004, 0.05, 0.2, 2.0, 3600.0, -0.5, -3600.0]))
    def time_passes(self, seconds):
        self.now += seconds
        self.stepped()

    @rule(shares=SHARES, size=st.sampled_from([1e-3, 0.3, 1.5]), age=st.sampled_from([0.0, 0.3]))
    def readings_come(self, shares, size, age):
        values = size * self.stroke * np.array(shares[: len(self.stroke)])
        self.supervisor.joint_reading(values, self.now, self.now - age)
        self.stepped()

    @rule()
    def readings_of_home_come(self):
        self.supervisor.joint_reading(np.zeros(len(self.stroke)), self.now)
        self.stepped()

    @rule(shares=SHARES, size=st.sampled_from([0.0, 1e-3, 1.0, 1e300]))
    def a_velocity_is_asked_for(self, shares, size):
        count = len(self.mechanism.task.coordinates)
        self.supervisor.task_velocity(size * np.array(shares[:count]), self.now)
        self.supervisor.joint_reading(np.zeros(len(self.stroke)), self.now)
        self.stepped()

    @rule(values=st.lists(ANY, min_size=1, max_size=8), velocity=st.booleans())
    def nonsense_comes(self, values, velocity):
        take = self.supervisor.task_velocity if velocity else self.supervisor.joint_reading
        take(np.array(values), self.now)
        self.stepped()

    @rule(
        reports=st.lists(
            st.tuples(
                st.sampled_from(WORDS), st.integers(0, 11), st.sampled_from(LEVELS),
                st.sampled_from(['drive', 'monitor']),
            ),
            min_size=1, max_size=3,
        ),
        age=st.sampled_from([None, 0.0, 5.0, -5.0]),
    )
    def parts_are_reported(self, reports, age):
        stamp = None if age is None else self.now - age
        self.supervisor.reports(
            [
                report(
                    word, self.parts[index % len(self.parts)],
                    level=level, name=name, stamp=stamp,
                )
                for word, index, level, name in reports
            ],
            self.now,
        )
        self.stepped()

    @rule(wait=st.sampled_from([0.0, 4.0]))
    def an_operator_clears(self, wait):
        self.now += wait
        self.supervisor.clear(self.now)
        self.stopped = False
        self.stepped()

    @rule(paused=st.booleans())
    def an_operator_pauses(self, paused):
        self.supervisor.pause(paused, self.now)
        self.stepped()

    @precondition(lambda self: self.output.state in MOVING)
    @rule()
    def everything_fails(self):
        names = self.mechanism.actuator_names
        self.supervisor.reports([report('stuck', name) for name in names], self.now)
        self.stepped()
        assert self.output.state is State.STOPPED

    @rule(halves=st.integers(1, 6))
    def it_stands_at_home_for_some_time(self, halves):
        for _ in range(8 * halves):
            self.now += 1.0 / 16.0
            self.readings_of_home_come()
            self.only_a_nominal_or_degraded_mechanism_moves_or_one_that_is_parked()

    @invariant()
    def every_number_is_finite(self):
        output = self.output
        assert output.rates.shape == (len(self.mechanism.actuators),)
        for array in (output.rates, output.achieved, output.residual):
            assert np.isfinite(array).all()
        command = output.command
        jumps = command.major_jump, command.rate_jump
        for number in (command.scale, command.secondary_scale, *jumps):
            assert np.isfinite(number)

    @invariant()
    def there_is_a_reason_and_it_is_no_internal_error(self):
        assert self.output.reason
        assert 'internal error' not in self.output.reason
        if self.supervisor.failures:
            assert self.output.reason != 'no failure'

    @invariant()
    def a_stop_stays_until_it_is_cleared(self):
        assert not self.stopped or self.output.state is State.STOPPED

    @invariant()
    def only_a_nominal_or_degraded_mechanism_moves_or_one_that_is_parked(self):
        if self.output.parking == 'parking':
            assert self.output.state is State.STOPPED
            assert self.output.estimate.post.verdict.stable
            slow = SPEED * self.mechanism.velocity_limits * (1.0 + 1e-9)
            assert (np.abs(self.output.rates) <= slow).all()
        elif self.output.state not in MOVING:
            assert not self.output.rates.any()
            assert not self.output.achieved.any()
        degraded = self.output.state is State.DEGRADED
        assert degraded == (self.output.state in MOVING and bool(self.output.failures))

    @invariant()
    def what_is_stuck_or_lost_gets_exactly_nothing(self):
        for name, rate in zip(self.mechanism.actuator_names, self.output.rates, strict=True):
            if self.output.failures.mode_of(self.mechanism, name).value in ('position', 'hard'):
                assert rate == 0.0

    @invariant()
    def the_command_is_a_motion_of_the_mechanism_within_its_limits(self):
        if not self.output.estimate.located:
            return
        present, rates = self.output.estimate.post.present, self.output.rates
        size = max(1.0, float(np.abs(rates).max()))
        active = rates[present.active]
        mapping = present.mapping[present.active]
        outside = active - mapping @ (mapping.T @ active)
        assert np.abs(outside).max(initial=0.0) <= 1e-12 * size
        assert (np.abs(rates) <= self.mechanism.velocity_limits * (1.0 + 1e-9)).all()


def test_any_sequence_of_inputs_keeps_the_promises():
    run_state_machine_as_test(
        Everything, settings=settings(deadline=None, max_examples=40, stateful_step_count=30)
    )
