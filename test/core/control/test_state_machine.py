# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The state machine: the most severe condition wins, and only a stop stays."""

import pytest

from fault_tolerance.control.state_machine import MOVING, State, StateMachine

FULL = {
    'stop': 'two stuck',
    'hold': 'paused',
    'waiting': 'no joint state yet',
    'degraded': 'one stuck',
    'nominal': 'no failure',
}
NONE = dict.fromkeys(('stop', 'hold', 'waiting', 'degraded'), '')


def decided(machine, **conditions):
    """Return the decision where the conditions given hold, and no others."""
    return machine.decide(**{**NONE, **conditions})


@pytest.mark.parametrize(
    ('leading', 'state'),
    [
        ('stop', State.STOPPED),
        ('hold', State.HOLD),
        ('waiting', State.WAITING),
        ('degraded', State.DEGRADED),
        ('nominal', State.NOMINAL),
    ],
)
def test_the_most_severe_condition_wins_with_its_reason(leading, state):
    names = list(FULL)
    present = {name: FULL[name] for name in names[names.index(leading) : -1]}
    decision = decided(StateMachine(), **present)

    assert decision.state is state
    assert decision.reason == FULL[leading]
    assert (decision.state in MOVING) is (state in (State.NOMINAL, State.DEGRADED))


@pytest.mark.parametrize('passing', ['hold', 'waiting', 'degraded'])
def test_everything_but_a_stop_passes_by_itself(passing):
    machine = StateMachine()
    decided(machine, **{passing: FULL[passing]})

    assert decided(machine).state is State.NOMINAL


def test_a_stop_stays_until_it_is_released():
    machine = StateMachine()
    decided(machine, stop='two stuck')

    decision = decided(machine)
    assert (decision.state, decision.reason) == (State.STOPPED, 'two stuck')
    assert decided(machine, hold='paused').state is State.STOPPED
    assert machine.release()
    assert not machine.release()
    assert decided(machine, degraded='one stuck').state is State.DEGRADED


def test_a_stop_whose_reason_still_holds_returns():
    machine = StateMachine()
    decided(machine, stop='two stuck')
    machine.release()

    assert decided(machine, stop='two stuck').state is State.STOPPED


def test_the_reason_of_a_stop_is_the_present_one():
    machine = StateMachine()
    decided(machine, stop='two stuck')

    assert decided(machine, stop='three stuck').reason == 'three stuck'


def test_states_are_published_as_these_words():
    assert {state.value for state in State} == {
        'waiting', 'nominal', 'degraded', 'hold', 'stopped'
    }
