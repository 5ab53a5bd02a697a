# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Products and factorisations of small dense matrices, as plain loops.

LAPACK spends most of a call on a 4 x 6 matrix on its way to the work. All matrices here are
C-contiguous float64 arrays, and every result is a new one.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import MACHINE_TOLERANCE, RANK_TOLERANCE

MOST_SWEEPS = 40
"""Sweeps of Jacobi rotations; five to eight are usual, so this is never the end of it."""


def dot(a: FloatArray, b: FloatArray) -> float:
    """Return the scalar product of two vectors ``a`` and ``b`` (k,)."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


def norm(vector: FloatArray) -> float:
    """Return the Euclidean norm of a ``vector`` (k,)."""
    return sqrt(dot(vector, vector))


def frobenius(matrix: FloatArray) -> float:
    """Return the Frobenius norm of a ``matrix`` (r, c)."""
    total = 0.0
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * matrix[i, j]
    return sqrt(total)


def combined(a: float, x: FloatArray, b: float, y: FloatArray) -> FloatArray:
    """Return ``a x + b y`` of two vectors (k,)."""
    result = np.empty(len(x))
    for i in range(len(x)):
        result[i] = a * x[i] + b * y[i]
    return result


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return ``a @ b`` (r, c) of matrices (r, k) and (k, c)."""
    result = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            factor = a[i, k]
            for j in range(b.shape[1]):
                result[i, j] += factor * b[k, j]
    return result


def rows_of(matrix: FloatArray, chosen: FloatArray) -> FloatArray:
    """Return the rows of ``matrix`` (r, c) where ``chosen`` (r,) is not 0."""
    count = 0
    for i in range(len(chosen)):
        if chosen[i] != 0.0:
            count += 1
    result = np.empty((count, matrix.shape[1]))
    count = 0
    for i in range(len(chosen)):
        if chosen[i] != 0.0:
            for j in range(matrix.shape[1]):
                result[count, j] = matrix[i, j]
            count += 1
    return result


def columns_from(right: FloatArray, first: int) -> FloatArray:
    """Return the right singular directions ``right[first:]`` (rows) as columns (c, c - first)."""
    count = right.shape[0]
    result = np.empty((count, count - first))
    for k in range(first, count):
        for i in range(count):
            result[i, k - first] = right[k, i]
    return result


def rank_of(sigma: FloatArray, scale: float) -> int:
    """Return how many singular values ``sigma`` (k,) count as not zero beside ``scale``."""
    count = 0
    for k in range(len(sigma)):
        if sigma[k] > RANK_TOLERANCE * scale:
            count += 1
    return count


def largest_of(sigma: FloatArray) -> float:
    """Return the first of the singular values ``sigma`` (k,), 0 if there are none."""
    if len(sigma) == 0:
        return 0.0
    return sigma[0]


def svd(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return left (r, min(r, c)), sigma and right (c, c) of ``matrix`` (r, c), largest first.

    The rows of ``right`` include the null space; columns of ``left`` are zero where sigma is.
    One-sided Jacobi (Hestenes 1958): columns are rotated in pairs until all are orthogonal. It is
    as accurate as LAPACK, and more so for small singular values (Demmel and Veselic, SIAM J.
    Matrix Anal. Appl. 13, 1992).
    """
    rows, columns = matrix.shape
    width = min(rows, columns)
    # Row j of both is column j of the matrix: loops run along memory.
    work, right = np.empty((columns, rows)), np.zeros((columns, columns))
    total = 0.0
    for j in range(columns):
        right[j, j] = 1.0
        for i in range(rows):
            work[j, i] = matrix[i, j]
            total += matrix[i, j] * matrix[i, j]
    for _ in range(MOST_SWEEPS):
        if not _sweep(work, right, MACHINE_TOLERANCE**2 * total):
            break
    sizes = np.empty(columns)
    for j in range(columns):
        sizes[j] = norm(work[j])
    _sort(sizes, work, right)
    left, sigma = np.zeros((rows, width)), np.empty(width)
    for j in range(width):
        sigma[j] = sizes[j]
        if sizes[j] > MACHINE_TOLERANCE * sqrt(total):
            for i in range(rows):
                left[i, j] = work[j, i] / sizes[j]
    return left, sigma, right


def _sweep(work: FloatArray, right: FloatArray, nothing: float) -> bool:
    """Rotate every pair of the vectors ``work`` (c, r) once; return whether any needed it."""
    rotated = False
    for p in range(len(work) - 1):
        for q in range(p + 1, len(work)):
            alpha = beta = gamma = 0.0
            for i in range(work.shape[1]):
                alpha += work[p, i] * work[p, i]
                beta += work[q, i] * work[q, i]
                gamma += work[p, i] * work[q, i]
            if abs(gamma) <= MACHINE_TOLERANCE * sqrt(alpha * beta):
                continue
            smaller, larger = min(alpha, beta), max(alpha, beta)
            if larger <= nothing or (
                smaller <= nothing and abs(gamma) <= MACHINE_TOLERANCE * larger
            ):
                continue
            rotated = True
            ratio = (beta - alpha) / (2.0 * gamma)
            tangent = 1.0 / (abs(ratio) + sqrt(1.0 + ratio * ratio))
            if ratio < 0.0:
                tangent = -tangent
            cosine = 1.0 / sqrt(1.0 + tangent * tangent)
            _rotate_pair(work, p, q, cosine, cosine * tangent)
            _rotate_pair(right, p, q, cosine, cosine * tangent)
    return rotated


def _rotate_pair(vectors: FloatArray, p: int, q: int, cosine: float, sine: float) -> None:
    """Rotate the rows p and q of ``vectors`` into each other, in place."""
    for i in range(vectors.shape[1]):
        one, other = vectors[p, i], vectors[q, i]
        vectors[p, i] = cosine * one - sine * other
        vectors[q, i] = sine * one + cosine * other


def _sort(sizes: FloatArray, work: FloatArray, right: FloatArray) -> None:
    """Order ``sizes`` (c,) and the rows of the other two by size, largest first, in place."""
    for j in range(len(sizes) - 1):
        largest = j
        for other in range(j + 1, len(sizes)):
            if sizes[other] > sizes[largest]:
                largest = other
        if largest != j:
            sizes[j], sizes[largest] = sizes[largest], sizes[j]
            _rotate_pair(work, j, largest, 0.0, -1.0)
            _rotate_pair(right, j, largest, 0.0, -1.0)


def singular_values(matrix: FloatArray) -> FloatArray:
    """Return the singular values (min(r, c),) of ``matrix`` (r, c), largest first."""
    _, sigma, _ = svd(matrix)
    return sigma


def pseudo_inverse(
    left: FloatArray, sigma: FloatArray, right: FloatArray, rank: int
) -> FloatArray:
    """Return the pseudo-inverse (c, r) of ``left diag(sigma) right``, ``rank`` terms of it."""
    result = np.zeros((right.shape[1], left.shape[0]))
    for k in range(rank):
        for i in range(right.shape[1]):
            factor = right[k, i] / sigma[k]
            for j in range(left.shape[0]):
                result[i, j] += factor * left[j, k]
    return result


def orthonormalise(basis: FloatArray) -> None:
    """Make the independent columns of ``basis`` (r, c) orthonormal, in place.

    Gram-Schmidt twice, which is as good as Householder's (Giraud et al. 2005).
    """
    for j in range(basis.shape[1]):
        for _ in range(2):
            for k in range(j):
                share = 0.0
                for i in range(len(basis)):
                    share += basis[i, k] * basis[i, j]
                for i in range(len(basis)):
                    basis[i, j] -= share * basis[i, k]
        size = 0.0
        for i in range(len(basis)):
            size += basis[i, j] * basis[i, j]
        if size > 0.0:
            for i in range(len(basis)):
                basis[i, j] /= sqrt(size)
