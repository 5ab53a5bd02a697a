# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Forward kinematics of the struts (product of exponentials), and the closure error of each.

Twists are scaled: rotations times the characteristic length, so that every number is in metres.
"""

from math import atan2, sin, sqrt

from fault_tolerance.kernel.array_layout import EstimateArrays, Model
from fault_tolerance.kernel.scratch import matrix, set_identity
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import HALF_TURN, NO_ANGLE, SERIES_ANGLE


def place_struts(m: Model, e: EstimateArrays, screws: FloatArray) -> None:
    """Write the joint ``screws`` and closure errors of ``e`` (Murray et al. 1994, eq. 3.2).

    The screws (s, k, 6) are scaled, in base axes, v at the platform's origin.
    """
    mark, chains, closure_error = m.work[0], m.chains, e.closure_error
    tip, turn = matrix(m.work, 3, 4), matrix(m.work, 3, 3)
    for s in range(len(chains.joints)):
        set_identity(tip)
        for j in range(chains.joints[s]):
            _joint_screw(chains.screws[s, j], e.pose, tip, chains.length, screws[s, j])
            _apply_joint(tip, chains.screws[s, j], e.values[s, j])
        x, y, z = _rotated(tip, chains.origin[0], chains.origin[1], chains.origin[2])
        closure_error[s, 3] = e.pose[0, 3] - tip[0, 3] - x
        closure_error[s, 4] = e.pose[1, 3] - tip[1, 3] - y
        closure_error[s, 5] = e.pose[2, 3] - tip[2, 3] - z
        _rotation_between(e.pose, tip, chains.length, turn, closure_error[s])
    m.work[0] = mark


def displace(m: Model, pose: FloatArray, twist: FloatArray) -> None:
    """Move a ``pose`` (4, 4) by a scaled ``twist`` (6,), in place; it stays orthonormal.

    Poses follow from one another for hours, so each takes a Newton step towards the nearest
    rotation.
    """
    mark, length = m.work[0], m.chains.length
    turn, moved = matrix(m.work, 3, 3), matrix(m.work, 3, 3)
    x, y, z = twist[0] / length, twist[1] / length, twist[2] / length
    squared = x * x + y * y + z * z
    angle = sqrt(squared)
    if angle < SERIES_ANGLE:
        sine, cosine = 1.0 - squared / 6.0 + squared * squared / 120.0, 0.5 - squared / 24.0
    else:
        half = sin(0.5 * angle) / angle
        sine, cosine = sin(angle) / angle, 2.0 * half * half
    for i in range(3):
        pose[i, 3] += twist[3 + i]
    set_identity(turn)
    _turn_right(turn, x, y, z, sine, cosine)
    for i in range(3):
        for j in range(3):
            moved[i, j] = 0.0
            for k in range(3):
                moved[i, j] += turn[i, k] * pose[k, j]
    for j in range(3):
        for i in range(3):
            pose[i, j] = 1.5 * moved[i, j]
        for k in range(3):
            overlap = 0.0
            for i in range(3):
                overlap += moved[i, j] * moved[i, k]
            for i in range(3):
                pose[i, j] -= 0.5 * moved[i, k] * overlap
    m.work[0] = mark


def _rotated(
    frame: FloatArray, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return R (x, y, z) with R the first three rows and columns of ``frame``."""
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
    )


def _turn_right(
    frame: FloatArray, x: float, y: float, z: float, sine: float, cosine: float
) -> None:
    """Multiply the rotation in ``frame`` from the right by ``1 + sine [x] + cosine [x]^2``."""
    for i in range(3):
        a, b, c = frame[i, 0], frame[i, 1], frame[i, 2]
        # A row times [x] is the cross product of the row and x.
        u, v, w = b * z - c * y, c * x - a * z, a * y - b * x
        p, q, r = v * z - w * y, w * x - u * z, u * y - v * x
        frame[i, 0] = a + sine * u + cosine * p
        frame[i, 1] = b + sine * v + cosine * q
        frame[i, 2] = c + sine * w + cosine * r


def _joint_screw(
    home: FloatArray, pose: FloatArray, tip: FloatArray, length: float, out: FloatArray
) -> None:
    """Write where ``tip`` has taken the ``home`` screw: scaled, v at the platform's origin."""
    x, y, z = _rotated(tip, home[0], home[1], home[2])
    u, v, w = _rotated(tip, home[3], home[4], home[5])
    dx, dy, dz = tip[0, 3] - pose[0, 3], tip[1, 3] - pose[1, 3], tip[2, 3] - pose[2, 3]
    out[0], out[1], out[2] = length * x, length * y, length * z
    out[3], out[4], out[5] = u + dy * z - dz * y, v + dz * x - dx * z, w + dx * y - dy * x


def _apply_joint(tip: FloatArray, screw: FloatArray, value: float) -> None:
    """Multiply ``tip`` (3, 4) from the right by the exponential of ``value`` times ``screw``.

    For any unit screw: revolute, prismatic, helical.
    """
    ax, ay, az, bx, by, bz = screw[0], screw[1], screw[2], screw[3], screw[4], screw[5]
    half, sine = sin(0.5 * value), sin(value)
    cosine, rest = 2.0 * half * half, value - sine
    # The translation is (q + (1 - cos q) [w] + (q - sin q) [w]^2) v; w is zero or a unit vector.
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    ex, ey, ez = ay * cz - az * cy, az * cx - ax * cz, ax * cy - ay * cx
    x, y, z = _rotated(
        tip,
        value * bx + cosine * cx + rest * ex,
        value * by + cosine * cy + rest * ey,
        value * bz + cosine * cz + rest * ez,
    )
    tip[0, 3] += x
    tip[1, 3] += y
    tip[2, 3] += z
    _turn_right(tip, ax, ay, az, sine, cosine)


def _rotation_between(
    pose: FloatArray, tip: FloatArray, length: float, turn: FloatArray, out: FloatArray
) -> None:
    """Write the scaled rotation vector of ``R_pose R_tip^T`` into the first three components.

    ``turn`` (3, 3) is room for it.
    """
    for i in range(3):
        for j in range(3):
            turn[i, j] = 0.0
            for k in range(3):
                turn[i, j] += pose[i, k] * tip[j, k]
    trace = turn[0, 0] + turn[1, 1] + turn[2, 2]
    x = 0.5 * (turn[2, 1] - turn[1, 2])
    y = 0.5 * (turn[0, 2] - turn[2, 0])
    z = 0.5 * (turn[1, 0] - turn[0, 1])
    sine = sqrt(x * x + y * y + z * z)
    angle = atan2(sine, 0.5 * (trace - 1.0))
    factor = length * angle / sine if sine > NO_ANGLE else length
    if trace < HALF_TURN:
        # R + R^T - (trace - 1) 1 is a multiple of the axis' square: its largest column.
        best = 0
        for i in range(3):
            if turn[i, i] > turn[best, best]:
                best = i
        rest = trace - 1.0
        a = turn[0, best] + turn[best, 0] - (rest if best == 0 else 0.0)
        b = turn[1, best] + turn[best, 1] - (rest if best == 1 else 0.0)
        c = turn[2, best] + turn[best, 2] - (rest if best == 2 else 0.0)
        factor = length * angle / sqrt(a * a + b * b + c * c)
        if a * x + b * y + c * z < 0.0:
            factor = -factor
        x, y, z = a, b, c
    out[0], out[1], out[2] = factor * x, factor * y, factor * z
