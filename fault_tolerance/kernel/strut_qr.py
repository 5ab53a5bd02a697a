# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What each strut says about the platform: one pivoted QR factorisation a strut.

With the screws of a strut in columns, the passive ones first,

    Q^T [P | S_a] = R,

the rows of Q^T beyond the rank of P say ``L V = L S_a q'_a``. Those within the rank of the whole
tie the drives to the platform; the rest are structure, ``0 = G V`` (docs/theory.md, eq. 5-7).
Pivoting makes it hold for any chain, singular or not. The results are parts of an estimate.
"""

from __future__ import annotations

from math import sqrt

from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import EstimateArrays, Model
from fault_tolerance.kernel.jacobi_svd import combined, copied, dot
from fault_tolerance.kernel.scratch import vector
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import RANK_TOLERANCE, WELL_CONDITIONED


def factorise(m: Model, e: EstimateArrays, screws: FloatArray) -> None:
    """Write the struts of ``m`` factorised to ``e``.

    ``screws`` (s, k, 6) are scaled, v at the platform's origin.
    """
    mark, chains = m.work[0], m.chains
    reflection = vector(m.work, 6)
    for s in range(len(chains.joints)):
        passive, count = chains.passive[s], chains.joints[s]
        total = _load(chains.actuator[s], count, passive, screws[s], e.order[s], e.r[s])
        for i in range(6):
            for j in range(6):
                e.q[s, i, j] = 1.0 if i == j else 0.0
        least = RANK_TOLERANCE * sqrt(total)
        rank = begin = 0
        for group in range(2):
            end = passive if group == 0 else count
            last = _eliminate(
                e.q[s], e.r[s], e.order[s], reflection, least, rank, begin, end, count
            )
            e.ranks[s, group] = last - rank
            rank, begin = last, end
    m.work[0] = mark
    _solve_for_drives(m, e)


def joint_rates(
    m: Model,
    e: EstimateArrays,
    failed: FloatArray,
    twists: FloatArray,
    rates: FloatArray,
    out: FloatArray,
) -> None:
    """Write the rates (s, k) of all joints when the struts' tips have scaled ``twists`` (s, 6).

    ``e`` has the struts of ``m``, factorised. The drives of attached ones have the ``rates`` (N,)
    given; struts that ``failed`` (s + 2 N,) says are lost follow the platform as near as they
    reach, drives and all. To ``out``.
    """
    mark, chains = m.work[0], m.chains
    rest = vector(m.work, 6)
    for s in range(len(chains.joints)):
        passive, within = chains.passive[s], int(e.ranks[s, 0])
        whole = within + int(e.ranks[s, 1])
        for i in range(6):
            rest[i] = dot(e.q[s, i], twists[s])
        for place in range(chains.joints[s] - 1, -1, -1):
            joint, rate, row, column = int(e.order[s, place]), 0.0, place, e.r[s, place]
            if place >= passive:
                row = place - passive + within
            if place >= passive and failed[s] == 0.0:
                rate = rates[chains.actuator[s, joint]]
            elif row < (whole if place >= passive else within):
                rate = rest[row] / column[row]
            out[s, joint] = rate
            combined(1.0, rest, -rate, column, rest)
    m.work[0] = mark


def _load(
    actuator: IntArray,
    joints: int,
    last: int,
    screws: FloatArray,
    order: FloatArray,
    r: FloatArray,
) -> float:
    """Write a strut's columns, the ``last`` passive ones first; return the sum of squares."""
    first, total = 0, 0.0
    for j in range(joints):
        if actuator[j] < 0:
            place = first
            first += 1
        else:
            place = last
            last += 1
        order[place] = j
        for i in range(6):
            r[place, i] = screws[j, i]
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
    place = begin
    while rank < 6 and place < end:
        best, largest = place, 0.0
        for j in range(place, end):
            square = 0.0
            for i in range(rank, 6):
                square += r[j, i] * r[j, i]
            if square > largest:
                best, largest = j, square
        size = sqrt(largest)
        if not size > least:
            break
        order[place], order[best] = order[best], order[place]
        for i in range(6):
            r[place, i], r[best, i] = r[best, i], r[place, i]
        head = r[place, rank]
        alpha = -size if head > 0.0 else size
        for i in range(rank, 6):
            v[i] = r[place, i]
            r[place, i] = 0.0
        v[rank] -= alpha
        r[place, rank] = alpha
        beta = 1.0 / (size * (size + abs(head)))
        for j in range(place + 1, count):
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
        place += 1
    return rank


def _solve_for_drives(m: Model, e: EstimateArrays) -> None:
    """Solve the drive rows of every strut for its drives, by back substitution."""
    chains, scale, rows, spare, motions = m.chains, m.drives.scale, e.rows, e.spare, 0
    for s in range(len(chains.joints)):
        motions += chains.joints[s] - chains.passive[s] - int(e.ranks[s, 1])
    for c in range(motions):
        for j in range(len(scale)):
            spare[c, j] = 0.0
    least, most, motion = 1e300, 0.0, 0
    for s in range(len(chains.joints)):
        passive, begin, count = chains.passive[s], int(e.ranks[s, 0]), chains.joints[s]
        actuator, order, r = chains.actuator[s], e.order[s], e.r[s]
        end = begin + int(e.ranks[s, 1])
        for place in range(passive + end - begin, count):
            drive = actuator[int(order[place])]
            spare[motion, drive] = 1.0
            motion += 1
            for i in range(6):
                rows[drive, i] = 0.0
        for row in range(end - 1, begin - 1, -1):
            place = passive + row - begin
            drive, pivot = actuator[int(order[place])], r[place, row]
            own, size = copied(e.q[s, row], rows[drive]), abs(pivot) / scale[drive]
            least, most = min(least, size), max(most, size)
            for later in range(place + 1, count):
                other, share = actuator[int(order[later])], r[later, row]
                combined(1.0, own, -share, rows[other], own)
                for c in range(motions):
                    spare[c, drive] -= share * spare[c, other]
            for i in range(6):
                own[i] /= pivot
            for c in range(motions):
                spare[c, drive] /= pivot
    e.facts[at.SPARE] = motions
    e.facts[at.REGULAR] = 1.0 if motions == 0 and least > WELL_CONDITIONED * most else 0.0
