# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What is read from, or written as, bytes is what the middleware would make of them."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray

from fault_tolerance.nodes import commanding
from fault_tolerance.nodes.commanding import SerialisedArray, SerialisedTwist
from fault_tolerance.nodes.messages import FAILURE_MODE_KEY, modes_from_msg, twist_from_msg
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


@pytest.mark.parametrize('count', [1, 4, 7, 1000])
def test_arrays_are_written_as_the_middleware_writes_them(count):
    values = np.random.default_rng(count).normal(size=count)
    made = SerialisedArray(count).message(values)
    assert isinstance(made, bytes)
    assert deserialize_message(made, Float64MultiArray).data.tolist() == values.tolist()
    assert deserialize_message(made, Float64MultiArray).layout.dim == []


@pytest.mark.parametrize('frame', ['', 'b', 'base', 'a/rather/long_frame', 'räume'])
def test_twists_are_written_as_the_middleware_writes_them(frame):
    twist = np.random.default_rng(1).normal(size=6)
    made = SerialisedTwist(frame).message(1_234_567_890_123_456_789, twist)
    assert isinstance(made, bytes)
    found = deserialize_message(made, TwistStamped)
    assert twist_from_msg(found).tolist() == twist.tolist()
    assert (found.header.stamp.sec, found.header.stamp.nanosec) == (1_234_567_890, 123_456_789)
    assert found.header.frame_id == frame


def test_where_the_middleware_writes_otherwise_it_does_so(monkeypatch):
    monkeypatch.setattr(commanding, 'serialize_message', lambda _: b'\0\1 something else')
    made = SerialisedArray(2).message(np.array([1.0, -2.0]))
    assert isinstance(made, Float64MultiArray)
    assert made.data.tolist() == [1.0, -2.0]
    twist = SerialisedTwist('base').message(5, np.arange(6.0))
    assert isinstance(twist, TwistStamped)
    assert twist.twist.angular.y == 1.0
