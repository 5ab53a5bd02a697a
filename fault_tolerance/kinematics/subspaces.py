# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Ranks, bases and manipulability: every decision on whether a number is zero is made here."""

from __future__ import annotations

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.mechanism.linear_algebra import singular_values as singular_values
from fault_tolerance.tolerances import RANK_TOLERANCE


def rank_of(sigma: FloatArray, scale: float | None = None) -> int:
    """Return how many singular values ``sigma`` count as not zero.

    Parameters
    ----------
    sigma : (k,) array
    scale : float, optional
        What "not small" is measured against; the largest of them by default.
    """
    values: list[float] = sigma.tolist()
    if scale is None:
        scale = max(values, default=0.0)
    threshold = RANK_TOLERANCE * scale
    if not (scale > 0.0 and values):
        return 0
    if min(values) > threshold:
        return len(values)
    return sum(value > threshold for value in values)


def rank(matrix: FloatArray, scale: float | None = None) -> int:
    """Return the numerical rank of ``matrix`` (r, c)."""
    if matrix.size == 0:
        return 0
    return rank_of(singular_values(matrix), scale)


def null_space(matrix: FloatArray, scale: float | None = None) -> FloatArray:
    """Return an orthonormal basis (c, c - rank) of the right null space of ``matrix`` (r, c)."""
    if matrix.shape[0] == 0:
        return np.eye(matrix.shape[1])
    if matrix.shape[1] == 0:
        return np.zeros((0, 0))
    _, sigma, right = decomposed(matrix)
    return right[rank_of(sigma, scale) :].T


def range_basis(matrix: FloatArray, scale: float | None = None) -> FloatArray:
    """Return an orthonormal basis (r, rank) of the range of ``matrix`` (r, c)."""
    if matrix.size == 0:
        return np.zeros((matrix.shape[0], 0))
    left, sigma, _ = decomposed(matrix)
    return left[:, : rank_of(sigma, scale)]


def manipulability(matrix: FloatArray, order: int, scale: float | None = None) -> float:
    """Return w_r, the product of the r largest singular values, 0 if the rank is less than r.

    The classical measure, with the rank it needs made explicit (docs/theory.md, eq. 13): without
    it a matrix that has lost a direction can look healthy. w_0 = 1. ``scale`` is what "not
    small" is measured against, the largest singular value by default.
    """
    if order == 0:
        return 1.0
    if order > min(matrix.shape):
        return 0.0
    sigma = singular_values(matrix)
    if rank_of(sigma, scale) < order:
        return 0.0
    return float(np.prod(sigma[:order]))


def adds_rank(matrix: FloatArray) -> tuple[bool, ...]:
    """Return for each row of ``matrix`` (r, c) whether it is independent of those before it."""
    rows, columns = len(matrix), int(matrix.shape[1])
    largest = float(np.sqrt(np.einsum('ij,ij->i', matrix, matrix).max(initial=0.0)))
    # If the first rows span everything, they are independent and the others are not.
    first = singular_values(matrix[:columns])
    if len(first) == columns and min(first.tolist(), default=1.0) > RANK_TOLERANCE * largest:
        return (True,) * columns + (False,) * (rows - columns)
    basis: FloatArray = np.zeros((0, columns))
    result: list[bool] = []
    for row in matrix:
        rest = row - basis.T @ (basis @ row)
        rest = rest - basis.T @ (basis @ rest)
        size = float(np.linalg.norm(rest))
        new = bool(size > RANK_TOLERANCE * largest)
        if new:
            basis = np.vstack([basis, rest / size])
        result.append(new)
    return tuple(result)
