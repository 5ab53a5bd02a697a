# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What is read from bytes is what the middleware would make of them."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message

from fault_tolerance.nodes.messages import FAILURE_MODE_KEY, modes_from_msg
from fault_tolerance.nodes.serialised_diagnostics import modes_in

TEXT = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=9)
PAIRS = st.lists(st.tuples(st.just(FAILURE_MODE_KEY) | TEXT, TEXT), max_size=4)
STATUSES = st.lists(
    st.tuples(TEXT, TEXT, TEXT, st.sampled_from([b'\0', b'\1', b'\2', b'\3', b'\xff']), PAIRS),
    max_size=4,
)


def message(statuses, frame='', sec=12, nanosec=34):
    found = DiagnosticArray(status=[
        DiagnosticStatus(
            name=name, message=text, hardware_id=hardware, level=level,
            values=[KeyValue(key=key, value=value) for key, value in pairs],
        )
        for name, text, hardware, level, pairs in statuses
    ])
    found.header.frame_id = frame
    found.header.stamp.sec, found.header.stamp.nanosec = sec, nanosec
    return found


@given(STATUSES, TEXT, st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1))
def test_failure_modes_are_read_as_the_middleware_reads_them(statuses, frame, sec, nanosec):
    told = message(statuses, frame, sec, nanosec)
    found = modes_in(serialize_message(told))
    assert (found.sec, found.nanosec) == (sec, nanosec)
    assert list(found.modes) == list(modes_from_msg(told))


ONE = message([('drive', 'text', 'theta_4', b'\2', [(FAILURE_MODE_KEY, 'position')])])


@given(st.data())
def test_bytes_that_are_no_message_do_no_harm(data):
    """They are left to the middleware, or read for what they say; nothing is raised."""
    raw = bytearray(serialize_message(ONE))
    for _ in range(data.draw(st.integers(1, 3))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    found = modes_in(bytes(raw[: data.draw(st.integers(0, len(raw)))]))
    for name, hardware_id, level, mode in found.modes if found else ():
        assert isinstance(name + hardware_id + mode, str)
        assert 0 <= level < 256


@pytest.mark.parametrize('cut', range(4, 60, 7))
def test_a_message_cut_short_is_left_to_the_middleware(cut):
    assert modes_in(serialize_message(ONE)[:-cut]) is None


def test_another_encoding_is_left_to_the_middleware():
    raw = serialize_message(ONE)
    assert modes_in(b'\0\0' + raw[2:]) is None
