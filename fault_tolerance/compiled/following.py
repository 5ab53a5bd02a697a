# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From one configuration to a near one, compiled.

What `fault_tolerance.mechanism.tracking.tracked` does where as many constraints count all the way:
chord steps with the decompositions of the configuration before, then everything that the struts
say at the new one; from there on again, until all is as close as it is to be.
"""

from __future__ import annotations

from math import atan2, sin, sqrt
from typing import Any

import numpy as np

from fault_tolerance.compiled.compiler import (
    COUNT,
    NUMBER,
    FloatArray,
    IntArray,
    compiled,
    counts,
    entry,
    flags,
    numbers,
)
from fault_tolerance.compiled.small_matrices import decomposition, inverted
from fault_tolerance.tolerances import CLOSURE_TOLERANCE, RANK_TOLERANCE

_MOST_EVALUATIONS = 4
_MOST_CHORDS = 4
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
def _place(
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
def _displace(pose: FloatArray, twist: FloatArray, length: float) -> None:
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
def _invert(
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


@compiled
def kept_constraints(sigma: FloatArray, compliance: float) -> int:
    """Return how many structural constraints are not absorbed."""
    if len(sigma) == 0:
        return 0
    threshold = max(compliance, RANK_TOLERANCE * sigma[0])
    count = 0
    for value in sigma:
        if value > threshold:
            count += 1
    return count


@compiled
def _open(
    openings: FloatArray, attached: FloatArray, structure: FloatArray, owners: IntArray,
    left: FloatArray, kept: int,
) -> tuple[float, float]:
    """Return what is open outside, and along, the absorbed directions, metres."""
    rest = np.zeros(openings.shape)
    for strut in range(len(openings)):
        if attached[strut]:
            for i in range(6):
                rest[strut, i] = openings[strut, i]
    rows = len(owners)
    misclosure = np.zeros(rows)
    for row in range(rows):
        for i in range(6):
            misclosure[row] += structure[row, i] * openings[owners[row], i]
    strain = misclosure.copy()
    for j in range(kept):
        share = 0.0
        for row in range(rows):
            share += left[row, j] * misclosure[row]
        for row in range(rows):
            strain[row] -= share * left[row, j]
    along = outside = 0.0
    for row in range(rows):
        along += strain[row] ** 2
        for i in range(6):
            rest[owners[row], i] -= strain[row] * structure[row, i]
    for strut in range(len(openings)):
        for i in range(6):
            outside += rest[strut, i] ** 2
    return sqrt(outside), sqrt(along)


@compiled
def _step(
    target: FloatArray, values: FloatArray, openings: FloatArray, joints: FloatArray,
    structure: FloatArray, owners: IntArray, closing: FloatArray, drives: FloatArray,
    held: IntArray, struts: IntArray, places: IntArray, fit: FloatArray, twist: FloatArray,
    rates: FloatArray,
) -> None:
    """Write one Gauss-Newton step, the scaled twist (6,) and the joint rates (s, k)."""
    closed = np.zeros(6)
    for row in range(len(owners)):
        misclosure = 0.0
        for i in range(6):
            misclosure += structure[row, i] * openings[owners[row], i]
        for i in range(6):
            closed[i] += closing[i, row] * misclosure
    for i in range(6):
        twist[i] = closed[i]
    for place in range(len(held)):
        drive = held[place]
        strut = struts[drive]
        error = target[drive] - values[strut, places[drive]]
        for i in range(6):
            error -= drives[drive, i] * (openings[strut, i] + closed[i])
        for i in range(6):
            twist[i] += fit[i, place] * error
    for strut in range(rates.shape[0]):
        for joint in range(rates.shape[1]):
            rate = 0.0
            for i in range(6):
                rate += joints[strut, joint, i] * (openings[strut, i] + twist[i])
            rates[strut, joint] = rate


@compiled
def _chords(
    screws: FloatArray, lengths: IntArray, origin: FloatArray, struts: IntArray,
    places: IntArray, drive_sizes: FloatArray, unit: float, held: IntArray, owners: IntArray,
    pose: FloatArray, values: FloatArray, openings: FloatArray, joints: FloatArray,
    structure: FloatArray, closing: FloatArray, drives: FloatArray, fit: FloatArray,
    target: FloatArray, shortest: float, farthest: float, moved: FloatArray,
) -> tuple[int, bool]:
    """Move pose, joint values and openings by steps with the same decompositions.

    Return how many there were, 0 if that went too far, and whether the last was short enough.
    """
    twist, rates = np.empty(6), np.empty(values.shape)
    travelled, arrived = 0.0, False
    for taken in range(1, _MOST_CHORDS + 1):
        _step(target, values, openings, joints, structure, owners, closing, drives, held, struts,
              places, fit, twist, rates)
        square = driven = 0.0
        for i in range(6):
            square += twist[i] ** 2
        for drive in held:
            driven += (rates[struts[drive], places[drive]] * drive_sizes[drive]) ** 2
        # Of two numbers one of which is none, max may return either.
        step = sqrt(max(square, driven)) if square + driven < np.inf else np.inf
        travelled += step
        if not travelled <= farthest:
            return 0, False
        _displace(pose, twist, unit)
        for strut in range(values.shape[0]):
            for joint in range(values.shape[1]):
                values[strut, joint] += rates[strut, joint]
        _place(screws, lengths, origin, unit, pose, values, moved, openings)
        arrived = step * travelled <= shortest**2
        if arrived and travelled > shortest:
            misfit = 0.0
            for drive in held:
                off = target[drive] - values[struts[drive], places[drive]]
                misfit += (off * drive_sizes[drive]) ** 2
            arrived = sqrt(misfit) * travelled <= shortest**2
        if arrived:
            return taken, True
    return _MOST_CHORDS, False


@compiled
def _closing(left: FloatArray, sigma: FloatArray, right: FloatArray, kept: int) -> FloatArray:
    """Return what turns misclosures (g,) into the twist that mends them, (6, g)."""
    closing = np.zeros((6, len(left)))
    for j in range(kept):
        for row in range(len(left)):
            for i in range(6):
                closing[i, row] -= right[j, i] * left[row, j] / sigma[j]
    return closing


@compiled
def free_motions(
    right: FloatArray, drives: FloatArray, held: IntArray, kept: int
) -> tuple[FloatArray, FloatArray]:
    """Return the twists (6, b) that the structure allows, and the drives' rates (h, b)."""
    width = 6 - kept
    twists, rates = np.empty((6, width)), np.zeros((len(held), width))
    for j in range(width):
        for i in range(6):
            twists[i, j] = right[kept + j, i]
    for place in range(len(held)):
        for j in range(width):
            for i in range(6):
                rates[place, j] += drives[held[place], i] * twists[i, j]
    return twists, rates


@compiled
def _fit(
    twists: FloatArray, left: FloatArray, gains: FloatArray, right: FloatArray
) -> FloatArray:
    """Return the twist (6, h) that fits the rates of drives best."""
    fit = np.zeros((6, len(left)))
    along = np.empty(6)
    for j in range(len(gains)):
        along[:] = 0.0
        for b in range(len(right)):
            for i in range(6):
                along[i] += twists[i, b] * right[j, b]
        for place in range(len(left)):
            for i in range(6):
                fit[i, place] += along[i] * left[place, j] / gains[j]
    return fit


@entry(
    numbers(3), counts(), numbers(2), numbers(3), numbers(1), counts(), counts(), numbers(1),
    numbers(1), NUMBER,
    flags(), counts(), counts(), counts(),
    numbers(2), numbers(2), numbers(2), numbers(3), numbers(2), numbers(2), numbers(2), numbers(2),
    numbers(1), COUNT, NUMBER, NUMBER, NUMBER,
)
def follow(
    screws: FloatArray, lengths: IntArray, sizes: FloatArray, filling: FloatArray,
    origin: FloatArray, struts: IntArray, places: IntArray, drive_sizes: FloatArray,
    most: FloatArray, unit: float,
    attached: FloatArray, held: IntArray, in_use: IntArray, owners: IntArray,
    pose: FloatArray, values: FloatArray, openings: FloatArray, joints: FloatArray,
    structure: FloatArray, closing: FloatArray, drives: FloatArray, fit: FloatArray,
    target: FloatArray, kept: int, compliance: float, shortest: float, farthest: float,
) -> tuple[Any, ...]:
    """Return the configuration that fits ``target`` best, and what the struts say there.

    Parameters
    ----------
    screws : (s, k, 6) array
        Joint twists at home, v at the base's origin.
    lengths : (s,) int array
        Joints of each strut.
    sizes : (s, k) array
        Lengths of the scaled screws at home, 1 where padded.
    filling : (s, 6, 6) array
        Directions that make the screws of each strut square.
    origin : (3,) array
        The platform's origin at home.
    struts, places : (N,) int array
        Strut and joint of each drive.
    drive_sizes : (N,) array
    most : (3,) array
        Limits on the inverted struts; see `_invert`.
    unit : float
        The characteristic length.
    attached : (s,) bool array
    held : (h,) int array
        Drives of attached struts.
    in_use, owners : (g,) int array
        Structural rows of attached struts, and whose each is.
    pose, values, openings, joints, drives
        The configuration before: (4, 4), (s, k), (s, 6), (s, k, 6), (N, 6) arrays.
    structure, closing, fit
        Steps away from it: (g, 6), (6, g), (6, h) arrays.
    target : (N,) array
        Joint values of the drives.
    kept : int
        Structural constraints that counted there.
    compliance, shortest, farthest : float

    Returns
    -------
    steps : int
        How many were taken; 0 if the definition is to be asked instead.
    further
        The new pose, joint values, those of drives, openings, joints, structural rows of all
        struts, drive rows; the structural rows in use decomposed (3 arrays); twists and rates
        they leave free, the rates decomposed (3); the steps away from here, closing and fit;
        what is open (2).
    """
    pose, values, openings = pose.copy(), values.copy(), openings.copy()
    joints, structure, closing = joints.copy(), structure.copy(), closing.copy()
    drives, fit = drives.copy(), fit.copy()
    moved, reached = np.zeros(screws.shape), np.empty(len(struts))
    gaps = 0
    for count in lengths:
        gaps += 6 - count
    all_rows, rows = np.zeros((gaps, 6)), np.zeros((len(in_use), 6))
    steps = 0
    for _ in range(_MOST_EVALUATIONS):
        taken, arrived = _chords(
            screws, lengths, origin, struts, places, drive_sizes, unit, held, owners,
            pose, values, openings, joints, structure, closing, drives, fit, target, shortest,
            farthest, moved,
        )
        steps += taken
        sound = taken > 0
        # What the former evaluation returned, or the caller gave, stays as it is.
        joints, all_rows = np.zeros(joints.shape), np.zeros((gaps, 6))
        sound = sound and _invert(moved, lengths, sizes, filling, most, joints, all_rows)
        drives = np.empty((len(struts), 6))
        for drive in range(len(struts)):
            reached[drive] = values[struts[drive], places[drive]]
            for i in range(6):
                drives[drive, i] = joints[struts[drive], places[drive], i]
        rows = np.zeros((len(in_use), 6))
        if sound:  # else zeros, which decompose at once
            for row in range(len(in_use)):
                for i in range(6):
                    rows[row, i] = all_rows[in_use[row], i]
        left, sigma, right = decomposition(rows)
        if kept_constraints(sigma, compliance) != kept:
            sound, kept = False, 0
        structure = rows
        outside, along = _open(openings, attached, rows, owners, left, kept)
        closing = _closing(left, sigma, right, kept)
        twists, free = free_motions(right, drives, held, kept)
        turned, gains, mixed = decomposition(free)
        fit = _fit(twists, turned, gains, mixed)
        if not sound:
            steps = 0
            break
        if arrived and outside <= CLOSURE_TOLERANCE:
            break
        # What the drives do not determine cannot be followed any farther here.
        if len(gains) < twists.shape[1] or not gains[-1] > RANK_TOLERANCE * gains[0]:
            steps = 0
            break
    else:
        steps = 0
    return (
        steps, pose, values, reached, openings, joints, all_rows, drives,
        left, sigma, right, twists, free, turned, gains, mixed, closing, fit, outside, along,
    )
