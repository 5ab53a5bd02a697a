# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What each strut says about the platform: one pivoted QR factorisation a strut.

With the screws of a strut in columns, the passive ones first,

    Q^T [P | S_a] = R,

the rows of Q^T beyond the rank of P say ``L V = L S_a q'_a``. Those within the rank of the whole
tie the drives to the platform; the rest are structure, ``0 = G V`` (docs/theory.md, eq. 5-7).
Pivoting makes it hold for any chain, singular or not.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from fault_tolerance.kernel.factorisation import dot
from fault_tolerance.kernel.model import Chains
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import RANK_TOLERANCE, WELL_CONDITIONED


class Elimination(NamedTuple):
    """The factorised struts.

    ``q`` (s, 6, 6) is Q^T of each strut: passive range, then drive rows, then structure; ``r``
    (s, k, 6) has the columns of R, ``order`` (s, k) the joints they belong to, ``ranks`` (s, 2)
    the rank of the passive columns and what the drives add. ``rows`` (N, 6) give the rates of
    the drives, ``q'_a = rows @ V``; ``spare`` (N, c) are motions of drives that leave the
    platform at rest (drives in series, or at a singularity of their strut). ``regular``: there
    are none, and the rows are well conditioned.
    """

    q: FloatArray
    r: FloatArray
    order: IntArray
    ranks: IntArray
    rows: FloatArray
    spare: FloatArray
    regular: bool


def eliminated(chains: Chains, scale: FloatArray, screws: FloatArray) -> Elimination:
    """Return ``chains`` factorised at ``screws`` (s, k, 6), scaled, v at the platform's origin.

    ``scale`` (N,) is metres per unit of each actuator.
    """
    struts, most = chains.actuator.shape
    q, r = np.zeros((struts, 6, 6)), np.zeros((struts, most, 6))
    order, ranks = np.zeros((struts, most), np.int64), np.zeros((struts, 2), np.int64)
    spare = 0
    for s in range(struts):
        passive, count = chains.passive[s], chains.joints[s]
        total = _loaded(chains.actuator[s], count, passive, screws[s], order[s], r[s])
        for i in range(6):
            q[s, i, i] = 1.0
        least = RANK_TOLERANCE * sqrt(total)
        rank = begin = ranks[s, 0]  # 0; numba would compile once more for a literal
        for group in range(2):
            end = passive if group == 0 else count
            last = _factorised(q[s], r[s], order[s], least, rank, begin, end, count)
            ranks[s, group] = last - rank
            rank, begin = last, end
        spare += count - passive - ranks[s, 1]
    return _with_drives(chains, scale, q, r, order, ranks, spare)


def joint_rates(
    chains: Chains, e: Elimination, failed: FloatArray, twists: FloatArray, rates: FloatArray
) -> FloatArray:
    """Return the rates (s, k) of all joints when the struts' tips have scaled ``twists`` (s, 6).

    ``e`` are the struts of ``chains``. The drives of attached ones have the ``rates`` (N,) given;
    struts that ``failed`` (s + 2 N,) says are lost follow the platform as near as they reach,
    drives and all.
    """
    result = np.zeros(chains.actuator.shape)
    rest = np.empty(6)
    for s in range(len(chains.joints)):
        passive = chains.passive[s]
        for i in range(6):
            rest[i] = dot(e.q[s, i], twists[s])
        for place in range(chains.joints[s] - 1, -1, -1):
            joint, rate = e.order[s, place], 0.0
            if place >= passive and failed[s] == 0.0:
                rate = rates[chains.actuator[s, joint]]
            else:
                row, within = place, e.ranks[s, 0]
                if place >= passive:
                    row, within = place - passive + within, within + e.ranks[s, 1]
                if row < within:
                    rate = rest[row] / e.r[s, place, row]
            result[s, joint] = rate
            for i in range(6):
                rest[i] -= e.r[s, place, i] * rate
    return result


def _loaded(
    actuator: IntArray,
    joints: int,
    last: int,
    screws: FloatArray,
    order: IntArray,
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


def _factorised(
    q: FloatArray,
    r: FloatArray,
    order: IntArray,
    least: float,
    rank: int,
    begin: int,
    end: int,
    count: int,
) -> int:
    """Eliminate the columns ``begin`` to ``end`` of one strut in place; return the rank then.

    Householder reflections, the largest remaining column first; columns shorter than ``least``
    count as zero. ``r`` has ``count`` columns, as rows; ``rank`` is that of those before.
    """
    v = np.zeros(6)
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


def _with_drives(
    chains: Chains,
    scale: FloatArray,
    q: FloatArray,
    r: FloatArray,
    order: IntArray,
    ranks: IntArray,
    spare: int,
) -> Elimination:
    """Solve the drive rows of every strut for its drives, by back substitution."""
    rows, free = np.zeros((len(scale), 6)), np.zeros((len(scale), spare))
    least, most, column = np.inf, 0.0, 0
    for s in range(len(chains.joints)):
        passive, begin, end = chains.passive[s], ranks[s, 0], ranks[s, 0] + ranks[s, 1]
        for place in range(passive + ranks[s, 1], chains.joints[s]):
            free[chains.actuator[s, order[s, place]], column] = 1.0
            column += 1
        for row in range(end - 1, begin - 1, -1):
            place = passive + row - begin
            drive, pivot = chains.actuator[s, order[s, place]], r[s, place, row]
            size = abs(pivot) / scale[drive]
            least, most = min(least, size), max(most, size)
            for i in range(6):
                rows[drive, i] = q[s, row, i]
            for later in range(place + 1, chains.joints[s]):
                other = chains.actuator[s, order[s, later]]
                for i in range(6):
                    rows[drive, i] -= r[s, later, row] * rows[other, i]
                for i in range(spare):
                    free[drive, i] -= r[s, later, row] * free[other, i]
            for i in range(6):
                rows[drive, i] /= pivot
            for i in range(spare):
                free[drive, i] /= pivot
    regular = spare == 0 and least > WELL_CONDITIONED * most
    return Elimination(q, r, order, ranks, rows, free, regular)
