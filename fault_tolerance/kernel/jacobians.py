# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""J and T with failures present: null space of the constraints, then the part actuators control.

Everything is scaled: twists and rates are in metres per second. A failure is a move of rows
(docs/theory.md, section 2): a stuck actuator adds the constraint rate = 0, a free one no longer
counts among those that T is made of, a lost strut's rows are not there.
"""

from math import sqrt
from typing import NamedTuple

from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import EstimateArrays, Model
from fault_tolerance.kernel.scratch import matrix, set_zero, vector
from fault_tolerance.kernel.small_matrices import (
    Decomposition,
    axpby,
    copy_to,
    count_above,
    decomposed,
    dot,
    largest_of,
    orthonormalise,
    product,
)
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import RANK_TOLERANCE, ROUNDING_TOLERANCE


class Structure(NamedTuple):
    """The g constraint rows of the attached struts.

    ``columns`` (6, g) are the columns of these rows, ``strut_of_row`` (g,) the strut of each;
    ``svd`` is their decomposition.
    """

    columns: FloatArray
    strut_of_row: FloatArray
    svd: Decomposition


class Kinematics(NamedTuple):
    """J and T in some state of failure.

    ``motions`` (n, 6 + N), one for each reduced rate, and ``driving`` (N,) are as in an estimate;
    ``uncontrolled`` counts the platform's motions with every actuator at rest (J_xi != 0: not
    stable).
    """

    motions: FloatArray
    driving: FloatArray
    uncontrolled: int


def is_attached(strut: IntArray, failed: FloatArray, j: int) -> bool:
    """Return whether actuator ``j`` is in a ``strut`` (N,) that is not lost."""
    return strut[j] < 0 or failed[strut[j]] == 0.0


def structure_of(m: Model, e: EstimateArrays, failed: FloatArray) -> Structure:
    """Return the constraint rows of the struts that are not lost."""
    count = index = 0
    for s in range(len(e.ranks)):
        if failed[s] == 0.0:
            count += 6 - int(e.ranks[s, 0] + e.ranks[s, 1])
    columns, strut_of_row = matrix(m.work, 6, count), vector(m.work, count)
    for s in range(len(e.ranks)):
        if failed[s] == 0.0:
            for i in range(int(e.ranks[s, 0] + e.ranks[s, 1]), 6):
                for j in range(6):
                    columns[j, index] = e.q[s, i, j]
                strut_of_row[index] = s
                index += 1
    return Structure(columns, strut_of_row, decomposed(m.work, columns))


def constraint_rank(sigma: FloatArray, compliance: float) -> int:
    """Return how many of ``sigma`` a ``compliance`` does not absorb (theory, section 6)."""
    return count_above(sigma, max(compliance, RANK_TOLERANCE * largest_of(sigma)))


def freedom_of(m: Model, e: EstimateArrays, failed: FloatArray, rank: int) -> int:
    """Return how many motions ``rank`` constraints leave, self motions of actuators included."""
    if len(m.chains.joints) == 0:
        return len(m.given)
    count = 6 - rank
    for c in range(int(e.facts[at.SELF_MOTIONS])):
        if _moves_any(m, e.self_motions[c], failed):
            count += 1
    return count


def constraint_null_space(
    m: Model,
    e: EstimateArrays,
    failed: FloatArray,
    structure: Structure,
    rank: int,
    out: FloatArray,
) -> FloatArray:
    """Write a basis (`freedom_of`, 6 + N) of the motions that ``rank`` constraints leave.

    They are those of the ``structure``; stuck actuators are not held here. The twists are
    orthonormal where the platform determines every actuator; elsewhere the motions are. Rates in
    lost struts are zero. Returns ``out``.
    """
    if len(m.chains.joints) == 0:
        for c in range(len(out)):
            copy_to(m.given[c], out[c])
        return out
    scale, strut, rows, index = m.actuators.scale, m.chains.strut, e.rows, 6 - rank
    for c in range(index):
        free = structure.svd.right[rank + c]
        copy_to(free, out[c])
        for j in range(len(strut)):
            out[c, 6 + j] = scale[j] * dot(rows[j], free) if is_attached(strut, failed, j) else 0.0
    for c in range(int(e.facts[at.SELF_MOTIONS])):
        own = e.self_motions[c]
        if _moves_any(m, own, failed):
            set_zero(out[index, :6])
            for j in range(len(strut)):
                out[index, 6 + j] = scale[j] * own[j] if is_attached(strut, failed, j) else 0.0
            index += 1
    if e.facts[at.REGULAR] == 0.0:
        orthonormalise(out)
    return out


def _moves_any(m: Model, self_motion: FloatArray, failed: FloatArray) -> bool:
    """Return whether a ``self_motion`` (N,) moves an actuator of a strut that is not lost."""
    for j in range(len(self_motion)):
        if self_motion[j] != 0.0 and is_attached(m.chains.strut, failed, j):
            return True
    return False


def rates_of(motions: FloatArray, chosen: FloatArray, out: FloatArray) -> FloatArray:
    """Write rates (w, N) of the ``chosen`` (N,) in ``motions``, 0 of others; return ``out``."""
    for c in range(len(motions)):
        for j in range(len(chosen)):
            out[c, j] = motions[c, 6 + j] if chosen[j] != 0.0 else 0.0
    return out


def norm_of_columns(rows: FloatArray, begin: int, end: int) -> float:
    """Return the norm of all that stands in columns ``begin`` to ``end`` of ``rows``."""
    total = 0.0
    for c in range(len(rows)):
        for i in range(begin, end):
            total += rows[c, i] * rows[c, i]
    return sqrt(total)


def any_of(flags: FloatArray) -> bool:
    """Return whether any of ``flags`` (k,) is set."""
    for i in range(len(flags)):
        if flags[i] != 0.0:
            return True
    return False


def kinematics_of(
    m: Model, e: EstimateArrays, structure: Structure, failed: FloatArray, compliance: float
) -> Kinematics:
    """Return J and T with what has ``failed`` (docs/theory.md, eq. 8-10).

    ``structure`` is of the struts that are not lost; ``compliance`` absorbs some of it.
    """
    s, n, work = len(m.chains.joints), len(m.actuators.scale), m.work
    rank = constraint_rank(structure.svd.sigma, compliance)
    motions = matrix(work, freedom_of(m, e, failed, rank), 6 + n)
    constraint_null_space(m, e, failed, structure, rank, motions)
    stuck, free, driving = failed[s : s + n], failed[s + n :], vector(work, n)
    for j in range(n):
        drives = stuck[j] + free[j] == 0.0 and is_attached(m.chains.strut, failed, j)
        driving[j] = 1.0 if drives else 0.0
    # Rank is relative to max(1, norm of the rates): motions are unit vectors in metres per second,
    # and an actuator that does not move at all must not count as a slow one.
    least = RANK_TOLERANCE * max(1.0, norm_of_columns(motions, 6, 6 + n))
    if any_of(stuck):
        locked = decomposed(work, rates_of(motions, stuck, matrix(work, len(motions), n)))
        rank = count_above(locked.sigma, least)
        motions = product(
            locked.right, rank, motions, matrix(work, len(motions) - rank, 6 + n)
        )
        for c in range(len(motions)):
            for j in range(n):
                motions[c, 6 + j] *= 1.0 - stuck[j]
    rates, uncontrolled = matrix(work, len(motions), n), 0
    svd = decomposed(work, rates_of(motions, driving, rates))
    rank = count_above(svd.sigma, least)
    if rank < len(motions):
        loose = product(svd.right, rank, motions, matrix(work, len(motions) - rank, 6 + n))
        twists = matrix(work, len(loose), 6)
        for c in range(len(loose)):
            copy_to(loose[c, :6], twists[c])
        uncontrolled = count_above(decomposed(work, twists).sigma, RANK_TOLERANCE)
        # What the actuators do not determine is chosen as the shortest motion.
        orthonormalise(motions)
        svd = decomposed(work, rates_of(motions, driving, rates))
    result = product(svd.right, 0, motions, matrix(work, rank, 6 + n))
    left, sigma = svd.left, svd.sigma
    for k in range(rank):
        axpby(1.0 / sigma[k], result[k], 0.0, result[k], result[k])
        for j in range(n):
            if driving[j] != 0.0:
                result[k, 6 + j] = left[k, j]
    _zero_unmoved_coordinates(result)
    return Kinematics(result, driving, uncontrolled)


def _zero_unmoved_coordinates(motions: FloatArray) -> None:
    """Set coordinates of the platform to zero that ``motions`` leave at rest but for rounding."""
    least = ROUNDING_TOLERANCE * max(sqrt(len(motions)), norm_of_columns(motions, 0, 6))
    for i in range(6):
        if norm_of_columns(motions, i, i + 1) <= least:
            for c in range(len(motions)):
                motions[c, i] = 0.0
