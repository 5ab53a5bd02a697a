# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Measures of what failures cost: p (stuck), t (free), h (strut lost), and the verdict.

docs/theory.md, sections 4 and 5.
"""

from math import inf, nan
from typing import NamedTuple

from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import EstimateArrays, Model, TaskRows
from fault_tolerance.kernel.jacobians import (
    Kinematics,
    Structure,
    any_of,
    constraint_rank,
    kinematics_of,
    rates_of,
    structure_of,
)
from fault_tolerance.kernel.scratch import matrix, set_zero, vector
from fault_tolerance.kernel.small_matrices import (
    copy_to,
    count_above,
    decomposed,
    dot,
    largest_of,
    product,
    rank_of,
)
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import COMPLIANCE_BAND, RANK_TOLERANCE


class Stages(NamedTuple):
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

    Singular values that are rounding beside ``scale`` do not count.
    """
    if order == 0:
        return 1.0
    if not scale > 0.0 or count_above(sigma, RANK_TOLERANCE * scale) < order:
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
    """Return p of ``stuck`` (N,) actuators: ``w_m(J_m N) / w_m(J_m)``, N = null(T_F) (eq. 14).

    ``major`` (n, m) are the columns of J_m and ``sigma`` its singular values, ``motions`` those of
    J and T.
    """
    mark, scale, order = work[0], largest_of(sigma), major.shape[1]
    before = manipulability(sigma, order, scale)
    if before == 0.0:
        return 0.0
    rates = rates_of(motions, stuck, matrix(work, len(motions), len(stuck)))
    held = decomposed(work, rates)
    rank = count_above(held.sigma, RANK_TOLERANCE)
    left = matrix(work, len(motions) - rank, order)
    after = decomposed(work, product(held.right, rank, major, left)).sigma
    work[0] = mark
    return manipulability(after, order, scale) / before


def torque_measure(work: FloatArray, locked: Kinematics, free: FloatArray) -> float:
    """Return t of ``free`` (N,) actuators after ``locked``: w_n of the rows of T left (eq. 15)."""
    mark, remaining = work[0], vector(work, len(free))
    for j in range(len(free)):
        remaining[j] = locked.driving[j] * (1.0 - free[j])
    rates = matrix(work, len(locked.motions), len(free))
    sigma = decomposed(work, rates_of(locked.motions, remaining, rates)).sigma
    work[0] = mark
    return manipulability(sigma, len(locked.motions), 1.0)


def hard_measure(m: Model, before: Kinematics, after: Kinematics) -> float:
    """Return h of struts lost between ``before`` and ``after``: ``w_r(J) / w_r(P J^)`` (eq. 16).

    r is the rank of J, the rows of the task, and P the projection on its range.
    """
    if after.uncontrolled > 0:
        return 0.0
    work, mark, every = m.work, m.work[0], m.task.every
    columns = matrix(work, len(before.motions), len(every))
    whole = decomposed(work, columns_of(m.task, before.motions, every, True, columns))
    order = rank_of(whole.sigma)
    columns = matrix(work, len(after.motions), len(every))
    columns_of(m.task, after.motions, every, True, columns)
    projected, left = matrix(work, len(columns), order), whole.left
    for i in range(len(columns)):
        for k in range(order):
            projected[i, k] = dot(columns[i], left[k])
    sigma = decomposed(work, projected).sigma
    work[0] = mark
    remaining = manipulability(sigma, order, largest_of(sigma))
    if remaining == 0.0:
        return 0.0
    return manipulability(whole.sigma, order, largest_of(whole.sigma)) / remaining


def staged_kinematics(
    m: Model, e: EstimateArrays, failed: FloatArray, compliance: float
) -> Stages:
    """Return J and T as what has ``failed`` comes kind by kind; ``compliance`` absorbs."""
    s, n = len(m.chains.joints), len(m.actuators.scale)
    flags = set_zero(vector(m.work, len(failed)))
    whole = structure_of(m, e, flags)
    weakest = weakest_left = _weakest(whole, compliance)
    nominal = kinematics_of(m, e, whole, flags, compliance)
    locked = nominal
    if any_of(failed[s : s + n]):
        copy_to(failed[s : s + n], flags[s:])
        locked = kinematics_of(m, e, whole, flags, compliance)
    freed = locked
    if any_of(failed[s + n :]):
        copy_to(failed[s + n :], flags[s + n :])
        freed = kinematics_of(m, e, whole, flags, compliance)
    present = freed
    if any_of(failed[:s]):
        copy_to(failed[:s], flags)
        left = structure_of(m, e, flags)
        weakest_left = _weakest(left, compliance)
        present = kinematics_of(m, e, left, flags, compliance)
    return Stages(nominal, locked, freed, present, weakest, weakest_left)


def _weakest(structure: Structure, compliance: float) -> float:
    """Return the smallest singular value that is not absorbed."""
    rank = constraint_rank(structure.svd.sigma, compliance)
    return structure.svd.sigma[rank - 1] if rank > 0 else inf


def present_measures(
    m: Model, failed: FloatArray, stages: Stages
) -> tuple[float, float, float, float]:
    """Return what the failures present have cost, by the ``stages``; 1 where nothing has failed.

    p of the stuck set on the nominal kinematics, t of the free set after it, h of the lost set
    after both; and w_m of the final system over that of the nominal one, which is p where
    actuators are only stuck.
    """
    s, n, work, order = len(m.chains.joints), len(m.actuators.scale), m.work, len(m.task.major)
    mark, stuck, free = work[0], failed[s : s + n], failed[s + n :]
    nominal, present = stages.nominal.motions, stages.present.motions
    major, left = matrix(work, len(nominal), order), matrix(work, len(present), order)
    before = decomposed(work, columns_of(m.task, nominal, m.task.major, True, major)).sigma
    position = torque = hard = 1.0
    if any_of(stuck):
        position = position_measure(work, major, before, nominal, stuck)
    motion = position
    if any_of(free):
        torque = torque_measure(work, stages.locked, free)
    if any_of(failed[:s]):
        hard = hard_measure(m, stages.freed, stages.present)
    if any_of(free) or any_of(failed[:s]):
        size = manipulability(before, order, largest_of(before))
        after = decomposed(work, columns_of(m.task, present, m.task.major, True, left)).sigma
        motion = manipulability(after, order, largest_of(after))
        motion = motion / size if size > 0.0 else 0.0
    work[0] = mark
    return position, torque, hard, motion


def next_measures(
    m: Model,
    e: EstimateArrays,
    failed: FloatArray,
    compliance: float,
    present: Kinematics,
    out: FloatArray,
) -> None:
    """Write p (N,), t (N,) and h (s,) of every single further failure.

    The ``present`` system is taken as nominal; NaN for what has failed already. ``compliance``
    absorbs constraints.
    """
    s, n, work = len(m.chains.joints), len(m.actuators.scale), m.work
    one, further = set_zero(vector(work, n)), vector(work, len(failed))
    major = matrix(work, len(present.motions), len(m.task.major))
    columns_of(m.task, present.motions, m.task.major, True, major)
    sigma = decomposed(work, major).sigma
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
            copy_to(failed, further)
            further[lost] = 1.0
            for j in range(n):
                if m.chains.strut[j] == lost:
                    further[s + j] = further[s + n + j] = 0.0
            structure = structure_of(m, e, further)
            after = kinematics_of(m, e, structure, further, compliance)
            out[2 * n + lost] = hard_measure(m, present, after)
            work[0] = mark


def judge(m: Model, e: EstimateArrays, last: EstimateArrays, failed: FloatArray) -> Kinematics:
    """Write mobility, measures and verdict to ``e``, and return J and T with the failures.

    A constraint that was absorbed in the ``last`` estimate stays so until it exceeds the
    compliance by `COMPLIANCE_BAND`: otherwise the verdict would change with every noisy reading
    while a scan crosses it.
    """
    facts, mark = e.facts, m.work[0]
    compliance, limit = m.law.compliance, COMPLIANCE_BAND * m.law.compliance
    same = True
    for i in range(len(failed)):
        same = same and failed[i] == last.failed[i]
    for _ in range(2):
        m.work[0] = mark
        stages = staged_kinematics(m, e, failed, compliance)
        nominal, present = stages.nominal, stages.present
        facts[at.NOMINAL_FREEDOM] = len(nominal.motions) + nominal.uncontrolled
        facts[at.FREEDOM] = len(present.motions) + present.uncontrolled
        nominally_fewer = facts[at.NOMINAL_FREEDOM] < last.facts[at.NOMINAL_FREEDOM]
        fewer = same and facts[at.FREEDOM] < last.facts[at.FREEDOM]
        if not (
            (nominally_fewer and stages.weakest <= limit)
            or (fewer and stages.weakest_left <= limit)
        ):
            break
        compliance = limit
    _, torque, hard, motion = present_measures(m, failed, stages)
    major = matrix(m.work, len(present.motions), len(m.task.major))
    columns_of(m.task, present.motions, m.task.major, False, major)
    rank = rank_of(decomposed(m.work, major).sigma)
    tolerated = (
        present.uncontrolled == 0
        and rank >= len(m.task.major)
        and min(motion, torque, hard) >= m.law.threshold
    )
    facts[at.COMPLIANCE], facts[at.MOBILITY] = compliance, len(present.motions)
    facts[at.UNCONTROLLED] = present.uncontrolled
    facts[at.TORQUE], facts[at.HARD], facts[at.MOTION] = torque, hard, motion
    facts[at.TOLERATED] = 1.0 if tolerated else 0.0
    return present
