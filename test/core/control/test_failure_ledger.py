# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The ledger: failures latch by source, add up, are replaced, and are cleared."""

import itertools

import pytest
from core.control.control_cases import report
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.control.failure_ledger import CAPACITY, REPEAT_WINDOW, FailureLedger
from fault_tolerance.control.failure_reports import ERROR, OK, STALE, WARN
from fault_tolerance.control.settings import Settings
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.catalogue import mechanism_named

MECHANISM = mechanism_named('fsm_4_strut')
STUCK_4 = FailureSet(stuck=('theta_4',))


def ledger(**options) -> FailureLedger:
    return FailureLedger(MECHANISM, Settings(**options))


def reasons(update) -> list[str]:
    return [notice.reason for notice in update.notices]


def test_a_failure_is_in_force_from_its_report_on():
    book = ledger()

    assert book.apply([report('stuck', 'theta_4')], 0.0).changed
    assert book.failures == STUCK_4


def test_a_failure_stays_when_its_reporter_dies():
    book = ledger()
    book.apply([report('stuck', 'theta_4')], 0.0)
    book.apply([], 1e6)

    assert book.failures == STUCK_4


def test_repeats_change_nothing_and_are_not_worth_a_word():
    book = ledger()
    book.apply([report('stuck', 'theta_4', level=OK)], 0.0)

    for now in (0.1, 0.2, 1.2):
        update = book.apply([report('stuck', 'theta_4', level=OK)], now)
        assert not update
        assert update.notices == ()


def test_the_same_source_replaces_what_it_said():
    book = ledger()
    book.apply([report('stuck', 'theta_4')], 0.0)

    assert book.apply([report('free', 'theta_4')], 0.1)
    assert book.failures == FailureSet(free=('theta_4',))


def test_different_sources_add_up_and_the_worse_mode_counts():
    book = ledger()
    book.apply([report('stuck', 'theta_4', name='drive')], 0.0)
    assert not book.apply([report('free', 'theta_4', name='monitor')], 0.1)
    assert book.failures == STUCK_4

    assert book.apply([report('lost', 'theta_4', name='camera')], 0.2)
    assert book.failures == FailureSet(lost=('strut_4',))


@pytest.mark.parametrize('word', ['stuck', 'free', 'none'])
def test_what_changes_nothing_leaves_the_set_itself_in_place(word):
    # Parking, brakes and probes begin anew where the set is another one.
    book = ledger()
    book.apply([report('stuck', 'theta_4', name='drive')], 0.0)
    before = book.failures
    assert not book.apply([report(word, 'theta_4', name='monitor')], 0.1)
    assert book.failures is before


@pytest.mark.parametrize('order', list(itertools.permutations(['stuck', 'free', 'none'])))
def test_a_source_that_contradicts_itself_in_one_message_is_taken_at_its_worst(order):
    book = ledger()
    update = book.apply([report(word, 'theta_4') for word in order], 0.0)

    assert book.failures == STUCK_4
    assert update.changed
    again = book.apply([report(word, 'theta_4') for word in order], 0.5)
    assert not again.changed


def test_two_modes_for_one_actuator_in_one_message_are_warned_of():
    book = ledger()
    update = book.apply([report('free', 'theta_4'), report('stuck', 'strut_4')], 0.0)

    assert book.failures == STUCK_4
    assert reasons(update) == ['conflicting_modes']
    assert 'theta_4 is reported as position and torque' in update.notices[0].text
    assert not update.notices[0].rejected


def test_later_stamps_of_the_same_source_in_one_message_replace_earlier_ones():
    book = ledger()
    book.apply([report('stuck', 'theta_4', stamp=1.0), report('free', 'theta_4', stamp=1.1)], 1.2)

    assert book.failures == FailureSet(free=('theta_4',))


def test_health_releases_only_with_auto_clear():
    for auto_clear, left in ((False, STUCK_4), (True, FailureSet())):
        book = ledger(auto_clear=auto_clear)
        book.apply([report('stuck', 'theta_4')], 0.0)
        update = book.apply([report('none', 'theta_4', level=OK)], 0.1)

        assert book.failures == left
        assert update.changed is auto_clear
        assert reasons(update) == ([] if auto_clear else ['latched'])


def test_one_sources_health_does_not_release_what_another_reports():
    book = ledger(auto_clear=True)
    book.apply([report('stuck', 'theta_4')], 0.0)
    book.apply([report('none', 'theta_4', name='monitor', level=OK)], 0.1)
    book.apply([report('none', 'strut_4', level=OK)], 0.1)

    assert book.failures == STUCK_4


@pytest.mark.parametrize('word', ['stuck', 'none'])
def test_stale_neither_applies_nor_releases(word):
    book = ledger(auto_clear=True)
    book.apply([report('free', 'theta_4')], 0.0)
    update = book.apply([report(word, 'theta_4', level=STALE)], 0.1)

    assert not update
    assert reasons(update) == ['stale_report']
    assert book.failures == FailureSet(free=('theta_4',))


def test_an_unknown_mode_at_error_demands_a_stop_until_it_is_cleared():
    book = ledger()
    assert book.apply([report('jammed', 'theta_4')], 0.0)
    assert 'theta_4 (jammed)' in book.stop_reason
    assert book.failures == FailureSet()

    assert book.clear(1.0).remaining == ('theta_4 (jammed)',)
    assert book.stop_reason
    assert book.clear(3.0).released == ('theta_4 (jammed)',)
    assert not book.stop_reason


def test_an_unknown_mode_is_ignored_below_error_or_on_request():
    for options, level in (({}, WARN), ({'unknown_mode': 'ignore'}, ERROR)):
        book = ledger(**options)
        update = book.apply([report('jammed', 'theta_4', level=level)], 0.0)

        assert not update
        assert reasons(update) == ['unknown_mode']
        assert not book.stop_reason


def test_clear_releases_what_is_no_longer_reported_and_names_the_rest():
    book = ledger()
    book.apply([report('stuck', 'theta_4'), report('lost', 'strut_1')], 0.0)
    book.apply([report('lost', 'strut_1')], 2.0)
    cleared = book.clear(3.5)

    assert cleared.released == ('theta_4 (position)',)
    assert cleared.remaining == ('strut_1 (hard)',)
    assert book.failures == FailureSet(lost=('strut_1',))


@pytest.mark.parametrize(('age', 'released'), [(2.999, False), (3.0, True)])
def test_a_failure_is_still_reported_for_the_report_timeout(age, released):
    book = ledger(report_timeout=3.0)
    book.apply([report('stuck', 'theta_4', stamp=10.0)], 10.0)

    assert bool(book.clear(10.0 + age).released) is released


def test_a_failure_taken_back_is_not_still_reported():
    book = ledger()
    book.apply([report('stuck', 'theta_4')], 0.0)
    book.apply([report('none', 'theta_4', level=OK)], 0.1)

    assert book.clear(0.2).released == ('theta_4 (position)',)
    assert book.failures == FailureSet()


def test_a_failure_that_another_source_still_reports_is_not_called_released():
    book = ledger()
    book.apply([report('stuck', 'theta_4')], 0.0)
    book.apply([report('stuck', 'theta_4', name='monitor')], 3.5)
    cleared = book.clear(4.0)

    assert cleared.released == ()
    assert cleared.remaining == ('theta_4 (position)',)


def test_a_reporter_whose_clock_runs_ahead_does_not_block_a_clear_for_ever():
    book = ledger()
    book.apply([report('stuck', 'theta_4', stamp=3600.0)], 0.0)

    assert book.clear(3.0).released == ('theta_4 (position)',)


def test_a_report_from_before_the_clear_is_ignored_unless_it_is_repeated_later():
    book = ledger()
    book.apply([report('stuck', 'theta_4', stamp=0.0)], 0.0)
    book.clear(10.0)
    late = report('stuck', 'theta_4', stamp=9.9)

    update = book.apply([late], 10.0 + REPEAT_WINDOW)
    assert not update
    assert reasons(update) == ['before_clear']
    assert book.apply([late], 10.0 + REPEAT_WINDOW + 1e-3)
    assert book.failures == STUCK_4


def test_good_news_from_before_the_clear_counts_even_if_it_comes_late():
    book = ledger()
    book.apply([report('stuck', 'theta_4', stamp=9.0)], 9.0)
    assert book.clear(10.0).remaining == ('theta_4 (position)',)

    update = book.apply([report('none', 'theta_4', stamp=9.9)], 10.1)

    assert reasons(update) == ['latched']
    assert book.clear(10.2).released == ('theta_4 (position)',)


def test_a_report_from_after_the_clear_counts_at_once():
    book = ledger()
    book.clear(10.0)

    assert book.apply([report('stuck', 'theta_4', stamp=10.0)], 10.0)
    assert book.failures == STUCK_4


def test_a_clock_set_back_neither_ignores_reports_nor_keeps_them_current():
    book = ledger()
    book.apply([report('stuck', 'theta_4')], 1000.0)
    book.clear(1000.1)
    book.restart_clock(5.0)

    assert book.apply([report('free', 'theta_1')], 5.0)
    assert book.clear(8.0).remaining == ()


def test_what_is_not_finite_in_a_stamp_is_the_time_of_receipt():
    book = ledger()
    book.apply([report('stuck', 'theta_4', stamp=float('nan'))], 5.0)

    assert book.clear(7.9).remaining == ('theta_4 (position)',)
    assert book.clear(8.0).remaining == ()


def test_any_number_of_sources_takes_bounded_memory_and_loses_no_failure():
    book = ledger()
    for index in range(3 * CAPACITY):
        book.apply([report('free', 'theta_1', name=f'source {index}')], 0.0)
    book.apply([report('stuck', 'theta_4', name='one more')], 0.0)
    book.apply([report('free', 'theta_4', name='and another')], 0.0)
    book.apply([report('none', 'theta_4', name='a third', level=OK)], 0.0)

    assert book.failures == FailureSet(stuck=('theta_4',), free=('theta_1',))
    assert len(book._entries) <= CAPACITY + 20
    book.clear(10.0)
    assert book.failures == FailureSet()
    assert not book._entries


PARTS = (*MECHANISM.actuator_names, *MECHANISM.strut_names)
REPORTS = st.lists(
    st.builds(
        report,
        st.sampled_from(['stuck', 'free', 'lost']),
        st.sampled_from(PARTS),
        name=st.sampled_from(['drive', 'monitor']),
    ),
    max_size=8,
    unique_by=lambda one: one.source,
)


@settings(deadline=None, max_examples=60)
@given(REPORTS, st.randoms(use_true_random=False))
def test_the_order_of_reports_does_not_matter(reports, random):
    shuffled = list(reports)
    random.shuffle(shuffled)
    at_once, one_by_one = ledger(), ledger()
    at_once.apply(reports, 0.0)
    for number, one in enumerate(shuffled):
        one_by_one.apply([one], 0.1 * number)

    assert at_once.failures == one_by_one.failures


@settings(deadline=None, max_examples=60)
@given(REPORTS, REPORTS)
def test_a_message_is_idempotent_and_clearing_leaves_nothing(first, second):
    book = ledger()
    book.apply(first, 0.0)
    book.apply(second, 0.1)
    before = book.failures

    assert not book.apply(second, 0.2)
    assert book.failures == before
    book.clear(4.0)
    assert book.failures == FailureSet()
