# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From one configuration to a near one, compiled.

What `fault_tolerance.mechanism.tracking.tracked` does where as many constraints count all the way:
chord steps with the decompositions of the configuration before, then everything that the struts
say at the new one; from there on again, until all is as close as it is to be.
"""

from __future__ import annotations

from math import sqrt
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
from fault_tolerance.compiled.placing import displace, invert_struts, place_struts
from fault_tolerance.compiled.small_matrices import decomposition
from fault_tolerance.tolerances import CLOSURE_TOLERANCE, RANK_TOLERANCE

_MOST_EVALUATIONS = 4
_MOST_CHORDS = 4


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
        displace(pose, twist, unit)
        for strut in range(values.shape[0]):
            for joint in range(values.shape[1]):
                values[strut, joint] += rates[strut, joint]
        place_struts(screws, lengths, origin, unit, pose, values, moved, openings)
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
        Limits on the inverted struts; see `fault_tolerance.compiled.placing.invert_struts`.
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
        sound = sound and invert_struts(moved, lengths, sizes, filling, most, joints, all_rows)
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
