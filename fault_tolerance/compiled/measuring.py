# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The measures of all single and double further failures of a few actuators, compiled.

What `fault_tolerance.kinematics.few_measures` does, with its thresholds.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from fault_tolerance.compiled.compiler import (
    NUMBER,
    FloatArray,
    IntArray,
    compiled,
    counts,
    entry,
    flags,
    numbers,
)
from fault_tolerance.compiled.following import free_motions, kept_constraints
from fault_tolerance.compiled.resolving import reconfigure
from fault_tolerance.compiled.small_matrices import decomposition
from fault_tolerance.tolerances import RANK_TOLERANCE


@compiled
def _square(rows: FloatArray, i: int) -> float:
    """Return the square of the length of a row."""
    total = 0.0
    for k in range(rows.shape[1]):
        total += rows[i, k] ** 2
    return total


@compiled
def _area(rows: FloatArray, i: int, j: int) -> float:
    """Return the area between two rows, from minors (Lagrange's identity)."""
    total = 0.0
    for k in range(rows.shape[1] - 1):
        for m in range(k + 1, rows.shape[1]):
            total += (rows[i, k] * rows[j, m] - rows[j, k] * rows[i, m]) ** 2
    return sqrt(total)


@entry(numbers(2))
def torque_of_few(mapping: FloatArray) -> FloatArray:
    """Return t (N, N) of all pairs of the rows of T (N, n), the single ones on the diagonal."""
    count, mobility = mapping.shape
    found = np.zeros((count, count))
    if count == mobility:
        return found
    rest = decomposition(mapping.T)[2][mobility:].T
    squares = np.empty(count)
    for i in range(count):
        squares[i] = _square(rest, i)
        found[i, i] = sqrt(squares[i])
        if found[i, i] <= RANK_TOLERANCE:
            found[i, i] = 0.0
    for i in range(count):
        for j in range(i):
            area = _area(rest, i, j)
            half = 0.5 * (squares[i] + squares[j])
            larger = sqrt(half + sqrt(max(half * half - area * area, 0.0)))
            found[i, j] = found[j, i] = 0.0 if area <= RANK_TOLERANCE * larger else area
    return found


@entry(numbers(2), numbers(2), NUMBER, NUMBER, NUMBER)
def position_of_few(
    mapping: FloatArray, major: FloatArray, short: float, flat: float, rounding: float
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return p (N, N) of all pairs of the rows of T (N, n), and which of them are doubtful.

    Parameters
    ----------
    mapping : (N, n) array
    major : (m, n) array
        J_m.
    short, flat, rounding : float
        Rows, areas relative to what they could be, and measures that are too small to go by.
    """
    count, mobility = mapping.shape
    found, doubtful = np.zeros((count, count)), np.zeros((count, count), dtype=np.bool_)
    _, sigma, right = decomposition(major)
    rank = len(major)
    best = sigma[0] if len(sigma) else 1.0
    if len(sigma) < rank or (rank and sigma[rank - 1] <= RANK_TOLERANCE * best):
        return found, doubtful
    sizes, smallest = np.empty(count), np.inf
    for i in range(count):
        sizes[i] = sqrt(_square(mapping, i))
        smallest = min(smallest, sizes[i])
    if rank == mobility and smallest > short:
        return found, doubtful
    spare = np.zeros((count, mobility - rank))
    for i in range(count):
        for k in range(mobility - rank):
            for m in range(mobility):
                spare[i, k] += mapping[i, m] * right[rank + k, m]
    # What J_m keeps is at least p times its smallest singular value: below this it may be 0.
    least = RANK_TOLERANCE * (best / sigma[rank - 1] if rank else 1.0)
    for i in range(count):
        for j in range(i + 1):
            if i == j:
                area, limit = sizes[i], flat * sizes[i] * sizes[i]
                unclear = area <= short
                left = sqrt(_square(spare, i))
            else:
                area, limit = _area(mapping, i, j), flat * sizes[i] * sizes[j]
                unclear = area <= limit or limit <= flat * short * short
                left = _area(spare, i, j)
            value = left if unclear else min(left / area, 1.0)
            if value <= least:
                if value <= rounding:
                    value = 0.0
                else:
                    unclear = True
            found[i, j] = found[j, i] = value
            doubtful[i, j] = doubtful[j, i] = unclear
    return found, doubtful


@compiled
def _of(drives: IntArray, struts: IntArray, lost: int) -> IntArray:
    """Return those of ``drives`` that are not of one strut."""
    count = 0
    for drive in drives:
        if struts[drive] != lost:
            count += 1
    result, place = np.empty(count, np.intp), 0
    for drive in drives:
        if struts[drive] != lost:
            result[place] = drive
            place += 1
    return result


@compiled
def _largest(sigma: FloatArray, order: int) -> float:
    """Return the product of the ``order`` largest singular values, 0 if the rank is less."""
    if order == 0:
        return 1.0
    if order > len(sigma) or not sigma[order - 1] > RANK_TOLERANCE * sigma[0]:
        return 0.0
    product = 1.0
    for k in range(order):
        product *= sigma[k]
    return product


@entry(
    numbers(2), counts(), numbers(2), counts(), flags(), counts(), counts(), NUMBER, numbers(1),
    counts(), NUMBER, numbers(2),
)
def hard_of_few(
    structure: FloatArray, owners: IntArray, drives: FloatArray, struts: IntArray,
    attached: NDArray[np.bool_], stuck: IntArray, driving: IntArray, unit: float,
    weights: FloatArray, task: IntArray, compliance: float, jacobian: FloatArray,
) -> FloatArray:
    """Return h (s,) of the loss of each strut, by definition; NaN for those lost already.

    Parameters
    ----------
    structure, owners : (g, 6) array, (g,) int array
        What the structure of all struts bars, and whose each row is.
    drives, struts : (N, 6) array, (N,) int array
        The drives' rates for a twist, and whose each drive is.
    attached : (s,) bool array
        Struts that are not lost.
    stuck, driving, unit, weights, task
        See `fault_tolerance.compiled.resolving.reconfigure`.
    compliance : float
    jacobian : (l, n) array
        The present one.
    """
    result = np.full(len(attached), np.nan)
    basis, sigma, _ = decomposition(jacobian)
    order = 0
    for value in sigma:
        if value > RANK_TOLERANCE * sigma[0]:
            order += 1
    before = _largest(sigma, order)
    nothing, none = np.zeros((0, 0)), np.zeros(0)
    row_left, place_left = np.empty(len(owners), np.intp), np.empty(len(struts), np.intp)
    for lost in range(len(attached)):
        if not attached[lost]:
            continue
        rows = 0
        for row in range(len(owners)):
            if attached[owners[row]] and owners[row] != lost:
                row_left[rows] = row
                rows += 1
        left = np.empty((rows, 6))
        for row in range(rows):
            for i in range(6):
                left[row, i] = structure[row_left[row], i]
        _, barred, right = decomposition(left)
        kept = kept_constraints(barred, compliance)
        places = 0
        for drive in range(len(struts)):
            if attached[struts[drive]] and struts[drive] != lost:
                place_left[places] = drive
                places += 1
        held = place_left[:places].copy()
        twists, rates = free_motions(right, drives, held, kept)
        still_stuck, still_driving = _of(stuck, struts, lost), _of(driving, struts, lost)
        found = reconfigure(
            twists, rates, held, len(struts), still_stuck, still_driving, unit, weights, task,
            task[:0], none, False, nothing, none, nothing,
        )
        result[lost] = 0.0
        if found[0]:
            after = np.zeros((order, found[1].shape[1]))
            for k in range(order):
                for j in range(found[1].shape[1]):
                    for i in range(len(task)):
                        after[k, j] += basis[i, k] * found[1][i, j]
            remaining = _largest(decomposition(after)[1], order)
            if remaining > 0.0:
                result[lost] = before / remaining
    return result
