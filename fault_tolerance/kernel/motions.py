# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The motions that the struts allow, and what drives make of them (Theorem 1).

Everything is scaled: twists and rates are in metres per second. A failure is a move of rows
(docs/theory.md, section 2): a stuck drive bars the motions in which it moves, a free one no longer
counts among those that T is made of, a lost strut's rows are not there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fault_tolerance.kernel.elimination import Elimination
from fault_tolerance.kernel.factorisation import (
    columns_from,
    dot,
    frobenius,
    largest_of,
    orthonormalise,
    product,
    rank_of,
    rows_of,
    svd,
)
from fault_tolerance.kernel.model import Model
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import RANK_TOLERANCE, ROUNDING_TOLERANCE


class Structure(NamedTuple):
    """The structural rows (g, 6) of the attached struts, decomposed.

    ``owner`` (g,) is the strut of each; ``left``, ``sigma`` and ``right`` are their singular
    value decomposition, all six right directions included.
    """

    rows: FloatArray
    owner: IntArray
    left: FloatArray
    sigma: FloatArray
    right: FloatArray


class Kinematics(NamedTuple):
    """J and T in some state of failure, scaled.

    ``jacobian`` (6, n) is the twist and ``mapping`` (N, n) the drives' rates per unit reduced
    rate, the latter with orthonormal columns; ``follow`` (N, n) is the same with the rows of
    free actuators; ``drifting`` counts the platform's motions with every drive at rest.
    """

    jacobian: FloatArray
    mapping: FloatArray
    follow: FloatArray
    drifting: int


def holds(strut: IntArray, failed: FloatArray, j: int) -> bool:
    """Return whether actuator ``j`` is in a ``strut`` (N,) that has not ``failed``."""
    return strut[j] < 0 or failed[strut[j]] == 0.0


def structure_of(e: Elimination, failed: FloatArray) -> Structure:
    """Return what those struts ``e`` bar that have not ``failed`` (s + 2 N,)."""
    count = 0
    for s in range(len(e.ranks)):
        if failed[s] == 0.0:
            count += 6 - e.ranks[s, 0] - e.ranks[s, 1]
    rows, owner, place = np.empty((count, 6)), np.empty(count, np.int64), 0
    for s in range(len(e.ranks)):
        if failed[s] == 0.0:
            for i in range(e.ranks[s, 0] + e.ranks[s, 1], 6):
                for j in range(6):
                    rows[place, j] = e.q[s, i, j]
                owner[place] = s
                place += 1
    left, sigma, right = svd(rows)
    return Structure(rows, owner, left, sigma, right)


def kept_constraints(sigma: FloatArray, compliance: float) -> int:
    """Return how many of ``sigma`` a ``compliance`` does not absorb (theory, section 6)."""
    threshold, count = max(compliance, RANK_TOLERANCE * largest_of(sigma)), 0
    for k in range(len(sigma)):
        if sigma[k] > threshold:
            count += 1
    return count


def allowed_motions(
    m: Model, e: Elimination, failed: FloatArray, structure: Structure, kept: int
) -> tuple[FloatArray, FloatArray]:
    """Return a basis, twists (6, w) and rates (N, w), of all motions the rows allow.

    Of ``m`` with its struts ``e``. No drive is locked yet, and ``kept`` constraints of the
    ``structure`` count. The twists are orthonormal where the platform determines every drive;
    elsewhere the columns of twists and rates together are. Rates in struts that ``failed`` (s + 2
    N,) says are lost are zero.
    """
    if len(m.chains.joints) == 0:
        return m.given_twists.copy(), m.given_rates.copy()
    free = columns_from(structure.right, kept)
    width = free.shape[1]
    spare = np.zeros(e.spare.shape[1], np.int64)
    total = width
    for c in range(len(spare)):
        spare[c] = -1
        for j in range(len(m.chains.strut)):
            if e.spare[j, c] != 0.0 and holds(m.chains.strut, failed, j):
                spare[c] = total
        if spare[c] >= 0:
            total += 1
    twists, rates = np.zeros((6, total)), np.zeros((len(m.chains.strut), total))
    for i in range(6):
        for c in range(width):
            twists[i, c] = free[i, c]
    for j in range(len(m.chains.strut)):
        if not holds(m.chains.strut, failed, j):
            continue
        for c in range(width):
            rate = 0.0
            for i in range(6):
                rate += e.rows[j, i] * free[i, c]
            rates[j, c] = m.drives.scale[j] * rate
        for c in range(len(spare)):
            if spare[c] >= 0:
                rates[j, spare[c]] = m.drives.scale[j] * e.spare[j, c]
    if not e.regular:
        _orthonormalise_together(twists, rates)
    return twists, rates


def _orthonormalise_together(twists: FloatArray, rates: FloatArray) -> None:
    """Make the columns of ``[twists; rates]`` orthonormal, in place."""
    above = len(twists)
    basis = np.empty((above + len(rates), twists.shape[1]))
    for c in range(twists.shape[1]):
        for i in range(above):
            basis[i, c] = twists[i, c]
        for i in range(len(rates)):
            basis[above + i, c] = rates[i, c]
    orthonormalise(basis)
    for c in range(twists.shape[1]):
        for i in range(above):
            twists[i, c] = basis[i, c]
        for i in range(len(rates)):
            rates[i, c] = basis[above + i, c]


def kinematics_with(
    twists: FloatArray, rates: FloatArray, stuck: FloatArray, driving: FloatArray
) -> Kinematics:
    """Return J and T with some drives stuck and some not driving (docs/theory.md, eq. 8-10).

    ``twists`` (6, w) and ``rates`` (N, w) are all motions; ``stuck`` and ``driving`` (N,) are 1
    for the actuators that are stuck, and for those that still drive.
    """
    # Motions are unit vectors in metres per second. Rates are small or not beside that, so that
    # a drive which does not move at all is not mistaken for a slow one.
    scale = max(1.0, frobenius(rates))
    locked = rows_of(rates, stuck)
    if len(locked):
        _, sigma, right = svd(locked)
        unlocked = columns_from(right, rank_of(sigma, scale))
        twists, rates = product(twists, unlocked), product(rates, unlocked)
        for j in range(len(rates)):
            if stuck[j] != 0.0:
                for c in range(rates.shape[1]):
                    rates[j, c] = 0.0
    left, sigma, right = svd(rows_of(rates, driving))
    rank, drifting = rank_of(sigma, scale), 0
    if rank < twists.shape[1]:
        _, drift, _ = svd(product(twists, columns_from(right, rank)))
        drifting = rank_of(drift, 1.0)
        # What the drives do not determine is chosen as the shortest motion.
        twists, rates = twists.copy(), rates.copy()
        _orthonormalise_together(twists, rates)
        left, sigma, right = svd(rows_of(rates, driving))
    return _reduced(twists, rates, driving, left, sigma, right, rank, drifting)


def _reduced(
    twists: FloatArray,
    rates: FloatArray,
    driving: FloatArray,
    left: FloatArray,
    sigma: FloatArray,
    right: FloatArray,
    rank: int,
    drifting: int,
) -> Kinematics:
    """Return the motions per reduced rate: the drives' own rates become orthonormal."""
    per_rate = np.empty((twists.shape[1], rank))
    for k in range(rank):
        for c in range(twists.shape[1]):
            per_rate[c, k] = right[k, c] / sigma[k]
    jacobian, follow = product(twists, per_rate), product(rates, per_rate)
    mapping, place = np.zeros((len(rates), rank)), 0
    for j in range(len(rates)):
        if driving[j] != 0.0:
            for k in range(rank):
                mapping[j, k] = follow[j, k] = left[place, k]
            place += 1
    # A coordinate that the drives do not move holds rounding errors only: zero.
    least = ROUNDING_TOLERANCE**2 * max(float(rank), frobenius(jacobian) ** 2)
    for i in range(len(jacobian)):
        if dot(jacobian[i], jacobian[i]) <= least:
            for k in range(rank):
                jacobian[i, k] = 0.0
    return Kinematics(jacobian, mapping, follow, drifting)
