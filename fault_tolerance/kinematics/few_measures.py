# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The measures of all single and double further failures of a few actuators, from areas.

Two failures leave a determinant of two rows, and that is the square of the area between them.
By Lagrange's identity an area is a sum of squares of minors, which cancels nothing:

    |a|^2 |b|^2 - (a . b)^2  =  sum over k < l of (a_k b_l - b_k a_l)^2.

So with C, orthonormal columns that complete T, and S = T N, with N a basis of the null space of
J_m (docs/theory.md, eq. 21),

    t_i = |C_i|,            t_ij = area(C_i, C_j),
    p_i = |S_i| / |T_i|,    p_ij = area(S_i, S_j) / area(T_i, T_j)

are good to the last digits also next to 0. The number of minors grows with the square of the
number of actuators; for many of them see `fault_tolerance.kinematics.many_measures`.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fault_tolerance.compiled.activation import Active
from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.linear_algebra import decomposed, row_products
from fault_tolerance.tolerances import RANK_TOLERANCE

BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

# Quotients of an area smaller than this, relative to the square it could be, are not taken.
_FLAT = 1e-6
_SHORT = 1e-4
# Rounding errors of a measure that is 0.
_ROUNDING = 1e-15


def torque_of_few(mapping: FloatArray) -> FloatArray:
    """Return t (N, N) of all pairs of the rows of T, the single ones on the diagonal."""
    kernels = Active.kernels
    if kernels is not None:
        return kernels.torque_of_few(mapping)  # type: ignore[no-any-return]
    count, mobility = mapping.shape
    if count == mobility:
        return np.zeros((count, count))
    rest = decomposed(mapping.T)[2][mobility:].T
    squares = row_products(rest, rest)
    areas = _areas(rest)
    areas.ravel()[:: count + 1] = np.sqrt(squares)
    # Rows of C are no longer than 1.
    if areas.min() > RANK_TOLERANCE:
        return areas
    # The smallest singular value of what is left of T is that of the two rows of C: their area
    # by the larger one. It decides what is 0.
    sums = 0.5 * np.add.outer(squares, squares)
    larger = np.sqrt(sums + np.sqrt(np.maximum(sums * sums - areas * areas, 0.0)))
    larger.ravel()[:: count + 1] = 1.0
    areas[areas <= RANK_TOLERANCE * larger] = 0.0
    return areas


def position_of_few(
    kinematics: DifferentialKinematics, mapping: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return p (N, N) of all pairs of the rows of T, and which of them are doubtful.

    The single ones are on the diagonals.
    """
    kernels = Active.kernels
    if kernels is not None:
        found, doubtful = kernels.position_of_few(
            mapping, kinematics.major, _SHORT, _FLAT, _ROUNDING
        )
        return found, doubtful
    count = len(mapping)
    _, sigma, right = decomposed(kinematics.major)
    values: list[float] = sigma.tolist()
    rank = len(kinematics.major)
    best = values[0] if values else 1.0
    if len(values) < rank or (values and values[-1] <= RANK_TOLERANCE * best):
        return np.zeros((count, count)), np.zeros((count, count), dtype=np.bool_)
    sizes = np.sqrt(row_products(mapping, mapping))
    short = float(sizes.min()) <= _SHORT
    if rank == kinematics.mobility and not short:
        return np.zeros((count, count)), _none(count)
    areas, diagonal = _areas(mapping), slice(None, None, count + 1)
    areas.ravel()[diagonal] = sizes
    limits = np.multiply.outer(_FLAT * sizes, sizes)
    doubtful = areas <= limits
    if short:
        doubtful |= limits <= _FLAT * _SHORT**2
        doubtful.ravel()[diagonal] = sizes <= _SHORT
    spare = mapping.dot(right[rank:].T)
    left = _areas(spare)
    left.ravel()[diagonal] = np.sqrt(row_products(spare, spare))
    if np.logical_or.reduce(doubtful, None):
        areas[doubtful] = 1.0
    found = np.minimum(left / areas, 1.0)
    # What J_m keeps is at least p times its smallest singular value: below this it may be 0.
    least = RANK_TOLERANCE * (best / values[-1] if values else 1.0)
    if found.min() <= least:
        small, nothing = found <= least, found <= _ROUNDING
        found[nothing] = 0.0
        doubtful |= small & ~nothing
    return found, doubtful


@lru_cache(maxsize=64)
def _none(count: int) -> BoolArray:
    none = np.zeros((count, count), dtype=np.bool_)
    none.setflags(write=False)
    return none


def _areas(rows: FloatArray) -> FloatArray:
    """Return the areas (N, N) between ``rows`` (N, k)."""
    count, width = rows.shape
    if width < 2:
        return np.zeros((count, count))
    first, second = _pairs(width)
    minors = rows.take(first, 1)[:, None] * rows.take(second, 1)
    minors -= minors.transpose(1, 0, 2).copy()
    if len(first) == 1:
        return np.abs(minors[..., 0])
    flat = minors.reshape(count * count, -1)
    return np.sqrt(row_products(flat, flat)).reshape(count, count)


@lru_cache(maxsize=64)
def _pairs(width: int) -> tuple[IntArray, IntArray]:
    first, second = np.triu_indices(width, 1)
    return first, second
