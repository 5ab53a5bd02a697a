# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What failures cost: the measures p, t and h, present and next (docs/theory.md, section 5)."""

from __future__ import annotations

from math import inf, nan
from typing import NamedTuple

from fault_tolerance.kernel.array_layout import EstimateArrays, Model, TaskRows
from fault_tolerance.kernel.jacobi_svd import (
    copied,
    decomposed,
    largest_of,
    product,
    projected,
    rank_of,
)
from fault_tolerance.kernel.motions import (
    Kinematics,
    any_of,
    kept_constraints,
    kinematics_of,
    rates_of,
    structure_of,
)
from fault_tolerance.kernel.scratch import matrix, vector
from fault_tolerance.mechanism.arrays import FloatArray, IntArray


class Measures(NamedTuple):
    """What the failures present have cost; 1 where there are none of a kind.

    ``position`` is p of the stuck set on the nominal kinematics, ``torque`` t of the free set
    after it, ``hard`` h of the lost set after both; ``motion`` is w_m of the final system over
    that of the nominal one, which is p where only drives are stuck.
    """

    position: float
    torque: float
    hard: float
    motion: float


class Kinds(NamedTuple):
    """Kinematics as one kind of failure comes after the other (docs/theory.md, section 5).

    ``nominal`` without any, ``locked`` with the stuck set, ``freed`` with the free set as well,
    ``present`` with all. ``weakest`` is the smallest singular value of the constraints of all
    struts that is not absorbed, ``weakest_left`` of those not lost.
    """

    nominal: Kinematics
    locked: Kinematics
    freed: Kinematics
    present: Kinematics
    weakest: float
    weakest_left: float


def manipulability(sigma: FloatArray, order: int, scale: float) -> float:
    """Return w_r, the product of the ``order`` largest ``sigma``, 0 below that rank (eq. 13).

    ``scale`` is what singular values are small beside.
    """
    if order == 0:
        return 1.0
    if not scale > 0.0 or rank_of(sigma, scale) < order:
        return 0.0
    result = 1.0
    for k in range(order):
        result *= sigma[k]
    return result


def columns_of(
    task: TaskRows, motions: FloatArray, which: IntArray, measured: bool, out: FloatArray
) -> FloatArray:
    """Write the columns (n, q) of ``which`` (q,) rows of J, of n ``motions``; return ``out``.

    ``which`` are coordinates of the ``task``; in metres, or if ``measured`` in the metric of the
    measures.
    """
    for i in range(len(which)):
        row = task.rows[which[i]]
        factor = task.measure[which[i]] / task.scale[row] if measured else 1.0
        for c in range(len(motions)):
            out[c, i] = factor * motions[c, row]
    return out


def position_measure(
    work: FloatArray,
    major: FloatArray,
    sigma: FloatArray,
    motions: FloatArray,
    stuck: FloatArray,
) -> float:
    """Return p of ``stuck`` (N,) drives: ``w_m(J_m N) / w_m(J_m)``, N = null(T_F) (eq. 14).

    ``major`` (n, m) are the columns of J_m, ``sigma`` its singular values; ``motions`` have T, and
    ``work`` is room.
    """
    mark, scale, order = work[0], largest_of(sigma), major.shape[1]
    before = manipulability(sigma, order, scale)
    if before == 0.0:
        return 0.0
    rates = rates_of(motions, stuck, matrix(work, len(motions), len(stuck)))
    held = decomposed(work, rates)
    rank = rank_of(held.sigma, 1.0)
    left = matrix(work, len(motions) - rank, order)
    found = decomposed(work, product(held.right, rank, major, left))
    work[0] = mark
    return manipulability(found.sigma, order, scale) / before


def torque_measure(work: FloatArray, locked: Kinematics, free: FloatArray) -> float:
    """Return t of ``free`` (N,) drives after ``locked``: w_n of the rows of T left (eq. 15).

    ``work`` is room for it.
    """
    mark, remaining = work[0], vector(work, len(free))
    for j in range(len(free)):
        remaining[j] = locked.driving[j] * (1.0 - free[j])
    rates = matrix(work, len(locked.motions), len(free))
    found = decomposed(work, rates_of(locked.motions, remaining, rates))
    work[0] = mark
    return manipulability(found.sigma, len(locked.motions), 1.0)


def hard_measure(m: Model, before: Kinematics, after: Kinematics) -> float:
    """Return h of struts lost between ``before`` and ``after``: ``w_r(J) / w_r(P J^)`` (eq. 16).

    r is the rank of J, the rows of the task of ``m``, and P the projection on its range.
    """
    if after.drifting > 0:
        return 0.0
    work, mark, every = m.work, m.work[0], m.task.every
    columns = matrix(work, len(before.motions), len(every))
    whole = decomposed(work, columns_of(m.task, before.motions, every, True, columns))
    order = rank_of(whole.sigma, largest_of(whole.sigma))
    columns = matrix(work, len(after.motions), len(every))
    columns_of(m.task, after.motions, every, True, columns)
    along = projected(columns, whole.left, matrix(work, len(columns), order))
    found = decomposed(work, along)
    work[0] = mark
    left = manipulability(found.sigma, order, largest_of(found.sigma))
    if left == 0.0:
        return 0.0
    return manipulability(whole.sigma, order, largest_of(whole.sigma)) / left


def kinds_of(m: Model, e: EstimateArrays, failed: FloatArray, compliance: float) -> Kinds:
    """Return J and T of ``m`` as what has ``failed`` (s + 2 N,) comes kind by kind.

    The struts are factorised in ``e``, ``compliance`` absorbs some of what they bar.
    """
    s, n = len(m.chains.joints), len(m.drives.scale)
    flags, weakest, weakest_left = vector(m.work, len(failed)), inf, inf
    for i in range(len(flags)):
        flags[i] = 0.0
    for kind in range(4):
        first, end, changed = s + n * (kind - 1), s + n * kind, kind == 0
        if kind == 3:
            first, end = 0, s
        for i in range(max(first, 0), end if kind > 0 else 0):
            flags[i] = failed[i]
            changed = changed or failed[i] != 0.0
        if changed:
            if kind == 0 or kind == 3:
                structure = structure_of(m, e, flags)
                kept = kept_constraints(structure.found.sigma, compliance)
                weakest_left = structure.found.sigma[kept - 1] if kept > 0 else inf
            found = kinematics_of(m, e, structure, flags, compliance)
        if kind == 0:
            nominal, weakest = found, weakest_left
        elif kind == 1:
            locked = found
        elif kind == 2:
            freed = found
    return Kinds(nominal, locked, freed, found, weakest, weakest_left)


def present_measures(m: Model, failed: FloatArray, kinds: Kinds) -> Measures:
    """Return what that which has ``failed`` (s + 2 N,) in ``m`` has cost, by its ``kinds``."""
    s, n, work, order = len(m.chains.joints), len(m.drives.scale), m.work, len(m.task.major)
    mark, stuck, free = work[0], failed[s : s + n], failed[s + n :]
    nominal, present = kinds.nominal.motions, kinds.present.motions
    major, left = matrix(work, len(nominal), order), matrix(work, len(present), order)
    before = decomposed(work, columns_of(m.task, nominal, m.task.major, True, major)).sigma
    position = torque = hard = 1.0
    if any_of(stuck):
        position = position_measure(work, major, before, nominal, stuck)
    motion = position
    if any_of(free):
        torque = torque_measure(work, kinds.locked, free)
    if any_of(failed[:s]):
        hard = hard_measure(m, kinds.freed, kinds.present)
    if any_of(free) or any_of(failed[:s]):
        size = manipulability(before, order, largest_of(before))
        after = decomposed(work, columns_of(m.task, present, m.task.major, True, left)).sigma
        motion = manipulability(after, order, largest_of(after))
        motion = motion / size if size > 0.0 else 0.0
    work[0] = mark
    return Measures(position, torque, hard, motion)


def next_measures(
    m: Model,
    e: EstimateArrays,
    failed: FloatArray,
    compliance: float,
    present: Kinematics,
    out: FloatArray,
) -> None:
    """Write p (N,), t (N,) and h (s,) of every single further failure to ``out``.

    The ``present`` system, with what has ``failed`` (s + 2 N,) in ``m``, is taken as nominal; NaN
    for what has failed already. The struts are factorised in ``e``, ``compliance`` absorbs
    constraints.
    """
    s, n, work = len(m.chains.joints), len(m.drives.scale), m.work
    one, further = vector(work, n), vector(work, len(failed))
    major = matrix(work, len(present.motions), len(m.task.major))
    columns_of(m.task, present.motions, m.task.major, True, major)
    sigma = decomposed(work, major).sigma
    for j in range(n):
        one[j] = 0.0
    for j in range(n):
        out[j] = out[n + j] = nan
        if present.driving[j] != 0.0:
            one[j] = 1.0
            out[j] = position_measure(work, major, sigma, present.motions, one)
            out[n + j] = torque_measure(work, present, one)
            one[j] = 0.0
    mark = work[0]
    for lost in range(s):
        out[2 * n + lost] = nan
        if failed[lost] == 0.0:
            copied(failed, further)
            further[lost] = 1.0
            for j in range(n):
                if m.chains.strut[j] == lost:
                    further[s + j] = further[s + n + j] = 0.0
            structure = structure_of(m, e, further)
            after = kinematics_of(m, e, structure, further, compliance)
            out[2 * n + lost] = hard_measure(m, present, after)
            work[0] = mark
