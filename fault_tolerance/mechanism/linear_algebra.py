# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Decompositions of single small matrices, by LAPACK without the wrappers around it.

A control cycle decomposes a handful of matrices with a few rows. `numpy.linalg.svd` spends three
quarters of such a call on checks and conversions, so LAPACK's ``dgesdd``, which it too ends in,
is called directly. For stacks of matrices, and for large ones, `numpy.linalg` is as fast.
"""

from __future__ import annotations

from math import isfinite, sqrt

import numpy as np
from scipy.linalg.lapack import dgesdd

from fault_tolerance.mechanism.arrays import FloatArray

_ONES = np.ones(64)
_ONES.setflags(write=False)


def decomposed(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the singular value decomposition of ``matrix`` (r, c), all right directions included.

    Returns
    -------
    left : (r, min(r, c)) array
        Never a square matrix of the rows' number.
    sigma : (min(r, c),) array
        Largest first.
    right : (c, c) array
        Rows are right singular directions; the last c - rank span the null space.

    Raises
    ------
    numpy.linalg.LinAlgError
        If ``matrix`` is not finite.
    """
    rows, columns = matrix.shape
    if rows == 0 or columns == 0:
        return np.zeros((rows, 0)), np.zeros(0), np.eye(columns)
    left, sigma, right, info = dgesdd(matrix, 1, 1 if rows < columns else 0)
    if info != 0:
        # numpy has the same routine, and says what is wrong.
        left, sigma, right = np.linalg.svd(matrix, full_matrices=rows < columns)
    return left, sigma, right


def singular_values(matrix: FloatArray) -> FloatArray:
    """Return the singular values of ``matrix`` (r, c), largest first; none if it is empty."""
    rows, columns = matrix.shape
    if rows == 0 or columns == 0:
        return np.zeros(0)
    if rows == 1 or columns == 1:
        return np.array([length(matrix)])
    _, sigma, _, info = dgesdd(matrix, 0)
    if info != 0:
        sigma = np.linalg.svd(matrix, compute_uv=False)
    return np.asarray(sigma)


def row_products(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the scalar products (r,) of the rows of two arrays (r, c)."""
    width = first.shape[1]
    ones = _ONES[:width] if width <= len(_ONES) else np.ones(width)
    products: FloatArray = (first * second).dot(ones)
    return products


def length(array: FloatArray) -> float:
    """Return the Euclidean (Frobenius) norm of ``array``."""
    flat = array.ravel()
    squared = float(flat.dot(flat))
    # Squares of what is very large or very small are lost; then the scaled norm.
    if isfinite(squared) and squared > 1e-200:
        return sqrt(squared)
    return _scaled_length(flat)


def _scaled_length(flat: FloatArray) -> float:
    largest = float(np.abs(flat).max(initial=0.0))
    if largest == 0.0 or not isfinite(largest):
        return largest
    return largest * float(np.linalg.norm(flat / largest))
