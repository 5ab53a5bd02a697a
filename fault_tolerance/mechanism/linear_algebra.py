# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Singular value decompositions that accept matrices without rows or columns."""

from __future__ import annotations

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray


def decomposed(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the singular value decomposition of ``matrix`` (r, c), all right directions included.

    Returns left (r, min(r, c)), sigma (min(r, c),) with the largest first, and right (c, c): its
    rows are right singular directions, and the last c - rank of them span the null space.
    """
    rows, columns = matrix.shape
    if rows == 0 or columns == 0:
        return np.zeros((rows, 0)), np.zeros(0), np.eye(columns)
    left, sigma, right = np.linalg.svd(matrix, full_matrices=rows < columns)
    return left, sigma, right


def singular_values(matrix: FloatArray) -> FloatArray:
    """Return the singular values of ``matrix`` (r, c), largest first; none if it is empty."""
    if matrix.size == 0:
        return np.zeros(0)
    return np.asarray(np.linalg.svd(matrix, compute_uv=False))
