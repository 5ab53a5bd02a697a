# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Vectors and small dense matrices: products, and singular values by Jacobi rotations.

For a 4 x 6 matrix nearly all of a call of LAPACK is overhead.
"""

from math import sqrt
from typing import NamedTuple

from fault_tolerance.kernel.scratch import matrix, set_identity, set_zero, vector
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import MACHINE_TOLERANCE, RANK_TOLERANCE

MOST_SWEEPS = 40
"""Sweeps of Jacobi rotations; five to eight are usual, so this is never the end of it."""


class Decomposition(NamedTuple):
    """The singular value decomposition of a matrix M (r, c), largest singular value first.

    ``left`` (c, r) and ``right`` (c, c) have the singular directions as rows, those of the null
    space included; rows of ``left`` are zero where ``sigma`` (c,) is.
    """

    left: FloatArray
    sigma: FloatArray
    right: FloatArray


def dot(a: FloatArray, b: FloatArray) -> float:
    """Return the scalar product of two vectors ``a`` and ``b`` (k,)."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


def norm(a: FloatArray) -> float:
    """Return the Euclidean norm of a vector ``a`` (k,)."""
    return sqrt(dot(a, a))


def copy_to(given: FloatArray, out: FloatArray) -> FloatArray:
    """Write a ``given`` vector (k,); return ``out``."""
    for i in range(len(given)):
        out[i] = given[i]
    return out


def axpby(a: float, x: FloatArray, b: float, y: FloatArray, out: FloatArray) -> FloatArray:
    """Write ``a x + b y`` of two vectors (k,); return ``out``."""
    for i in range(len(x)):
        out[i] = a * x[i] + b * y[i]
    return out


def weighted_sum(rows: FloatArray, weights: FloatArray, column: int) -> float:
    """Return one ``column`` of the sum of ``rows`` (k, c), by ``weights`` (k,)."""
    total = 0.0
    for k in range(len(weights)):
        total += rows[k, column] * weights[k]
    return total


def product(a: FloatArray, first: int, b: FloatArray, out: FloatArray) -> FloatArray:
    """Write ``a[first:] @ b``, in as many columns as ``out`` has; return that."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
        for k in range(b.shape[0]):
            factor = a[first + i, k]
            for j in range(out.shape[1]):
                out[i, j] += factor * b[k, j]
    return out


def count_above(sigma: FloatArray, threshold: float) -> int:
    """Return how many of the singular values ``sigma`` (k,) are above a ``threshold``."""
    count = 0
    for k in range(len(sigma)):
        if sigma[k] > threshold:
            count += 1
    return count


def largest_of(sigma: FloatArray) -> float:
    """Return the first of the singular values ``sigma`` (k,), 0 if there are none."""
    return sigma[0] if len(sigma) > 0 else 0.0


def rank_of(sigma: FloatArray) -> int:
    """Return how many singular values ``sigma`` (k,) are not zero beside the largest."""
    return count_above(sigma, RANK_TOLERANCE * largest_of(sigma))


def decomposed(work: FloatArray, columns: FloatArray) -> Decomposition:
    """Return the decomposition of a matrix with ``columns`` (c, r), which are left alone.

    One-sided Jacobi (Hestenes 1958): the columns are rotated in pairs until all are orthogonal.
    It is as accurate as LAPACK, and more so for small singular values (Demmel and Veselic, SIAM
    J. Matrix Anal. Appl. 13, 1992).
    """
    count, length = columns.shape
    left = matrix(work, count, length)
    right = matrix(work, count, count)
    sigma = vector(work, count)
    total = 0.0
    set_identity(right)
    for j in range(count):
        for i in range(length):
            left[j, i] = columns[j, i]
            total += columns[j, i] * columns[j, i]
    for _ in range(MOST_SWEEPS):
        if not _sweep(left, right, MACHINE_TOLERANCE**2 * total):
            break
    for j in range(count):
        sigma[j] = norm(left[j])
    _sort(sigma, left, right)
    for j in range(count):
        factor = 1.0 / sigma[j] if sigma[j] > MACHINE_TOLERANCE * sqrt(total) else 0.0
        axpby(factor, left[j], 0.0, left[j], left[j])
    return Decomposition(left, sigma, right)


def pseudo_solve(
    svd: Decomposition, rank: int, wanted: FloatArray, out: FloatArray
) -> FloatArray:
    """Write the shortest x (c,) whose ``M x`` is nearest to ``wanted`` (r,); return ``out``.

    M is what has been decomposed in ``svd``, with only ``rank`` singular values.
    """
    left, sigma, right = svd.left, svd.sigma, svd.right
    set_zero(out)
    for k in range(rank):
        axpby(1.0, out, dot(left[k], wanted) / sigma[k], right[k], out)
    return out


def _sweep(left: FloatArray, right: FloatArray, nothing: float) -> bool:
    """Rotate every pair of the vectors ``left`` (c, r) once; return whether any needed it."""
    rotated = False
    for p in range(len(left) - 1):
        for q in range(p + 1, len(left)):
            alpha = beta = gamma = 0.0
            for i in range(left.shape[1]):
                alpha += left[p, i] * left[p, i]
                beta += left[q, i] * left[q, i]
                gamma += left[p, i] * left[q, i]
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
            _rotate_pair(left, p, q, cosine, cosine * tangent)
            _rotate_pair(right, p, q, cosine, cosine * tangent)
    return rotated


def _rotate_pair(vectors: FloatArray, p: int, q: int, cosine: float, sine: float) -> None:
    """Rotate the rows p and q of ``vectors`` into each other, in place."""
    for i in range(vectors.shape[1]):
        one, other = vectors[p, i], vectors[q, i]
        vectors[p, i] = cosine * one - sine * other
        vectors[q, i] = sine * one + cosine * other


def _sort(sigma: FloatArray, left: FloatArray, right: FloatArray) -> None:
    """Order ``sigma`` (c,) and the rows of the other two by size, largest first, in place."""
    for j in range(len(sigma) - 1):
        largest = j
        for other in range(j + 1, len(sigma)):
            if sigma[other] > sigma[largest]:
                largest = other
        if largest != j:
            sigma[j], sigma[largest] = sigma[largest], sigma[j]
            # A quarter turn swaps two rows, one of them reversed. Reversed in both left and right
            # it stays the same singular direction.
            _rotate_pair(left, j, largest, 0.0, -1.0)
            _rotate_pair(right, j, largest, 0.0, -1.0)


def orthonormalise(rows: FloatArray) -> None:
    """Make independent ``rows`` (r, c) orthonormal, in place.

    Gram-Schmidt twice, which is as good as Householder's (Giraud et al. 2005).
    """
    for j in range(len(rows)):
        for _ in range(2):
            for k in range(j):
                axpby(1.0, rows[j], -dot(rows[k], rows[j]), rows[k], rows[j])
        size = norm(rows[j])
        if size > 0.0:
            axpby(1.0 / size, rows[j], 0.0, rows[j], rows[j])
