# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The motions that the struts allow, and those that the drives control (Theorem 1).

Everything is scaled: twists and rates are in metres per second. A failure is a move of rows
(docs/theory.md, section 2): a stuck drive bars the motions in which it moves, a free one no longer
counts among those that T is made of, a lost strut's rows are not there.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import EstimateArrays, Model
from fault_tolerance.kernel.jacobi_svd import (
    Decomposition,
    combined,
    copied,
    decomposed,
    dot,
    largest_of,
    orthonormalise,
    product,
    rank_of,
)
from fault_tolerance.kernel.scratch import matrix, vector
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import RANK_TOLERANCE, ROUNDING_TOLERANCE


class Structure(NamedTuple):
    """The g structural rows of the attached struts, decomposed.

    ``columns`` (6, g) are the columns of these rows, ``owner`` (g,) the strut of each; ``found``
    is their decomposition.
    """

    columns: FloatArray
    owner: FloatArray
    found: Decomposition


class Kinematics(NamedTuple):
    """J and T in some state of failure.

    ``motions`` (n, 6 + N), one for each reduced rate, and ``driving`` (N,) are as in an estimate;
    ``drifting`` counts the platform's motions with every drive at rest.
    """

    motions: FloatArray
    driving: FloatArray
    drifting: int


def holds(strut: IntArray, failed: FloatArray, j: int) -> bool:
    """Return whether actuator ``j`` is in a ``strut`` (N,) that has not ``failed``."""
    return strut[j] < 0 or failed[strut[j]] == 0.0


def drives_left(m: Model, failed: FloatArray, out: FloatArray) -> FloatArray:
    """Write 1 for actuators (N,) of ``m`` that drive with what has ``failed``; return ``out``."""
    s, n = len(m.chains.joints), len(out)
    strut = m.chains.strut
    for j in range(n):
        gone = failed[s + j] + failed[s + n + j]
        out[j] = 1.0 if gone == 0.0 and holds(strut, failed, j) else 0.0
    return out


def structure_of(m: Model, e: EstimateArrays, failed: FloatArray) -> Structure:
    """Return what those struts of ``m``, factorised in ``e``, bar that have not ``failed``."""
    count = 0
    for s in range(len(e.ranks)):
        if failed[s] == 0.0:
            count += 6 - int(e.ranks[s, 0] + e.ranks[s, 1])
    columns, owner, place = matrix(m.work, 6, count), vector(m.work, count), 0
    for s in range(len(e.ranks)):
        if failed[s] == 0.0:
            for i in range(int(e.ranks[s, 0] + e.ranks[s, 1]), 6):
                for j in range(6):
                    columns[j, place] = e.q[s, i, j]
                owner[place] = s
                place += 1
    return Structure(columns, owner, decomposed(m.work, columns))


def kept_constraints(sigma: FloatArray, compliance: float) -> int:
    """Return how many of ``sigma`` a ``compliance`` does not absorb (theory, section 6)."""
    threshold, count = max(compliance, RANK_TOLERANCE * largest_of(sigma)), 0
    for k in range(len(sigma)):
        if sigma[k] > threshold:
            count += 1
    return count


def freedom_of(m: Model, e: EstimateArrays, failed: FloatArray, kept: int) -> int:
    """Return how many motions ``kept`` constraints leave, those of drives alone included.

    Of ``m`` with its struts factorised in ``e``, without those that ``failed`` says are lost.
    """
    if len(m.chains.joints) == 0:
        return len(m.given)
    count = 6 - kept
    for c in range(int(e.facts[at.SPARE])):
        if _moves_any(m, e.spare[c], failed):
            count += 1
    return count


def allowed_motions(
    m: Model,
    e: EstimateArrays,
    failed: FloatArray,
    structure: Structure,
    kept: int,
    out: FloatArray,
) -> FloatArray:
    """Write a basis (w, 6 + N) of all motions that the rows allow, no drive locked yet.

    To ``out``, of ``m`` with its struts factorised in ``e``; ``kept`` constraints of the
    ``structure`` count, which leave the `freedom_of` w. The twists are orthonormal where the
    platform determines every drive; elsewhere the motions are. Rates in struts that have
    ``failed`` are zero. Returns ``out``.
    """
    if len(m.chains.joints) == 0:
        for c in range(len(out)):
            copied(m.given[c], out[c])
        return out
    scale, strut, rows, place = m.drives.scale, m.chains.strut, e.rows, 6 - kept
    for c in range(place):
        free = structure.found.right[kept + c]
        copied(free, out[c])
        for j in range(len(strut)):
            out[c, 6 + j] = scale[j] * dot(rows[j], free) if holds(strut, failed, j) else 0.0
    for c in range(int(e.facts[at.SPARE])):
        spare = e.spare[c]
        if _moves_any(m, spare, failed):
            for i in range(6):
                out[place, i] = 0.0
            for j in range(len(strut)):
                out[place, 6 + j] = scale[j] * spare[j] if holds(strut, failed, j) else 0.0
            place += 1
    if e.facts[at.REGULAR] == 0.0:
        orthonormalise(out)
    return out


def _moves_any(m: Model, spare: FloatArray, failed: FloatArray) -> bool:
    """Return whether a ``spare`` motion (N,) moves a drive of a strut that has not ``failed``."""
    for j in range(len(spare)):
        if spare[j] != 0.0 and holds(m.chains.strut, failed, j):
            return True
    return False


def rates_of(motions: FloatArray, chosen: FloatArray, out: FloatArray) -> FloatArray:
    """Write rates (w, N) of the ``chosen`` (N,) in ``motions``, 0 of others; return ``out``."""
    for c in range(len(motions)):
        for j in range(len(chosen)):
            out[c, j] = motions[c, 6 + j] if chosen[j] != 0.0 else 0.0
    return out


def twists_of(motions: FloatArray, out: FloatArray) -> FloatArray:
    """Write the twists (w, 6) of ``motions``; return ``out``."""
    for c in range(len(motions)):
        for i in range(6):
            out[c, i] = motions[c, i]
    return out


def size_of(rows: FloatArray, begin: int, end: int) -> float:
    """Return the norm of all that stands in columns ``begin`` to ``end`` of ``rows``."""
    total = 0.0
    for c in range(len(rows)):
        for i in range(begin, end):
            total += rows[c, i] * rows[c, i]
    return sqrt(total)


def controlled(
    work: FloatArray, motions: FloatArray, stuck: FloatArray, driving: FloatArray
) -> Kinematics:
    """Return the motions that some drives control, with some stuck (docs/theory.md, eq. 8-10).

    All ``motions`` (w, 6 + N) allowed are changed in place; ``stuck`` and ``driving`` (N,) are 1
    for the actuators that are stuck, and for those that still drive. The result is part of
    ``work``.
    """
    n = len(driving)
    # Motions are unit vectors in metres per second. Rates are small or not beside that, so that
    # a drive which does not move at all is not mistaken for a slow one.
    scale = max(1.0, size_of(motions, 6, 6 + n))
    if any_of(stuck):
        locked = decomposed(work, rates_of(motions, stuck, matrix(work, len(motions), n)))
        rank = rank_of(locked.sigma, scale)
        left = matrix(work, len(motions) - rank, 6 + n)
        motions = product(locked.right, rank, motions, left)
        for c in range(len(motions)):
            for j in range(n):
                motions[c, 6 + j] *= 1.0 - stuck[j]
    rates, drifting = matrix(work, len(motions), n), 0
    found = decomposed(work, rates_of(motions, driving, rates))
    rank = rank_of(found.sigma, scale)
    if rank < len(motions):
        free = product(found.right, rank, motions, matrix(work, len(motions) - rank, 6 + n))
        drift = decomposed(work, twists_of(free, matrix(work, len(free), 6)))
        drifting = rank_of(drift.sigma, 1.0)
        # What the drives do not determine is chosen as the shortest motion.
        orthonormalise(motions)
        found = decomposed(work, rates_of(motions, driving, rates))
    result = product(found.right, 0, motions, matrix(work, rank, 6 + n))
    left, sigma = found.left, found.sigma
    for k in range(rank):
        combined(1.0 / sigma[k], result[k], 0.0, result[k], result[k])
        for j in range(n):
            if driving[j] != 0.0:
                result[k, 6 + j] = left[k, j]
    _clear_rounding(result)
    return Kinematics(result, driving, drifting)


def any_of(flags: FloatArray) -> bool:
    """Return whether any of ``flags`` (k,) is set."""
    for i in range(len(flags)):
        if flags[i] != 0.0:
            return True
    return False


def _clear_rounding(motions: FloatArray) -> None:
    """Set coordinates of the platform to zero that ``motions`` leave at rest but for rounding."""
    least = ROUNDING_TOLERANCE * max(sqrt(len(motions)), size_of(motions, 0, 6))
    for i in range(6):
        if size_of(motions, i, i + 1) <= least:
            for c in range(len(motions)):
                motions[c, i] = 0.0


def kinematics_of(
    m: Model, e: EstimateArrays, structure: Structure, failed: FloatArray, compliance: float
) -> Kinematics:
    """Return J and T of ``m`` with what has ``failed`` (s + 2 N,).

    The struts are factorised in ``e``, ``structure`` is what those not lost bar, and
    ``compliance`` absorbs some of it.
    """
    s, n = len(m.chains.joints), len(m.drives.scale)
    kept = kept_constraints(structure.found.sigma, compliance)
    motions = matrix(m.work, freedom_of(m, e, failed, kept), 6 + n)
    return controlled(
        m.work,
        allowed_motions(m, e, failed, structure, kept, motions),
        failed[s : s + n],
        drives_left(m, failed, vector(m.work, n)),
    )
