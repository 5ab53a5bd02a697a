# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Conversion between messages and plain values; no other module sets the fields of messages.

Generated message classes check field types only on request. Otherwise they write any object into
memory: a numpy bool arrives as False, an int in a double as 1e-324. So every value is converted to
a Python float, string or array('d') before it is assigned to a field.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped, Vector3Stamped
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension

from fault_tolerance.control.failure_reports import ERROR
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.measured_pose import pose_of

FAILURE_MODE_KEY = 'failure_mode'
"""The key that makes a diagnostic status a failure report."""


class StatusMode(NamedTuple):
    """A failure mode in a diagnostic status, with the other fields of a failure report.

    ``mode`` is None for an ERROR without a failure mode, which may be a report that lacks it.
    """

    name: str
    hardware_id: str
    level: int
    mode: str | None


def nanoseconds_from_msg(stamp: Time) -> int:
    """Return a stamp in nanoseconds; its fields may have any value."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def twist_from_msg(message: TwistStamped) -> FloatArray:
    """Return the twist ``[w; v]`` (6,) in a ``message``."""
    angular, linear = message.twist.angular, message.twist.linear
    return np.array([angular.x, angular.y, angular.z, linear.x, linear.y, linear.z])


def twist_to_msg(stamp: Time, frame: str, twist: FloatArray) -> TwistStamped:
    """Return the message for a ``twist`` ``[w; v]`` (6,), with its ``stamp`` and ``frame``."""
    message = TwistStamped(header=Header(stamp=stamp, frame_id=frame))
    angular, linear = message.twist.angular, message.twist.linear
    angular.x, angular.y, angular.z, linear.x, linear.y, linear.z = twist.tolist()
    return message


def pose_from_msg(message: PoseStamped) -> FloatArray:
    """Return the pose in a ``message`` as a homogeneous transform (4, 4), metres.

    Raises ValueError as `pose_of` does.
    """
    position, turn = message.pose.position, message.pose.orientation
    return pose_of((position.x, position.y, position.z), (turn.x, turn.y, turn.z, turn.w))


def pose_to_msg(stamp: Time, frame: str, pose: FloatArray) -> PoseStamped:
    """Return the message for a ``pose`` (4, 4), with its ``stamp`` and ``frame``."""
    message = PoseStamped(header=Header(stamp=stamp, frame_id=frame))
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = pose[:3, 3].tolist()
    # scipy 1.11 does not take a read-only array.
    turned = Rotation.from_matrix(pose[:3, :3].copy())
    turn.x, turn.y, turn.z, turn.w = turned.as_quat().tolist()
    return message


def transform_from_msg(message: PoseStamped, child: str) -> TransformStamped:
    """Return the pose in a ``message`` as the transform of a frame ``child``."""
    found = TransformStamped(header=message.header, child_frame_id=child)
    position, moved = message.pose.position, found.transform.translation
    moved.x, moved.y, moved.z = position.x, position.y, position.z
    found.transform.rotation = message.pose.orientation
    return found


def vector_to_msg(stamp: Time, frame: str, vector: FloatArray) -> Vector3Stamped:
    """Return the message for a ``vector`` (3,), with its ``stamp`` and ``frame``."""
    message = Vector3Stamped(header=Header(stamp=stamp, frame_id=frame))
    message.vector.x, message.vector.y, message.vector.z = vector.tolist()
    return message


def joint_state_to_msg(
    stamp: Time, names: Sequence[str],
    positions: FloatArray, velocities: FloatArray, efforts: FloatArray, frame: str = '',
) -> JointState:
    """Return the message for N joints.

    ``stamp``, ``names``, and in their order ``positions``, ``velocities``, ``efforts`` (N,), or
    none; ``frame`` is its ``frame_id``.
    """
    return JointState(
        header=Header(stamp=stamp, frame_id=frame), name=list(names),
        position=array('d', positions.tolist()),
        velocity=array('d', velocities.tolist()),
        effort=array('d', efforts.tolist()),
    )


def array_to_msg(values: FloatArray) -> Float64MultiArray:
    """Return the message for ``values`` (k,) without labels: the subscriber knows their order."""
    return Float64MultiArray(data=array('d', values.tolist()))


def labelled_array_to_msg(values: Mapping[str, float]) -> Float64MultiArray:
    """Return the message for N ``values`` by name: one dimension, its label all the names."""
    message, count = Float64MultiArray(data=array('d', values.values())), len(values)
    label = ','.join(values)
    message.layout.dim = [MultiArrayDimension(label=label, size=count, stride=count)]
    return message


def status_to_msg(
    name: str, hardware_id: str, level: int, text: str, values: Mapping[str, str]
) -> DiagnosticStatus:
    """Return the status ``name`` of ``hardware_id``, with ``level``, ``text`` and ``values``."""
    return DiagnosticStatus(
        level=bytes([level]), name=name, message=text, hardware_id=hardware_id,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def status_name(node: Node, title: str) -> str:
    """Return the name of the status ``title`` of a ``node``, with its namespace."""
    return f'{node.get_fully_qualified_name().lstrip("/")}: {title}'


def diagnostics_to_msg(stamp: Time, statuses: Iterable[DiagnosticStatus]) -> DiagnosticArray:
    """Return the message for diagnostic ``statuses`` with its ``stamp``."""
    return DiagnosticArray(header=Header(stamp=stamp), status=list(statuses))


def modes_from_msg(message: DiagnosticArray) -> Iterator[StatusMode]:
    """Yield every failure mode in every status of a ``message``, and every ERROR without one."""
    for status in message.status:
        level = int.from_bytes(status.level, 'little')
        modes = [pair.value for pair in status.values if pair.key == FAILURE_MODE_KEY]
        for mode in modes or ([None] if level == ERROR else []):
            yield StatusMode(status.name, status.hardware_id, level, mode)
