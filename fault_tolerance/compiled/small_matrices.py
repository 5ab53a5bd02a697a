# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Decompositions of small matrices in a few loops, for code that is compiled.

LAPACK is made for large matrices: for ones with a handful of rows, most of a call is spent on its
way to the work. What is here does that work only, and stays in the processor's first cache.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from fault_tolerance.compiled.compiler import FloatArray, compiled

_MOST_SWEEPS = 40
# Columns count as orthogonal from this cosine on, and as zero below this share of the matrix.
_ORTHOGONAL, _NOTHING = 1e-15, 1e-15


@compiled
def _fill(left: FloatArray, column: int) -> None:
    """Set a column to a unit vector at right angles to those before it."""
    rows = len(left)
    # The axis that the others say least about.
    best, least = 0, np.inf
    for axis in range(rows):
        said = 0.0
        for j in range(column):
            said += left[axis, j] ** 2
        if said < least:
            best, least = axis, said
    left[best, column] = 1.0
    for _ in range(2):
        for j in range(column):
            share = 0.0
            for i in range(rows):
                share += left[i, j] * left[i, column]
            for i in range(rows):
                left[i, column] -= share * left[i, j]
    size = 0.0
    for i in range(rows):
        size += left[i, column] ** 2
    for i in range(rows):
        left[i, column] /= sqrt(size)


@compiled
def decomposition(given: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what `fault_tolerance.mechanism.linear_algebra.decomposed` does.

    One-sided Jacobi (Hestenes 1958): columns are turned in pairs until all are orthogonal. As
    accurate as LAPACK and more so for small singular values (Demmel and Veselic, SIAM J. Matrix
    Anal. Appl. 13, 1992).

    Parameters
    ----------
    given : (r, c) array

    Returns
    -------
    left : (r, min(r, c)) array
    sigma : (min(r, c),) array
        Largest first.
    right : (c, c) array
        Rows are right singular directions.
    """
    rows, columns = given.shape
    width = min(rows, columns)
    # Both by columns: work[j] is what right[j] is turned into.
    work, right = np.empty((columns, rows)), np.zeros((columns, columns))
    total = 0.0
    for j in range(columns):
        right[j, j] = 1.0
        for i in range(rows):
            work[j, i] = given[i, j]
            total += given[i, j] ** 2
    nothing = _NOTHING**2 * total
    for _ in range(_MOST_SWEEPS):
        turned = False
        for p in range(columns - 1):
            for q in range(p + 1, columns):
                alpha = beta = gamma = 0.0
                for i in range(rows):
                    alpha += work[p, i] ** 2
                    beta += work[q, i] ** 2
                    gamma += work[p, i] * work[q, i]
                if (
                    alpha <= nothing and beta <= nothing
                ) or abs(gamma) <= _ORTHOGONAL * sqrt(alpha * beta):
                    continue
                if min(alpha, beta) <= nothing and abs(gamma) <= _ORTHOGONAL * max(alpha, beta):
                    continue
                turned = True
                ratio = (beta - alpha) / (2.0 * gamma)
                tangent = 1.0 / (abs(ratio) + sqrt(1.0 + ratio * ratio))
                if ratio < 0.0:
                    tangent = -tangent
                cosine = 1.0 / sqrt(1.0 + tangent * tangent)
                sine = cosine * tangent
                for i in range(rows):
                    one, other = work[p, i], work[q, i]
                    work[p, i] = cosine * one - sine * other
                    work[q, i] = sine * one + cosine * other
                for i in range(columns):
                    one, other = right[p, i], right[q, i]
                    right[p, i] = cosine * one - sine * other
                    right[q, i] = sine * one + cosine * other
        if not turned:
            break
    sizes = np.empty(columns)
    for j in range(columns):
        square = 0.0
        for i in range(rows):
            square += work[j, i] ** 2
        sizes[j] = sqrt(square)
    # Largest first: there are too few for anything but the simplest way of sorting.
    for j in range(columns - 1):
        largest = j
        for other in range(j + 1, columns):
            if sizes[other] > sizes[largest]:
                largest = other
        if largest != j:
            sizes[j], sizes[largest] = sizes[largest], sizes[j]
            for i in range(rows):
                work[j, i], work[largest, i] = work[largest, i], work[j, i]
            for i in range(columns):
                right[j, i], right[largest, i] = right[largest, i], right[j, i]
    left = np.zeros((rows, width))
    sigma = sizes[:width].copy()
    for j in range(width):
        if sizes[j] > _NOTHING * sqrt(total):
            for i in range(rows):
                left[i, j] = work[j, i] / sizes[j]
        else:
            _fill(left, j)
    return left, sigma, right


@compiled
def inverted(given: FloatArray, result: FloatArray) -> bool:
    """Write the inverse of a square matrix, by elimination with pivots; False if it has none.

    The matrix given is used up.
    """
    size = len(given)
    for i in range(size):
        for j in range(size):
            result[i, j] = 1.0 if i == j else 0.0
    for column in range(size):
        pivot = column
        for i in range(column + 1, size):
            if abs(given[i, column]) > abs(given[pivot, column]):
                pivot = i
        if not abs(given[pivot, column]) > 0.0:
            return False
        if pivot != column:
            for j in range(size):
                given[column, j], given[pivot, j] = given[pivot, j], given[column, j]
                result[column, j], result[pivot, j] = result[pivot, j], result[column, j]
        factor = 1.0 / given[column, column]
        for j in range(size):
            given[column, j] *= factor
            result[column, j] *= factor
        for i in range(size):
            if i == column:
                continue
            share = given[i, column]
            if share == 0.0:
                continue
            for j in range(size):
                given[i, j] -= share * given[column, j]
                result[i, j] -= share * result[column, j]
    return True
