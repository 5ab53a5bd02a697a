# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where a pose and joint values put the struts: product of exponentials, strut by strut.

Twists are scaled: rotations times the characteristic length, so that every number is in metres.
"""

from __future__ import annotations

from math import atan2, sin, sqrt

import numpy as np

from fault_tolerance.kernel.model import Chains
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import HALF_TURN, NO_ANGLE, SERIES_ANGLE


def placed_struts(
    chains: Chains, pose: FloatArray, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return all joint screws (s, k, 6) and openings (s, 6), scaled (Murray et al. 1994, eq. 3.2).

    Of ``chains``. Screws are in base axes, v at the platform's origin; an opening is the
    displacement from a strut's tip to the ``pose`` (4, 4) of the platform. Joint ``values`` (s, k)
    are from home.
    """
    screws, openings = np.zeros(chains.screws.shape), np.empty((len(chains.joints), 6))
    tip = np.empty((3, 4))
    for s in range(len(chains.joints)):
        for i in range(3):
            for j in range(4):
                tip[i, j] = 1.0 if i == j else 0.0
        for j in range(chains.joints[s]):
            _joint_screw(chains.screws[s, j], pose, tip, chains.length, screws[s, j])
            _advance(tip, chains.screws[s, j], values[s, j])
        x, y, z = _rotated(tip, chains.origin[0], chains.origin[1], chains.origin[2])
        openings[s, 3] = pose[0, 3] - tip[0, 3] - x
        openings[s, 4] = pose[1, 3] - tip[1, 3] - y
        openings[s, 5] = pose[2, 3] - tip[2, 3] - z
        _rotation_between(pose, tip, chains.length, openings[s])
    return screws, openings


def displaced_pose(pose: FloatArray, twist: FloatArray, length: float) -> FloatArray:
    """Return a ``pose`` (4, 4) moved by a ``twist`` (6,) scaled by ``length``, orthonormal.

    Poses follow from one another for hours, so each takes a Newton step towards the nearest
    rotation.
    """
    x, y, z = twist[0] / length, twist[1] / length, twist[2] / length
    squared = x * x + y * y + z * z
    angle = sqrt(squared)
    if angle < SERIES_ANGLE:
        sine, cosine = 1.0 - squared / 6.0 + squared * squared / 120.0, 0.5 - squared / 24.0
    else:
        half = sin(0.5 * angle) / angle
        sine, cosine = sin(angle) / angle, 2.0 * half * half
    turn, moved, result = np.eye(3), np.zeros((3, 3)), pose.copy()
    _turn_right(turn, x, y, z, sine, cosine)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                moved[i, j] += turn[i, k] * pose[k, j]
        result[i, 3] += twist[3 + i]
    for j in range(3):
        for i in range(3):
            result[i, j] = 1.5 * moved[i, j]
        for k in range(3):
            overlap = 0.0
            for i in range(3):
                overlap += moved[i, j] * moved[i, k]
            for i in range(3):
                result[i, j] -= 0.5 * moved[i, k] * overlap
    return result


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


def _advance(tip: FloatArray, screw: FloatArray, value: float) -> None:
    """Multiply ``tip`` (3, 4) from the right by the exponential of ``value`` times ``screw``."""
    ax, ay, az, bx, by, bz = screw[0], screw[1], screw[2], screw[3], screw[4], screw[5]
    half, sine = sin(0.5 * value), sin(value)
    cosine, rest = 2.0 * half * half, value - sine
    # The translation is (q + (1 - cos q) [w] + (q - sin q) [w]^2) v.
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
    pose: FloatArray, tip: FloatArray, length: float, opening: FloatArray
) -> None:
    """Write the scaled rotation vector of ``R_pose R_tip^T`` into the first three components."""
    turn = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
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
        sign = 1.0
        axis = np.empty(3)
        for i in range(3):
            axis[i] = turn[i, best] + turn[best, i] - (trace - 1.0 if i == best else 0.0)
        if axis[0] * x + axis[1] * y + axis[2] * z < 0.0:
            sign = -1.0
        x, y, z = axis[0], axis[1], axis[2]
        factor = sign * length * angle / sqrt(x * x + y * y + z * z)
    opening[0], opening[1], opening[2] = factor * x, factor * y, factor * z
