# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Words for failures, and the set they make: one effective mode for each actuator."""

from itertools import permutations

import pytest
from core import cases
from core.mechanisms import by_numbers, guided_mirror, made

from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.failures import (
    Failure,
    FailureMode,
    FailureSet,
    failure_set,
    mode_from_word,
)

ALIASES = {
    FailureMode.POSITION: ['position', 'stuck', 'locked', 'Stuck', ' LOCKED '],
    FailureMode.TORQUE: ['torque', 'free', 'unactuated', 'TORQUE'],
    FailureMode.HARD: ['hard', 'lost', 'broken', 'Broken'],
    FailureMode.NONE: ['none', 'ok', 'healthy', 'clear', 'OK'],
}


@pytest.mark.parametrize(
    ('mode', 'word'), [(mode, word) for mode, words in ALIASES.items() for word in words])
def test_words(mode, word):
    assert mode_from_word(word) is mode


@pytest.mark.parametrize('word', ['', 'stuk', 'positional', 'hard failure', 'torque\x00', '0'])
def test_unknown_words(word):
    with pytest.raises(FailureError, match='unknown failure mode: .*; valid: position, stuck, '):
        mode_from_word(word)


def over(*failures):
    return failure_set(cases.named('fsm_overactuated'), failures)


def test_an_actuator_and_a_strut():
    assert over(('stuck', 'theta_2')) == FailureSet(stuck=('theta_2',))
    assert over(('free', 'strut_2')) == FailureSet(free=('theta_2',))
    assert over(('stuck', 'strut_1')) == FailureSet(stuck=('theta_1', 'theta_4', 'theta_5'))
    assert over(('lost', 'strut_3')) == FailureSet(lost=('strut_3',))
    assert over(('lost', 'theta_5')) == FailureSet(lost=('strut_1',))


def test_the_mechanisms_order_whatever_the_order_given():
    expected = FailureSet(('theta_1', 'theta_4'), ('theta_5',), ('strut_2', 'strut_3'))
    failures = [('lost', 'strut_3'), ('stuck', 'theta_4'), ('free', 'theta_5'),
                ('stuck', 'theta_1'), ('lost', 'theta_2')]
    for order in permutations(failures):
        assert over(*order) == expected
        assert hash(over(*order)) == hash(expected)


@pytest.mark.parametrize('order', list(permutations(['hard', 'position', 'torque', 'none'])))
def test_hard_over_position_over_torque(order):
    assert over(*((mode, 'theta_4') for mode in order)) == FailureSet(lost=('strut_1',))
    milder = [mode for mode in order if mode != 'hard']
    assert over(*((mode, 'theta_4') for mode in milder)) == FailureSet(stuck=('theta_4',))
    mildest = [mode for mode in milder if mode != 'position']
    assert over(*((mode, 'theta_4') for mode in mildest)) == FailureSet(free=('theta_4',))


def test_failures_in_a_lost_strut_do_not_count():
    everything = over(('stuck', 'strut_1'), ('free', 'theta_4'), ('hard', 'strut_1'))
    assert everything == FailureSet(lost=('strut_1',))
    assert len(everything) == 1 and bool(everything)


def test_nothing():
    assert not over() and not over(('ok', 'theta_1'), ('none', 'strut_2'))
    assert over() == FailureSet() and len(over()) == 0 and over().failures == ()


def test_single_failures_and_modes():
    mechanism = cases.named('fsm_overactuated')
    several = over(('free', 'theta_5'), ('stuck', 'theta_2'), ('hard', 'strut_3'))
    assert several.failures == (
        Failure(FailureMode.POSITION, 'theta_2'),
        Failure(FailureMode.TORQUE, 'theta_5'),
        Failure(FailureMode.HARD, 'strut_3'),
    )
    assert [str(failure) for failure in several.failures] == [
        'position:theta_2', 'torque:theta_5', 'hard:strut_3']
    modes = [several.mode_of(mechanism, name) for name in mechanism.actuator_names]
    none, position, torque, hard = (
        FailureMode.NONE, FailureMode.POSITION, FailureMode.TORQUE, FailureMode.HARD)
    assert modes == [none, position, hard, none, torque]
    assert failure_set(mechanism, [(each.mode, each.name) for each in several.failures]) == several


def test_further_failures():
    mechanism = cases.named('fsm_overactuated')
    more = over(('free', 'theta_5')).and_also(
        mechanism, Failure(FailureMode.HARD, 'strut_1'), Failure(FailureMode.POSITION, 'theta_3'))
    assert more == FailureSet(('theta_3',), (), ('strut_1',))


@pytest.mark.parametrize('word', ['stuck', 'hard', 'none'])
@pytest.mark.parametrize('name', ['theta_9', '', 'hinge_1', 'THETA_1', 'ball_1.x'])
def test_unknown_names(word, name):
    with pytest.raises(FailureError, match='neither an actuator nor a strut: ') as caught:
        over((word, name))
    assert caught.value.word == name
    assert caught.value.valid[:2] == ('theta_1', 'theta_2') and 'strut_3' in caught.value.valid


def test_a_strut_without_drives_cannot_be_stuck_but_can_be_lost():
    mechanism = made(guided_mirror())
    assert failure_set(mechanism, [('hard', 'guide')]) == FailureSet(lost=('guide',))
    with pytest.raises(FailureError, match="the strut has no actuator: 'guide'; valid: leg_1"):
        failure_set(mechanism, [('stuck', 'guide')])
    assert not failure_set(mechanism, [('ok', 'guide')])


def test_given_by_its_jacobian_nothing_can_be_lost():
    mechanism = made(by_numbers())
    assert failure_set(mechanism, [('free', 'theta_1')]) == FailureSet(free=('theta_1',))
    with pytest.raises(FailureError, match='given by its Jacobian has no struts, so none can be'):
        failure_set(mechanism, [('lost', 'theta_1')])
    with pytest.raises(FailureError, match='neither an actuator nor a strut'):
        failure_set(mechanism, [('lost', 'strut_1')])
