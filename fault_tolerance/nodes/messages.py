# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Messages from plain values and plain values from messages; nothing else touches their fields.

Generated message classes check field types only on request and otherwise write whatever they are
given into memory: a numpy bool arrives as False, an int in a double as 1e-324. So everything is
a Python float, string, or array('d') before it gets here into a field.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped, Vector3Stamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension

from fault_tolerance.mechanism.arrays import FloatArray

FAILURE_MODE_KEY = 'failure_mode'
"""The key that makes a diagnostic status a failure report."""

FARTHEST = 1e6
"""Metres; no platform is farther away."""

UNIT_TOLERANCE = 0.01
"""By how much the length of a quaternion may differ from 1: rounded ones still pass."""

_LEVELS = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)
_NANOSECONDS = 1_000_000_000


class StatusMode(NamedTuple):
    """A failure mode in a diagnostic status, and what else a failure report is made of."""

    name: str
    hardware_id: str
    level: int
    mode: str


def nanoseconds_from_msg(stamp: Time) -> int:
    """Return a stamp in nanoseconds, whatever its fields hold."""
    return stamp.sec * _NANOSECONDS + stamp.nanosec


def twist_from_msg(message: TwistStamped) -> FloatArray:
    """Return ``[w; v]`` (6,)."""
    angular, linear = message.twist.angular, message.twist.linear
    return np.array([angular.x, angular.y, angular.z, linear.x, linear.y, linear.z])


def twist_to_msg(stamp: Time, frame: str, twist: FloatArray) -> TwistStamped:
    """Return the message for a twist ``[w; v]`` (6,)."""
    message = TwistStamped(header=Header(stamp=stamp, frame_id=frame))
    fill_twist(message.twist, twist)
    return message


def fill_twist(message: Twist, twist: FloatArray) -> None:
    """Write a twist ``[w; v]`` (6,) into a message."""
    angular, linear = message.angular, message.linear
    angular.x, angular.y, angular.z, linear.x, linear.y, linear.z = twist.tolist()


def pose_from_msg(message: PoseStamped) -> FloatArray:
    """Return the pose (4, 4); ValueError for one that is none."""
    position, turn = message.pose.position, message.pose.orientation
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
    pose = np.eye(4)
    pose[:3, 3] = position.x, position.y, position.z
    if not (np.isfinite(pose).all() and np.isfinite(quaternion).all()):
        raise ValueError('the pose is not finite')
    # Squares of such numbers would lose their meaning.
    if (np.abs(pose) > FARTHEST).any():
        raise ValueError(f'the position is more than {FARTHEST:g} m away')
    if abs(np.linalg.norm(np.clip(quaternion, -2.0, 2.0)) - 1.0) > UNIT_TOLERANCE:
        raise ValueError('the norm of the quaternion is not 1')
    pose[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    return pose


def pose_to_msg(stamp: Time, frame: str, pose: FloatArray) -> PoseStamped:
    """Return the message for a pose (4, 4)."""
    message = PoseStamped(header=Header(stamp=stamp, frame_id=frame))
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = pose[:3, 3].tolist()
    # scipy 1.11 does not take a read-only array.
    turned = Rotation.from_matrix(pose[:3, :3].copy())
    turn.x, turn.y, turn.z, turn.w = turned.as_quat().tolist()
    return message


def vector_to_msg(stamp: Time, frame: str, vector: FloatArray) -> Vector3Stamped:
    """Return the message for a vector (3,)."""
    message = Vector3Stamped(header=Header(stamp=stamp, frame_id=frame))
    message.vector.x, message.vector.y, message.vector.z = vector.tolist()
    return message


def joint_state_to_msg(
    stamp: Time,
    names: Sequence[str],
    positions: FloatArray,
    velocities: FloatArray,
    efforts: FloatArray,
) -> JointState:
    """Return the message for N joints, in the order of their names."""
    return JointState(
        header=Header(stamp=stamp),
        name=list(names),
        position=array('d', positions.tolist()),
        velocity=array('d', velocities.tolist()),
        effort=array('d', efforts.tolist()),
    )


def array_to_msg(values: FloatArray) -> Float64MultiArray:
    """Return the message for numbers whose order is agreed upon."""
    return Float64MultiArray(data=array('d', values.tolist()))


def labelled_array_to_msg(values: Mapping[str, float]) -> Float64MultiArray:
    """Return the message for numbers with a label each: one dimension of size 1 for every one."""
    message = Float64MultiArray(data=array('d', values.values()))
    message.layout.dim = [MultiArrayDimension(label=name, size=1, stride=1) for name in values]
    return message


def status_to_msg(
    name: str,
    hardware_id: str,
    level: int,
    text: str,
    values: Mapping[str, str],
) -> DiagnosticStatus:
    """Return a diagnostic status; ``level`` from 0 (OK) to 3 (STALE)."""
    return DiagnosticStatus(
        level=_LEVELS[level],
        name=name,
        message=text,
        hardware_id=hardware_id,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def diagnostics_to_msg(stamp: Time, statuses: Iterable[DiagnosticStatus]) -> DiagnosticArray:
    """Return the message for diagnostic statuses."""
    return DiagnosticArray(header=Header(stamp=stamp), status=list(statuses))


def modes_from_msg(message: DiagnosticArray) -> Iterator[StatusMode]:
    """Yield the failure modes in all statuses (where one has several, all of them)."""
    for status in message.status:
        for pair in status.values:
            if pair.key == FAILURE_MODE_KEY:
                level = int.from_bytes(status.level, 'little')
                yield StatusMode(status.name, status.hardware_id, level, pair.value)


def decimal(value: float) -> str:
    """Return a number as people read it: nine digits, no exponent."""
    if abs(value) < 1e-15:
        return '0'
    return np.format_float_positional(value, precision=9, fractional=False, trim='-')
