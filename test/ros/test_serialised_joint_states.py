# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Joint states and commands are read and written as the middleware would."""

import struct
from array import array

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.cdr import DOUBLE
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.input_subscriber import InputSubscriber
from fault_tolerance.nodes.serialised_joint_states import (
    SerialisedJointState,
    decodable,
    layout_of,
)
from fault_tolerance.nodes.spinning import Deferred
from fault_tolerance.nodes.timeline import TimeLine

TEXT = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=9)
NUMBERS = st.lists(st.floats(), max_size=5)
MECHANISM = mechanism_named('mirror_4_strut')
NAMES = list(MECHANISM.joint_state_names)


def message(names, positions, velocities=(), efforts=(), frame='', sec=12, nanosec=34):
    found = JointState(
        name=names, position=array('d', positions), velocity=array('d', velocities),
        effort=array('d', efforts),
    )
    found.header.frame_id = frame
    found.header.stamp.sec, found.header.stamp.nanosec = sec, nanosec
    return found


def read(raw):
    """Return names, positions and efforts of a message."""
    layout = layout_of(raw)
    positions = np.frombuffer(raw, DOUBLE, layout.count, layout.positions_at)
    efforts = SerialisedJointState(0, 0, positions, raw, layout).efforts
    return layout.names, positions.tobytes(), efforts.tobytes()


@given(st.lists(TEXT, max_size=5), NUMBERS, NUMBERS, NUMBERS, TEXT)
def test_joint_states_are_read_as_the_middleware_reads_them(names, one, two, three, frame):
    told = message(names, one, two, three, frame)
    expected = names, array('d', one).tobytes(), array('d', three).tobytes()
    assert read(serialize_message(told)) == expected


WHOLE = serialize_message(message(NAMES, [1.0] * 4, [2.0] * 4, [3.0] * 4))


@given(st.data())
def test_bytes_that_are_no_joint_state_are_refused_or_read_for_what_they_say(data):
    raw = bytearray(WHOLE)
    for _ in range(data.draw(st.integers(1, 3))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    try:
        names, _, _ = read(bytes(raw[: data.draw(st.integers(0, len(raw)))]))
    except ValueError:
        return
    assert all(isinstance(name, str) for name in names)


def test_what_stands_between_strings_does_not_matter(inputs):
    """It is whatever was in the publisher's memory."""
    raw = serialize_message(inputs.message([1e-7] * 4))
    assert raw[12:20] == b'\1\0\0\0\0' + raw[17:20]  # an empty frame, and padding
    other = raw[:17] + b'\xee' * 3 + raw[20:]
    assert deserialize_message(other, JointState).name == NAMES
    for one in (raw, other, raw):
        assert inputs.values(one) == [1e-7] * 4


def big_endian(names, positions):
    """Return a joint state as a machine of the other byte order sends it."""
    raw = struct.pack('>iII', 12, 34, 1) + b'\0' * 4 + struct.pack('>I', len(names))
    for name in names:
        text = name.encode() + b'\0'
        raw += struct.pack('>I', len(text)) + text + b'\0' * (-len(text) % 4)
    raw += struct.pack('>I', len(positions))
    raw += b'\0' * (-len(raw) % 8) + struct.pack(f'>{len(positions)}d', *positions)
    return b'\0\0\0\0' + raw + struct.pack('>II', 0, 0)


def test_another_byte_order_is_left_to_the_middleware():
    raw = big_endian(NAMES, [1.0, -2.0, 3.0, 4.5])
    assert list(deserialize_message(raw, JointState).position) == [1.0, -2.0, 3.0, 4.5]
    assert read(decodable(raw)[0]) == (NAMES, array('d', [1.0, -2.0, 3.0, 4.5]).tobytes(), b'')


def with_names(names, positions):
    """Return a joint state with ``names`` as bytes, whatever they are."""
    raw = serialize_message(message([], []))[:20] + struct.pack('<I', len(names))
    for name in names:
        raw += struct.pack('<I', len(name)) + name + b'\0' * (-len(name) % 4)
    raw += struct.pack('<I', len(positions))
    raw += b'\0' * (-(len(raw) - 4) % 8) + struct.pack(f'<{len(positions)}d', *positions)
    return raw + struct.pack('<II', 0, 0)


@pytest.mark.parametrize('end', [b'', b'\0', b'\0\0\0'])
def test_names_end_as_the_middleware_ends_them(end):
    raw = with_names([name.encode() + end for name in NAMES], [1.0, 2.0, 3.0, 4.0])
    assert list(deserialize_message(raw, JointState).name) == NAMES
    assert read(decodable(raw)[0])[0] == NAMES


def test_a_list_of_names_that_is_no_machine_is_refused():
    with pytest.raises(ValueError, match='20000 names'):
        decodable(with_names([b'\0'] * 20_000, [0.0]))


class Inputs:
    """The controller's subscriber, what it passes on, and what it rejects."""

    def __init__(self, node):
        self.node, self.heard = node, []
        self.supervisor, timeline = Supervisor(MECHANISM), TimeLine(node.get_clock())
        self.health = Health(node, timeline, 'controller', '', lambda: (0, ''))
        self.subscriber = InputSubscriber(
            node, self.supervisor, 'base', timeline, self.health, self.supervisor.step,
            self.heard.append, Deferred(),
        )

    def values(self, raw):
        """Return the joint values that a message brings, None if it is rejected."""
        count = len(self.heard)
        self.subscriber.on_joint_state(raw)
        if len(self.heard) == count:
            return None
        return self.supervisor.output.estimate.readings.tolist()

    def message(self, positions, names=NAMES):
        now = self.node.get_clock().now().to_msg()
        return message(names, positions, sec=now.sec, nanosec=now.nanosec)


@pytest.fixture
def inputs(probe):
    return Inputs(probe.node)


def test_publishers_with_their_own_names_and_orders_take_turns(inputs):
    for step in range(1, 4):
        values = [1e-7 * step, 2e-7 * step, 0.0, -1e-7 * step]
        for order in ([0, 1, 2, 3], [3, 1, 0, 2]):
            told = inputs.message([values[i] for i in order], [NAMES[i] for i in order])
            told.name.append('another'), told.position.append(step)
            assert inputs.values(serialize_message(told)) == values
            assert (inputs.heard[-1].sec, inputs.heard[-1].nanosec) == (
                told.header.stamp.sec, told.header.stamp.nanosec)


def test_a_message_that_ends_early_is_rejected_and_the_next_one_counts_again(inputs):
    whole = serialize_message(inputs.message([1e-7] * 4))
    assert inputs.values(whole) == [1e-7] * 4
    ends = range(layout_of(whole).velocities_at)
    assert [end for end in ends if inputs.values(whole[:end]) is not None] == []
    assert 'a joint state that cannot be decoded' in inputs.health.told()[1]
    assert inputs.values(serialize_message(inputs.message([2e-7] * 4))) == [2e-7] * 4
