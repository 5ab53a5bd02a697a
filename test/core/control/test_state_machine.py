# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The state machine: the most severe condition wins, and only a stop stays."""

import pytest

from fault_tolerance.control.recovery import Conditions, State, StateMachine

FULL = {
    'stop': 'two stuck',
    'hold': 'paused',
    'waiting': 'no joint state yet',
    'degraded': 'one stuck',
    'nominal': 'no failure',
}


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
    present = {name: FULL[name] for name in names[names.index(leading) :]}
    decision = StateMachine().decide(Conditions(**present))

    assert decision.state is state
    assert decision.reason == FULL[leading]
    assert decision.moves is (state in (State.NOMINAL, State.DEGRADED))


@pytest.mark.parametrize('passing', ['hold', 'waiting', 'degraded'])
def test_everything_but_a_stop_passes_by_itself(passing):
    machine = StateMachine()
    machine.decide(Conditions(**{passing: FULL[passing]}))

    assert machine.decide(Conditions(nominal='no failure')).state is State.NOMINAL


def test_a_stop_stays_until_it_is_released():
    machine = StateMachine()
    machine.decide(Conditions(stop='two stuck'))

    decision = machine.decide(Conditions(nominal='no failure'))
    assert (decision.state, decision.reason) == (State.STOPPED, 'two stuck')
    assert machine.decide(Conditions(hold='paused')).state is State.STOPPED
    assert machine.release()
    assert not machine.release()
    assert machine.decide(Conditions(degraded='one stuck')).state is State.DEGRADED


def test_a_stop_whose_reason_still_holds_returns():
    machine = StateMachine()
    machine.decide(Conditions(stop='two stuck'))
    machine.release()

    assert machine.decide(Conditions(stop='two stuck')).state is State.STOPPED


def test_the_reason_of_a_stop_is_the_present_one():
    machine = StateMachine()
    machine.decide(Conditions(stop='two stuck'))

    assert machine.decide(Conditions(stop='three stuck')).reason == 'three stuck'


def test_states_are_published_as_these_words():
    assert {state.value for state in State} == {
        'waiting', 'nominal', 'degraded', 'hold', 'stopped'
    }
