# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Floods of diagnostics cost a bounded number of decodings, and no report of ours is lost."""

from __future__ import annotations

from fault_tolerance.nodes.inbox import MOST_BYTES, ReportInbox


def report(text: str) -> bytes:
    return b'failure_mode ' + text.encode()


def drained(inbox: ReportInbox) -> list[bytes]:
    return list(iter(inbox.next, None))


def test_what_cannot_be_a_report_is_left_aside():
    inbox = ReportInbox()
    inbox.put(b'battery 12 V', 0.0)
    assert drained(inbox) == []
    assert inbox.dropped == 0


def test_a_repeat_is_left_aside_for_half_a_second():
    inbox = ReportInbox()
    for now in (0.0, 0.1, 0.4, 0.6):
        inbox.put(report('a'), now)
    assert drained(inbox) == [report('a'), report('a')]


def test_a_repeat_is_news_after_something_changed():
    inbox = ReportInbox()
    inbox.put(report('a'), 0.0)
    inbox.forget()
    inbox.put(report('a'), 0.1)
    assert drained(inbox) == [report('a'), report('a')]


def test_a_few_are_decoded_at_a_time_in_the_order_they_came():
    inbox = ReportInbox()
    for number in range(10):
        inbox.put(report(str(number)), 0.0)
    first = drained(inbox)
    inbox.renew()
    second = drained(inbox)
    assert 0 < len(first) < 10
    assert first + second == [report(str(number)) for number in range(len(first) + len(second))]


def test_a_flood_is_bounded_and_counted():
    inbox = ReportInbox()
    for number in range(1000):
        inbox.put(report(str(number)), 0.0)
    taken = []
    while batch := drained(inbox):
        taken += batch
        inbox.renew()
    assert len(taken) + inbox.dropped == 1000
    assert len(taken) < 100
    assert taken[-1] == report('999')


def test_a_message_of_absurd_length_is_left_aside():
    inbox = ReportInbox()
    inbox.put(report('x' * MOST_BYTES), 0.0)
    assert drained(inbox) == []
    assert inbox.dropped == 1
