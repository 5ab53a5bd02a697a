# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Floods of diagnostics cost a bounded number of decodings, and no report of ours is lost."""

from __future__ import annotations

import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import serialize_message

from fault_tolerance.nodes.diagnostics_queue import (
    BURST,
    MAX_BYTES,
    MAX_DEBT,
    SHARE,
    DiagnosticsQueue,
)

NAMES = ('theta_1', 'strut_1')


def report(text: str, name: str = 'theta_1') -> bytes:
    return f'failure_mode {name} {text}'.encode()


def drained(queue: DiagnosticsQueue, now: float = 0.0, cost: float = 0.0) -> list[bytes]:
    """Return what the queue gives out, each message read in ``cost`` seconds."""
    found = []
    while (message := queue.pop(now)) is not None:
        found.append(message)
        queue.charge(cost)
        now += cost
    return found


def test_what_cannot_be_a_report_is_left_aside():
    queue = DiagnosticsQueue(NAMES)
    queue.put(b'battery of wheel_1 12 V', 0.0)
    assert drained(queue) == []
    assert queue.dropped == 0


def test_a_message_without_a_report_is_looked_at_now_and_then_if_it_names_a_part():
    queue, text = DiagnosticsQueue(NAMES), b'ERROR of theta_1 without a mode'
    for number in range(100):
        queue.put(text + str(number).encode(), 0.0)
    assert drained(queue, 0.0) == [text + b'0']
    # Of a flood, and behind what has a failure mode: the later of the newest.
    for number in range(1000):
        queue.put(text + str(number).encode(), 1.0 + 0.001 * number)
    queue.put(report('a'), 2.0)
    found = drained(queue, 2.0)
    assert found[0] == report('a')
    assert 1 <= len(found) <= 3
    queue.put(text + b'x' * MAX_BYTES, 3.0)
    assert drained(queue, 3.0) == []


def test_a_repeat_is_left_aside_for_half_a_second():
    queue, found = DiagnosticsQueue(NAMES), []
    for now in (0.0, 0.1, 0.4, 0.6):
        queue.put(report('noise', 'wheel_1'), now - 0.001)
        queue.put(report('a'), now)
        found += drained(queue, now)
    assert found.count(report('a')) == 2


def test_a_repeat_is_news_after_something_changed():
    queue = DiagnosticsQueue(NAMES)
    queue.put(report('a'), 0.0)
    queue.forget_repeats()
    queue.put(report('a'), 0.1)
    assert drained(queue) == [report('a'), report('a')]


def test_after_a_rest_a_few_are_decoded_at_once_in_the_order_they_came():
    queue = DiagnosticsQueue(NAMES)
    for number in range(30):
        queue.put(report(str(number)), 0.0)
    first = drained(queue, 0.0, BURST / 4)
    second = drained(queue, 1.0, BURST / 4)
    assert 4 <= len(first) <= 6
    assert first + second == [report(str(number)) for number in range(len(first) + len(second))]


def test_in_a_flood_reading_takes_no_more_than_its_share_of_the_time():
    queue = DiagnosticsQueue(NAMES)
    cost, period, taken = 0.002, 0.001, 0
    for tick in range(2000):
        queue.put(report(str(tick)), tick * period)
        taken += len(drained(queue, tick * period, cost))
    assert 0.8 * SHARE * 2000 * period <= taken * cost <= 1.2 * SHARE * 2000 * period + BURST
    # The newest are kept.
    queue.put(report('last'), 2.0)
    assert drained(queue, 10.0)[-1] == report('last')


def test_a_flood_is_bounded_and_counted():
    queue = DiagnosticsQueue(NAMES)
    for number in range(1000):
        queue.put(report(str(number)), 0.0)
    taken = drained(queue)
    assert len(taken) + queue.dropped == 1000
    assert len(taken) < 100
    assert taken[-1] == report('999')


def test_what_names_no_part_of_ours_keeps_nothing_of_ours_waiting():
    queue = DiagnosticsQueue(NAMES)
    for number in range(1000):
        queue.put(report(str(number), 'wheel_1'), 0.0)
    queue.put(report('ours', 'strut_1'), 0.0)
    for number in range(1000):
        queue.put(report(str(number), 'wheel_2'), 0.0)
    found = drained(queue, 0.0, 0.001)
    assert found[0] == report('ours', 'strut_1')
    assert queue.dropped == 0
    # Of the others the newest are told of, when there is time.
    assert set(drained(queue, 1.0)) <= {report('999', 'wheel_2'), report('998', 'wheel_2')}
    assert len(found) + len(drained(queue, 2.0)) < 10


def serialised(number: int, mode: str, name: str = 'drive') -> bytes:
    """Return a message as drives send it; names of any length shift what follows."""
    status = DiagnosticStatus(
        name=f'{name} {number}', hardware_id='theta_1', level=b'\x02',
        values=[KeyValue(key='failure_mode', value=mode), KeyValue(key='t', value='21.5')],
    )
    return serialize_message(DiagnosticArray(status=[status]))


@pytest.mark.parametrize('name', ['d', 'dr', 'dri', 'driv'])
@pytest.mark.parametrize('mode', ['position', 'Hard', 'melted', 'okay', 'none '])
def test_a_failure_does_not_queue_behind_good_news(mode, name):
    queue = DiagnosticsQueue(NAMES)
    for number in range(500):
        queue.put(serialised(number, 'none', name), 0.0)
    drained(queue, 0.0, BURST / 10)
    failure, after = serialised(7, mode, name), serialised(501, 'ok', name)
    queue.put(failure, 0.01)
    queue.put(after, 0.01)
    # At once, and nothing that was said before it comes after it.
    assert queue.pop(0.01) == failure
    assert drained(queue, 1.0) == [after]


def test_failures_come_in_the_order_they_were_reported():
    queue = DiagnosticsQueue(NAMES)
    messages = [serialised(number, 'position') for number in range(8)]
    for message in messages:
        queue.put(message, 0.0)
    assert drained(queue) == messages


@pytest.mark.parametrize('repeated', [True, False])
def test_five_thousand_messages_a_second_leave_most_of_a_processor(repeated):
    """In time of this process, the least of several rounds: nothing else counts."""
    statuses = [
        DiagnosticStatus(
            name=f'drive {number}', hardware_id='theta_1', level=b'\0',
            values=[KeyValue(key='failure_mode', value='none')],
        )
        for number in range(64)
    ]
    raw = serialize_message(DiagnosticArray(status=statuses))
    messages = [raw if repeated else raw + bytes([number, 0]) for number in range(250)]
    queue, rounds = DiagnosticsQueue(NAMES), []
    for _ in range(8):
        begin = time.process_time()
        for message in messages:
            queue.put(message, 0.0)
        rounds.append((time.process_time() - begin) / len(messages))
    assert 5000 * min(rounds) < 0.25


def test_a_message_of_absurd_length_is_left_aside():
    queue = DiagnosticsQueue(NAMES)
    queue.put(report('x' * MAX_BYTES), 0.0)
    assert drained(queue) == []
    assert queue.dropped == 1


def test_a_message_that_took_very_long_does_not_keep_others_waiting():
    queue = DiagnosticsQueue(NAMES)
    queue.put(report('a'), 0.0)
    assert queue.pop(0.0) == report('a')
    queue.charge(5.0)
    queue.put(report('b'), 0.01)
    assert queue.pop(0.01) is None
    assert queue.pop(0.01 + 1.5 * MAX_DEBT / SHARE) == report('b')


def test_a_command_that_took_long_does_not_keep_the_next_failure_waiting():
    queue = DiagnosticsQueue(NAMES)
    first, second = serialised(1, 'position'), serialised(2, 'position')
    queue.put(first, 0.0)
    assert queue.pop(0.0) == first
    queue.charge(0.0001, 5.0)
    queue.put(second, 0.0)
    # The next tick of the watchdog.
    assert queue.pop(0.0101) == second


def test_in_a_flood_of_failures_commands_leave_most_of_the_time_to_joint_states():
    queue, command, taken = DiagnosticsQueue(NAMES), 0.002, 0
    for tick in range(2000):
        queue.put(serialised(tick, 'position'), 0.001 * tick)
        while queue.pop(0.001 * tick) is not None:
            queue.charge(0.00005, command)
            taken += 1
    assert 0.1 * 2.0 < taken * command < 0.3 * 2.0
