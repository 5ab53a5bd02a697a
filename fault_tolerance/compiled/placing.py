# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where pose and joint values put the struts, and what these then say, compiled.

What `fault_tolerance.mechanism.regular.RegularStruts` does, strut by strut.
"""

from __future__ import annotations

from math import atan2, sin, sqrt

import numpy as np

from fault_tolerance.compiled.compiler import FloatArray, IntArray, compiled
from fault_tolerance.compiled.small_matrices import inverted

_SERIES_ANGLE = 1e-3
_NO_TURN = 1e-9


@compiled
def _turned(
    matrix: FloatArray, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return R (x, y, z) for the first three rows and columns of ``matrix``."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@compiled
def _rotate(
    matrix: FloatArray, x: float, y: float, z: float, sine: float, cosine: float
) -> None:
    """Multiply the rotation in ``matrix`` by ``1 + sine [x]  + cosine [x]^2`` from the right."""
    for i in range(3):
        a, b, c = matrix[i, 0], matrix[i, 1], matrix[i, 2]
        # Rows from the left: r [x] = -(x cross r) = r cross x.
        u, v, w = b * z - c * y, c * x - a * z, a * y - b * x
        p, q, r = v * z - w * y, w * x - u * z, u * y - v * x
        matrix[i, 0] = a + sine * u + cosine * p
        matrix[i, 1] = b + sine * v + cosine * q
        matrix[i, 2] = c + sine * w + cosine * r


@compiled
def place_struts(
    screws: FloatArray, counts: IntArray, origin: FloatArray, length: float, pose: FloatArray,
    values: FloatArray, moved: FloatArray, openings: FloatArray,
) -> None:
    """Write the scaled joint screws (s, k, 6), v at the platform, and the openings (s, 6).

    Product of exponentials, strut by strut (Murray, Li and Sastry 1994, eq. 3.2).
    """
    tip = np.empty((3, 4))
    px, py, pz = pose[0, 3], pose[1, 3], pose[2, 3]
    for strut in range(len(counts)):
        for i in range(3):
            for j in range(4):
                tip[i, j] = 1.0 if i == j else 0.0
        for joint in range(counts[strut]):
            ax, ay, az = screws[strut, joint, 0], screws[strut, joint, 1], screws[strut, joint, 2]
            bx, by, bz = screws[strut, joint, 3], screws[strut, joint, 4], screws[strut, joint, 5]
            x, y, z = _turned(tip, ax, ay, az)
            u, v, w = _turned(tip, bx, by, bz)
            # From the base's origin to the platform's.
            dx, dy, dz = tip[0, 3] - px, tip[1, 3] - py, tip[2, 3] - pz
            moved[strut, joint, 0] = length * x
            moved[strut, joint, 1] = length * y
            moved[strut, joint, 2] = length * z
            moved[strut, joint, 3] = u + dy * z - dz * y
            moved[strut, joint, 4] = v + dz * x - dx * z
            moved[strut, joint, 5] = w + dx * y - dy * x
            value = values[strut, joint]
            half = sin(0.5 * value)
            sine, cosine, rest = sin(value), 2.0 * half * half, value - sin(value)
            # The shift, (q + (1 - cos q) [w] + (q - sin q) [w]^2) v.
            cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            ex, ey, ez = ay * cz - az * cy, az * cx - ax * cz, ax * cy - ay * cx
            x, y, z = _turned(
                tip,
                value * bx + cosine * cx + rest * ex,
                value * by + cosine * cy + rest * ey,
                value * bz + cosine * cz + rest * ez,
            )
            tip[0, 3] += x
            tip[1, 3] += y
            tip[2, 3] += z
            _rotate(tip, ax, ay, az, sine, cosine)
        x, y, z = _turned(tip, origin[0], origin[1], origin[2])
        openings[strut, 3] = px - tip[0, 3] - x
        openings[strut, 4] = py - tip[1, 3] - y
        openings[strut, 5] = pz - tip[2, 3] - z
        _turn(pose, tip, length, openings[strut])


@compiled
def _turn(pose: FloatArray, tip: FloatArray, length: float, opening: FloatArray) -> None:
    """Write the scaled rotation vector of ``R_pose R_tip^T`` into an opening."""
    trace = 0.0
    for i in range(3):
        for j in range(3):
            trace += pose[i, j] * tip[i, j]
    total = 0.0
    for axis in range(3):
        after, last = (axis + 1) % 3, (axis + 2) % 3
        difference = 0.0
        for j in range(3):
            difference += pose[last, j] * tip[after, j] - pose[after, j] * tip[last, j]
        opening[axis] = 0.5 * difference
        total += opening[axis] ** 2
    sine = sqrt(total)
    factor = length
    if sine > _NO_TURN:
        factor *= atan2(sine, 0.5 * (trace - 1.0)) / sine
    for axis in range(3):
        opening[axis] *= factor


@compiled
def displace(pose: FloatArray, twist: FloatArray, length: float) -> None:
    """Move a pose by a small scaled displacement, and keep its rotation orthonormal."""
    x, y, z = twist[0] / length, twist[1] / length, twist[2] / length
    squared = x * x + y * y + z * z
    angle = sqrt(squared)
    if angle < _SERIES_ANGLE:
        sine, cosine = 1.0 - squared / 6.0 + squared**2 / 120.0, 0.5 - squared / 24.0
    else:
        sine, cosine = sin(angle) / angle, 2.0 * (sin(0.5 * angle) / angle) ** 2
    turn, before = np.eye(3), pose[:3, :3].copy()
    _rotate(turn, x, y, z, sine, cosine)
    for i in range(3):
        for j in range(3):
            pose[i, j] = (
                turn[i, 0] * before[0, j] + turn[i, 1] * before[1, j] + turn[i, 2] * before[2, j]
            )
        pose[i, 3] += twist[3 + i]
    # One step towards the nearest orthonormal matrix: poses follow from one another for hours.
    turned = pose[:3, :3].copy()
    for i in range(3):
        for j in range(3):
            pose[i, j] = 1.5 * turned[i, j]
    for j in range(3):
        for k in range(3):
            product = 0.0
            for i in range(3):
                product += turned[i, j] * turned[i, k]
            for i in range(3):
                pose[i, k] -= 0.5 * turned[i, j] * product


@compiled
def invert_struts(
    moved: FloatArray, counts: IntArray, sizes: FloatArray, filling: FloatArray, most: FloatArray,
    joints: FloatArray, structure: FloatArray,
) -> bool:
    """Write what the inverted struts say; return whether they are far from singular.

    See `fault_tolerance.mechanism.regular.RegularStruts.inverted`.
    """
    matrix, inverse = np.empty((6, 6)), np.empty((6, 6))
    rows = 0
    for strut in range(len(counts)):
        count = counts[strut]
        columns = 0.0
        for j in range(6):
            for i in range(6):
                if j < count:
                    matrix[i, j] = moved[strut, j, i] / sizes[strut, j]
                else:
                    matrix[i, j] = filling[strut, i, j]
                columns += matrix[i, j] ** 2
        if not inverted(matrix, inverse):
            return False
        square = 0.0
        for i in range(6):
            for j in range(6):
                square += inverse[i, j] ** 2
        # The limits: of the inverse alone, with the drives' ratio, and that with the columns.
        reach = most[1] if most[2] > 0.0 else most[1] * columns
        if not (square <= most[0] and reach * square <= 1.0):
            return False
        first = rows
        for row in range(count, 6):
            for i in range(6):
                structure[rows, i] = inverse[row, i]
            for _ in range(2 if rows > first else 0):
                for other in range(first, rows):
                    share = 0.0
                    for i in range(6):
                        share += structure[other, i] * structure[rows, i]
                    for i in range(6):
                        structure[rows, i] -= share * structure[other, i]
            size = 0.0
            for i in range(6):
                size += structure[rows, i] ** 2
            size = sqrt(size)
            for i in range(6):
                structure[rows, i] /= size
            rows += 1
        for joint in range(count):
            for i in range(6):
                joints[strut, joint, i] = inverse[joint, i] / sizes[strut, joint]
            for row in range(first, rows):
                share = 0.0
                for i in range(6):
                    share += joints[strut, joint, i] * structure[row, i]
                for i in range(6):
                    joints[strut, joint, i] -= share * structure[row, i]
    return True
