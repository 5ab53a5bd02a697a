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
    """Return how many of the singular values ``sigma`` (k,) are not zero, compared with ``scale``.

    By default they are compared with the largest of them.
    """
    if scale is None:
        scale = float(sigma.max(initial=0.0))
    return int((sigma > RANK_TOLERANCE * scale).sum()) if scale > 0.0 else 0


def rank(matrix: FloatArray, scale: float | None = None) -> int:
    """Return the numerical rank of ``matrix`` (r, c); ``scale`` as in `rank_of`."""
    return rank_of(singular_values(matrix), scale)


def null_space(matrix: FloatArray, scale: float | None = None) -> FloatArray:
    """Return a basis (c, c - rank) of the null space of ``matrix`` (r, c), orthonormal.

    ``scale`` as in `rank_of`.
    """
    _, sigma, right = decomposed(matrix)
    return right[rank_of(sigma, scale) :].T


def range_basis(matrix: FloatArray, scale: float | None = None) -> FloatArray:
    """Return an orthonormal basis (r, rank) of the range of ``matrix`` (r, c).

    ``scale`` as in `rank_of`.
    """
    left, sigma, _ = decomposed(matrix)
    return left[:, : rank_of(sigma, scale)]


def manipulability(matrix: FloatArray, order: int, scale: float | None = None) -> float:
    """Return w_r, the product of the r largest singular values of ``matrix`` (rows, columns).

    The classical measure, with the rank r it needs, ``order``, made explicit (docs/theory.md, eq.
    13): 0 for less rank, as a matrix that has lost a direction could look healthy. w_0 = 1.
    ``scale`` as in `rank_of`.
    """
    if order == 0:
        return 1.0
    if order > min(matrix.shape):
        return 0.0
    sigma = singular_values(matrix)
    if rank_of(sigma, scale) < order:
        return 0.0
    return float(np.prod(sigma[:order]))


def manipulabilities(matrices: FloatArray, order: int, scale: float | None = None) -> FloatArray:
    """Return w_r (q,) of each of ``matrices`` (q, r, c); ``order``, ``scale`` as above."""
    if order == 0:
        return np.ones(len(matrices))
    if order > min(matrices.shape[1:]):
        return np.zeros(len(matrices))
    sigma = np.linalg.svd(matrices, compute_uv=False)
    largest = sigma[:, 0] if scale is None else scale
    full = sigma[:, order - 1] > RANK_TOLERANCE * largest
    return np.where(full, sigma[:, :order].prod(axis=1), 0.0)


def adds_rank(matrix: FloatArray) -> tuple[bool, ...]:
    """Return for each row of ``matrix`` (r, c) whether it is independent of those before it."""
    largest = float(np.linalg.norm(matrix, axis=1).max(initial=0.0))
    basis, result = np.zeros((0, matrix.shape[1])), []
    for row in matrix:
        rest = row - basis.T @ (basis @ row)
        rest = rest - basis.T @ (basis @ rest)
        size = float(np.linalg.norm(rest))
        new = size > RANK_TOLERANCE * largest
        if new:
            basis = np.vstack([basis, rest / size])
        result.append(new)
    return tuple(result)
