# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The words that break the simulated mechanism, and what its drives report."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_cases import BY_NUMBERS, MECHANISMS

from fault_tolerance.errors import FailureError
from fault_tolerance.mechanism.failure_modes import MISBEHAVIOURS, mode_from_word, mode_words
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.simulation.faults import FAULT_WORDS, FaultBook, FaultCommand, fault_command

FOUR = MECHANISMS['fsm_4_strut']
OVER = MECHANISMS['fsm_overactuated']
NUMBERS = mechanism_from_text(BY_NUMBERS)
THETAS = ('theta_1', 'theta_2', 'theta_3', 'theta_4')
STRUTS = ('strut_1', 'strut_2', 'strut_3', 'strut_4')


@pytest.mark.parametrize(
    ('text', 'mode', 'targets'),
    [
        ('position theta_4', 'position', ('theta_4',)),
        ('theta_4 position', 'position', ('theta_4',)),
        ('torque strut_2', 'torque', ('theta_2',)),
        ('strut_2 free', 'torque', ('theta_2',)),
        ('hard strut_3', 'hard', ('strut_3',)),
        ('lost theta_3', 'hard', ('strut_3',)),
        ('position all', 'position', THETAS),
        ('all hard', 'hard', STRUTS),
        ('ok theta_1', 'none', ('theta_1', 'strut_1')),
        ('ok strut_1', 'none', ('theta_1', 'strut_1')),
        ('ok all', 'none', (*THETAS, *STRUTS)),
        ('  STUCK   theta_1\n', 'position', ('theta_1',)),
        ('frozen theta_4', 'frozen', ('theta_4',)),
        ('strut_4 encoder', 'frozen', ('theta_4',)),
        ('biased all', 'biased', THETAS),
        ('Weak strut_2', 'weak', ('theta_2',)),
        ('theta_2 reversed', 'reversed', ('theta_2',)),
        ('runaway theta_1', 'runaway', ('theta_1',)),
    ],
)
def test_grammar(text, mode, targets):
    assert fault_command(FOUR, text) == FaultCommand(mode, targets)


def test_a_strut_stands_for_all_its_actuators():
    actuators = ('theta_1', 'theta_4', 'theta_5')
    assert fault_command(OVER, 'position strut_1').targets == actuators
    assert fault_command(OVER, 'hard theta_5').targets == ('strut_1',)
    assert fault_command(OVER, 'ok strut_1').targets == (*actuators, 'strut_1')
    assert fault_command(OVER, 'ok theta_4').targets == ('theta_4', 'strut_1')


@pytest.mark.parametrize('word', FAULT_WORDS)
def test_aliases_in_either_order_and_case(word):
    expected = fault_command(FOUR, f'{FAULT_WORDS[word]} strut_1')
    assert fault_command(FOUR, f'{word} strut_1') == expected
    assert fault_command(FOUR, f'strut_1 {word.upper()}') == expected


def test_the_simulator_and_the_controller_know_the_same_words():
    shared = {word: mode_from_word(word).value for word in mode_words()}
    assert shared.items() <= FAULT_WORDS.items()
    assert FAULT_WORDS.keys() - shared.keys() == MISBEHAVIOURS.keys()


def test_silent_comes_first():
    assert fault_command(FOUR, 'silent torque theta_1').silent
    assert fault_command(FOUR, 'Silent theta_1 torque').silent
    assert not fault_command(FOUR, 'torque theta_1').silent


@pytest.mark.parametrize(
    ('text', 'reason', 'named'),
    [
        ('', 'expected .* a mode and a name', 'position'),
        ('position', 'expected .* a mode and a name', 'theta_1'),
        ('silent', 'expected .* a mode and a name', 'all'),
        ('position theta_1 theta_2', 'expected .* a mode and a name', 'stuck'),
        ('position silent theta_1', 'expected .* a mode and a name', 'stuck'),
        ('jammed theta_1', "unknown mode: 'jammed'", 'locked'),
        ('theta_1 jammed', "unknown mode: 'jammed'", 'locked'),
        ('jammed theta_9', "unknown mode: 'jammed'", 'locked'),
        ('position theta_9', "unknown actuator or strut: 'theta_9'", 'theta_4'),
        ('theta_9 position', "unknown actuator or strut: 'theta_9'", 'strut_4'),
        ('position hard', "unknown actuator or strut: 'hard'", 'all'),
        ('position hinge_1', "unknown actuator or strut: 'hinge_1'", 'all'),
    ],
)
def test_bad_words_are_refused_with_the_valid_ones(text, reason, named):
    with pytest.raises(FailureError, match=reason) as caught:
        fault_command(FOUR, text)
    assert named in caught.value.valid
    assert named in str(caught.value)


@pytest.mark.parametrize('name', ['a', 'all'])
def test_a_mechanism_given_by_numbers_has_no_strut_to_lose(name):
    with pytest.raises(FailureError, match='no strut can be lost'):
        fault_command(NUMBERS, f'hard {name}')
    assert fault_command(NUMBERS, f'ok {name}').targets[0] == 'a'


def test_a_megabyte_makes_a_short_message():
    with pytest.raises(FailureError, match='unknown mode') as caught:
        fault_command(FOUR, 'x' * 1_000_000 + ' theta_1')
    assert len(str(caught.value)) < 300


WORDS = st.sampled_from([*FAULT_WORDS, *THETAS, 'silent', 'all', 'x'])


@settings(deadline=None)
@given(st.one_of(st.text(), st.lists(WORDS, max_size=4).map(' '.join)))
def test_any_text_is_understood_or_refused(text):
    try:
        command = fault_command(FOUR, text)
    except FailureError as error:
        assert error.valid
    else:
        assert command.targets
        assert set(command.targets) <= {*THETAS, *STRUTS}


def book_after(*texts):
    book = FaultBook()
    for text in texts:
        book = book.after(fault_command(FOUR, text))
    return dict(book.reports)


def test_drives_report_what_happens_to_them():
    assert book_after('position theta_4') == {'theta_4': 'position'}
    assert book_after('position theta_4', 'hard strut_1') == {
        'theta_4': 'position',
        'strut_1': 'hard',
    }
    assert book_after('position theta_4', 'torque theta_4') == {'theta_4': 'torque'}


def test_a_mended_fault_is_reported_as_none():
    assert book_after('position theta_4', 'ok theta_4') == {'theta_4': 'none'}
    assert book_after('hard strut_3', 'ok theta_3') == {'strut_3': 'none'}
    assert book_after('torque strut_3', 'hard strut_3', 'ok strut_3') == {
        'theta_3': 'none',
        'strut_3': 'none',
    }


@pytest.mark.parametrize('word', ['frozen', 'encoder', 'biased', 'weak', 'reversed'])
def test_a_drive_better_left_alone_is_reported_as_stuck(word):
    assert book_after(f'{word} theta_4') == {'theta_4': 'position'}
    assert book_after(f'{word} strut_4', 'ok all') == {'theta_4': 'none'}


def test_no_mode_stands_for_a_drive_that_runs_away():
    assert book_after('runaway theta_4') == {'theta_4': 'runaway'}
    with pytest.raises(FailureError):
        mode_from_word('runaway')
    assert book_after('runaway theta_4', 'stuck theta_4') == {'theta_4': 'position'}


@pytest.mark.parametrize(
    ('drive', 'reported'),
    [('free', 'position'), ('stuck', 'position'), ('runaway', 'runaway')],
)
def test_of_drive_and_encoder_the_graver_fault_is_reported(drive, reported):
    for words in ([f'{drive} theta_4', 'frozen theta_4'], ['frozen theta_4', f'{drive} theta_4']):
        assert book_after(*words) == {'theta_4': reported}
        assert book_after(*words, 'ok theta_4') == {'theta_4': 'none'}
    book = FaultBook()
    for words in ('stuck theta_4', 'biased theta_4', 'weak theta_2'):
        book = book.after(fault_command(FOUR, words))
    assert dict(book.faults) == {'theta_4': 'position', 'theta_2': 'weak'}


def test_silent_faults_are_never_reported_nor_their_mending():
    assert book_after('silent position theta_4') == {}
    assert book_after('silent position theta_4', 'ok theta_4') == {}
    assert book_after('silent hard all', 'ok all') == {}
    assert book_after('silent runaway all', 'silent frozen all', 'ok all') == {}


def test_a_silent_fault_does_not_change_an_earlier_report():
    assert book_after('torque theta_4', 'silent position theta_4') == {'theta_4': 'torque'}
    assert book_after('torque theta_4', 'ok all', 'silent position theta_4') == {'theta_4': 'none'}


def test_mending_what_was_whole_reports_nothing():
    assert book_after('ok all') == {}


def test_a_repetition_leaves_the_book_equal():
    command = fault_command(FOUR, 'position strut_4')
    book = FaultBook().after(command)
    assert book.after(command) == book
    assert book != FaultBook()
