# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The measures of all single and double further failures of a few actuators, compiled.

What `fault_tolerance.kinematics.few_measures` does, with its thresholds.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from fault_tolerance.compiled.compiler import NUMBER, FloatArray, compiled, entry, numbers
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
