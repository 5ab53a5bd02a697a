# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Values survive the way into a message, through DDS's wire format, and back."""

from __future__ import annotations

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rclpy.serialization import deserialize_message, serialize_message
from scipy.spatial.transform import Rotation

from fault_tolerance.mechanism.arrays import decimal
from fault_tolerance.nodes.messages import (
    array_to_msg,
    diagnostics_to_msg,
    joint_state_to_msg,
    labelled_array_to_msg,
    modes_from_msg,
    nanoseconds_from_msg,
    pose_from_msg,
    pose_to_msg,
    status_to_msg,
    transform_from_msg,
    twist_from_msg,
    twist_to_msg,
    vector_to_msg,
)

STAMP = Time(sec=12, nanosec=34)
FINITE = st.floats(-1e6, 1e6)


def sent(message):
    """Return a message as it arrives."""
    return deserialize_message(serialize_message(message), type(message))


@given(arrays(np.float64, 6, elements=FINITE))
@settings(max_examples=30)
def test_a_twist_comes_back(twist):
    message = sent(twist_to_msg(STAMP, 'base_link', twist))
    assert message.header.frame_id == 'base_link'
    assert nanoseconds_from_msg(message.header.stamp) == 12_000_000_034
    np.testing.assert_array_equal(twist_from_msg(message), twist)


@given(
    arrays(np.float64, 3, elements=st.floats(-3.0, 3.0)),
    arrays(np.float64, 3, elements=FINITE),
)
@settings(max_examples=30)
def test_a_pose_comes_back(turn, position):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    pose[:3, 3] = position
    np.testing.assert_allclose(
        pose_from_msg(sent(pose_to_msg(STAMP, 'base_link', pose))), pose, atol=1e-12
    )


def test_a_transform_is_the_pose_it_is_made_from():
    turned = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    pose = np.eye(4)
    pose[:3] = np.hstack([turned, [[1.0], [2.0], [3.0]]])
    pose = pose_to_msg(STAMP, 'base_link', pose)
    found = sent(transform_from_msg(pose, 'robot/mirror'))
    assert (found.header, found.child_frame_id) == (pose.header, 'robot/mirror')
    moved, turn = found.transform.translation, found.transform.rotation
    assert (moved.x, moved.y, moved.z) == (1.0, 2.0, 3.0)
    assert turn == pose.pose.orientation


@pytest.mark.parametrize('field', ['position', 'orientation'])
def test_a_pose_that_is_not_finite_is_refused(field):
    message = pose_to_msg(STAMP, '', np.eye(4))
    getattr(message.pose, field).x = float('nan')
    with pytest.raises(ValueError, match='not finite'):
        pose_from_msg(message)


@pytest.mark.parametrize('size', [0.5, 2.0, 1e200])
def test_a_pose_whose_quaternion_is_no_unit_one_is_refused(size):
    message = pose_to_msg(STAMP, '', np.eye(4))
    message.pose.orientation.w = size
    with pytest.raises(ValueError, match='norm'):
        pose_from_msg(message)


def test_a_pose_beyond_reason_is_refused():
    message = pose_to_msg(STAMP, '', np.eye(4))
    message.pose.position.z = -1e7
    with pytest.raises(ValueError, match='away'):
        pose_from_msg(message)


def test_a_pose_without_orientation_is_refused():
    message = PoseStamped()
    message.pose.orientation.w = 0.0
    with pytest.raises(ValueError, match='norm'):
        pose_from_msg(message)


def test_a_joint_state_holds_what_it_was_given():
    position, velocity, effort = np.arange(3.0), -np.arange(3.0), np.full(3, 0.5)
    message = sent(joint_state_to_msg(STAMP, ('a', 'b', 'c'), position, velocity, effort))
    assert list(message.name) == ['a', 'b', 'c']
    assert list(message.position) == [0.0, 1.0, 2.0]
    assert list(message.velocity) == [0.0, -1.0, -2.0]
    assert list(message.effort) == [0.5, 0.5, 0.5]


def test_arrays_hold_what_they_were_given():
    assert list(sent(array_to_msg(np.array([1, 2]))).data) == [1.0, 2.0]
    message = sent(labelled_array_to_msg({'theta_1': 0.5, 'theta_2': 1.0}))
    assert list(message.data) == [0.5, 1.0]
    (dimension,) = message.layout.dim
    assert (dimension.label, dimension.size, dimension.stride) == ('theta_1,theta_2', 2, 2)
    vector = sent(vector_to_msg(STAMP, 'base_link', np.array([1.0, 2.0, 3.0]))).vector
    assert (vector.x, vector.y, vector.z) == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ('level', 'constant'),
    [
        (0, DiagnosticStatus.OK),
        (1, DiagnosticStatus.WARN),
        (2, DiagnosticStatus.ERROR),
        (3, DiagnosticStatus.STALE),
    ],
)
def test_a_status_comes_back(level, constant):
    status = status_to_msg('node: part', 'part', level, 'text', {'failure_mode': 'torque'})
    message = sent(diagnostics_to_msg(STAMP, [status]))
    assert message.status[0].level == constant
    assert list(modes_from_msg(message)) == [('node: part', 'part', level, 'torque')]


def test_a_status_without_a_failure_mode_is_nobodys_report():
    message = DiagnosticArray(
        status=[DiagnosticStatus(values=[KeyValue(key='voltage', value='5')]), DiagnosticStatus()]
    )
    assert list(modes_from_msg(message)) == []


def test_all_modes_of_a_status_that_has_several_are_kept():
    pairs = [KeyValue(key='failure_mode', value=mode) for mode in ('torque', 'position')]
    found = modes_from_msg(DiagnosticArray(status=[DiagnosticStatus(values=pairs)]))
    assert [one.mode for one in found] == ['torque', 'position']


@pytest.mark.parametrize(
    ('value', 'text'),
    [
        (0.0, '0'),
        (1.0, '1'),
        (1 / 3, '0.333333333'),
        (1e12, '1000000000000'),
        (1.6e-7, '0.00000016'),
        (-0.5, '-0.5'),
        (1e-300, '0'),
    ],
)
def test_numbers_are_written_without_exponent(value, text):
    assert decimal(value) == text


@given(st.floats(1e-9, 1e12))
def test_numbers_read_back_to_nine_digits(value):
    assert float(decimal(value)) == pytest.approx(value, rel=1e-8)
    assert 'e' not in decimal(value)
