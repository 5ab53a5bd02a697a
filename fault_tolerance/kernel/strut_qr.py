# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Pivoted QR of each strut: eliminates passive joints, leaves constraint rows and actuator rows.

With the screws of a strut in columns, the passive ones first,

    Q^T [P | S_a] = R,

the rows of Q^T beyond the rank of P say ``L V = L S_a q'_a``. Rows up to the rank of [P | S_a]
are actuator rows; the rest are constraints ``0 = G V`` (docs/theory.md, eq. 5-7). Pivoting makes
it hold for any chain, singular or not.
"""

from math import sqrt

from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import EstimateArrays, Model
from fault_tolerance.kernel.scratch import set_identity, set_zero, vector
from fault_tolerance.kernel.small_matrices import axpby, copy_to, dot
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import RANK_TOLERANCE, WELL_CONDITIONED


def factorise(m: Model, e: EstimateArrays, screws: FloatArray) -> None:
    """Factorise the struts of ``e`` by their joint ``screws`` (s, k, 6)."""
    mark, chains = m.work[0], m.chains
    reflection = vector(m.work, 6)
    for s in range(len(chains.joints)):
        passive, count = chains.passive[s], chains.joints[s]
        q, r, order = e.q[s], e.r[s], e.order[s]
        total = _load(chains.actuator[s], count, passive, screws[s], order, r)
        set_identity(q)
        least = RANK_TOLERANCE * sqrt(total)
        rank = _eliminate(q, r, order, reflection, least, 0, 0, passive, count)
        whole = _eliminate(q, r, order, reflection, least, rank, passive, count, count)
        e.ranks[s, 0] = rank
        e.ranks[s, 1] = whole - rank
    m.work[0] = mark
    _solve_for_actuators(m, e)


def joint_rates(
    m: Model,
    e: EstimateArrays,
    failed: FloatArray,
    twists: FloatArray,
    rates: FloatArray,
    out: FloatArray,
) -> None:
    """Write the rates (s, k) of all joints when the struts' tips have scaled ``twists`` (s, 6).

    The actuators of attached struts have the ``rates`` (N,) given; lost struts follow the platform
    as near as they reach, actuators and all.
    """
    mark, chains = m.work[0], m.chains
    rest = vector(m.work, 6)
    for s in range(len(chains.joints)):
        passive, passive_rank = chains.passive[s], int(e.ranks[s, 0])
        rank = passive_rank + int(e.ranks[s, 1])
        for i in range(6):
            rest[i] = dot(e.q[s, i], twists[s])
        for col in range(chains.joints[s] - 1, -1, -1):
            joint, column = int(e.order[s, col]), e.r[s, col]
            rate = 0.0
            if col < passive:
                if col < passive_rank:
                    rate = rest[col] / column[col]
            elif failed[s] == 0.0:
                rate = rates[chains.actuator[s, joint]]
            else:
                row = col - passive + passive_rank
                if row < rank:
                    rate = rest[row] / column[row]
            out[s, joint] = rate
            axpby(1.0, rest, -rate, column, rest)
    m.work[0] = mark


def _load(
    actuator: IntArray,
    joints: int,
    passive: int,
    screws: FloatArray,
    order: FloatArray,
    r: FloatArray,
) -> float:
    """Write a strut's columns and their order; return the sum of squares.

    The passive columns come first; ``passive`` is their number.
    """
    first, last, total = 0, passive, 0.0
    for j in range(joints):
        if actuator[j] < 0:
            col = first
            first += 1
        else:
            col = last
            last += 1
        order[col] = j
        for i in range(6):
            r[col, i] = screws[j, i]
            total += screws[j, i] * screws[j, i]
    return total


def _eliminate(
    q: FloatArray,
    r: FloatArray,
    order: FloatArray,
    v: FloatArray,
    least: float,
    rank: int,
    begin: int,
    end: int,
    count: int,
) -> int:
    """Eliminate the columns ``begin`` to ``end`` of one strut in place; return the rank then.

    Householder reflections ``v`` (6,), the largest remaining column first; columns shorter than
    ``least`` count as zero. ``r`` has ``count`` columns, as rows; ``rank`` is that of those
    before.
    """
    col = begin
    while rank < 6 and col < end:
        best, largest = col, 0.0
        for j in range(col, end):
            square = 0.0
            for i in range(rank, 6):
                square += r[j, i] * r[j, i]
            if square > largest:
                best, largest = j, square
        size = sqrt(largest)
        if not size > least:
            break
        order[col], order[best] = order[best], order[col]
        for i in range(6):
            r[col, i], r[best, i] = r[best, i], r[col, i]
        head = r[col, rank]
        alpha = -size if head > 0.0 else size
        for i in range(rank, 6):
            v[i] = r[col, i]
            r[col, i] = 0.0
        v[rank] -= alpha
        r[col, rank] = alpha
        beta = 1.0 / (size * (size + abs(head)))
        for j in range(col + 1, count):
            share = 0.0
            for i in range(rank, 6):
                share += v[i] * r[j, i]
            for i in range(rank, 6):
                r[j, i] -= beta * share * v[i]
        for j in range(6):
            share = 0.0
            for i in range(rank, 6):
                share += v[i] * q[i, j]
            for i in range(rank, 6):
                q[i, j] -= beta * share * v[i]
        rank += 1
        col += 1
    return rank


def _solve_for_actuators(m: Model, e: EstimateArrays) -> None:
    """Solve the actuator rows of every strut for its actuators, by back substitution."""
    chains, scale, rows, self_motions = m.chains, m.actuators.scale, e.rows, e.self_motions
    count = motion = 0
    for s in range(len(chains.joints)):
        count += chains.joints[s] - chains.passive[s] - int(e.ranks[s, 1])
    for c in range(count):
        set_zero(self_motions[c])
    least, most = 1e300, 0.0
    for s in range(len(chains.joints)):
        passive, begin, joints = chains.passive[s], int(e.ranks[s, 0]), chains.joints[s]
        actuator, order, r = chains.actuator[s], e.order[s], e.r[s]
        end = begin + int(e.ranks[s, 1])
        for col in range(passive + end - begin, joints):
            j = actuator[int(order[col])]
            self_motions[motion, j] = 1.0
            motion += 1
            set_zero(rows[j])
        for row in range(end - 1, begin - 1, -1):
            col = passive + row - begin
            j, pivot = actuator[int(order[col])], r[col, row]
            own = copy_to(e.q[s, row], rows[j])
            size = abs(pivot) / scale[j]
            least, most = min(least, size), max(most, size)
            for later in range(col + 1, joints):
                other, share = actuator[int(order[later])], r[later, row]
                axpby(1.0, own, -share, rows[other], own)
                for c in range(count):
                    self_motions[c, j] -= share * self_motions[c, other]
            for i in range(6):
                own[i] /= pivot
            for c in range(count):
                self_motions[c, j] /= pivot
    e.facts[at.SELF_MOTIONS] = count
    e.facts[at.REGULAR] = 1.0 if count == 0 and least > WELL_CONDITIONED * most else 0.0
