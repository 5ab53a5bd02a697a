# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Closing the loops at given readings: Gauss-Newton with chord steps, from a warm start.

Each step first removes the closure error in the constraint directions stiffer than `compliance`;
the remaining degrees of freedom fit the readings by least squares, and the joints follow strut by
strut (docs/theory.md, section 3). The factorisations of one configuration serve for several steps
(chord steps); the last evaluation serves for the next estimate. ``e`` is changed in place: pose,
joint values, closure errors, strut factorisations.
"""

from math import inf, isfinite, sqrt
from typing import NamedTuple

from fault_tolerance.kernel.array_layout import EstimateArrays, Model
from fault_tolerance.kernel.jacobians import (
    Structure,
    constraint_null_space,
    constraint_rank,
    freedom_of,
    is_attached,
    norm_of_columns,
    rates_of,
    structure_of,
)
from fault_tolerance.kernel.scratch import matrix, vector
from fault_tolerance.kernel.small_matrices import (
    axpby,
    copy_to,
    decomposed,
    dot,
    norm,
    pseudo_solve,
    rank_of,
    weighted_sum,
)
from fault_tolerance.kernel.strut_poses import displace, place_struts
from fault_tolerance.kernel.strut_qr import factorise, joint_rates
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import (
    CHORD_FIT,
    CHORD_REACH,
    CHORD_STEP,
    CLOSURE_TOLERANCE,
    LONGEST_STEP,
    STALLED,
)

MOST_FACTORISATIONS, MOST_CHORDS = 60, 4
"""Configurations at which the struts are factorised in one closing; steps from each."""


class Closing(NamedTuple):
    """How closing the loops has ended.

    ``strain`` is the closure error (m) in the compliant directions, which the flexures absorb.
    """

    converged: bool
    strain: float


def close_loops(m: Model, e: EstimateArrays, failed: FloatArray, target: FloatArray) -> Closing:
    """Move ``e`` to where the loops of the attached struts close and the readings fit best.

    ``target`` (N,) are joint values read, NaN where there is none; those of lost struts are not
    looked at. Returns how that has ended.
    """
    mark = m.work[0]
    arrived, last_rank, last_error = False, -1, inf
    for _ in range(MOST_FACTORISATIONS):
        m.work[0] = mark
        structure = structure_of(m, e, failed)
        rank = constraint_rank(structure.svd.sigma, m.law.closing_compliance)
        if arrived and rank == last_rank:
            rigid_error, strain = _closure_residual(m, e, structure, failed, rank)
            if rigid_error <= CLOSURE_TOLERANCE:
                m.work[0] = mark
                return Closing(True, strain)
            if not rigid_error <= STALLED * last_error:
                break
            last_error = rigid_error
        last_rank = rank
        steps, arrived = _chord_steps(m, e, failed, target, structure, rank)
        if steps == 0:
            break
    m.work[0] = mark
    return Closing(False, 0.0)


def largest_misfit(
    m: Model, e: EstimateArrays, failed: FloatArray, target: FloatArray
) -> float:
    """Return by how much ``target`` (N,) and the values in attached struts differ, m, at most."""
    strut, joint, values = m.chains.strut, m.chains.joint, e.values
    largest = 0.0
    for j in range(len(target)):
        if strut[j] >= 0 and is_attached(strut, failed, j) and isfinite(target[j]):
            off = abs(target[j] - values[strut[j], joint[j]])
            largest = max(largest, off * m.actuators.scale[j])
    return largest


def _closure_residual(
    m: Model, e: EstimateArrays, structure: Structure, failed: FloatArray, rank: int
) -> tuple[float, float]:
    """Return the closure error (m) in rigid directions and in compliant ones."""
    mark, strut_of_row, left = m.work[0], structure.strut_of_row, structure.svd.left
    g = len(strut_of_row)
    error = _constraint_error(structure, e.closure_error, vector(m.work, g))
    strain = copy_to(error, vector(m.work, g))
    for k in range(rank):
        axpby(1.0, strain, -dot(left[k], error), left[k], strain)
    rigid_error = matrix(m.work, len(e.closure_error), 6)
    for s in range(len(rigid_error)):
        for c in range(6):
            rigid_error[s, c] = e.closure_error[s, c] if failed[s] == 0.0 else 0.0
    for i in range(g):
        own = rigid_error[int(strut_of_row[i])]
        for c in range(6):
            own[c] -= strain[i] * structure.columns[c, i]
    m.work[0] = mark
    return norm_of_columns(rigid_error, 0, 6), norm(strain)


def _constraint_error(
    structure: Structure, closure_error: FloatArray, out: FloatArray
) -> FloatArray:
    """Write the closure error along each constraint row; return ``out``."""
    columns, strut_of_row = structure.columns, structure.strut_of_row
    for i in range(len(out)):
        own = closure_error[int(strut_of_row[i])]
        out[i] = 0.0
        for c in range(6):
            out[i] += columns[c, i] * own[c]
    return out


def _chord_steps(
    m: Model,
    e: EstimateArrays,
    failed: FloatArray,
    target: FloatArray,
    structure: Structure,
    rank: int,
) -> tuple[int, bool]:
    """Move ``e`` by steps with one set of factorisations; return how many, and whether it arrived.

    ``rank`` constraints of the ``structure`` count. 0 steps: a number was not finite.
    """
    (s, k), n, work = m.chains.actuator.shape, len(target), m.work
    length, joints, strut, joint = m.chains.length, m.chains.joints, m.chains.strut, m.chains.joint
    scale, closure_error, values, rows = m.actuators.scale, e.closure_error, e.values, e.rows
    motions = matrix(work, freedom_of(m, e, failed, rank), 6 + n)
    constraint_null_space(m, e, failed, structure, rank, motions)
    read = vector(work, n)
    for j in range(n):
        read[j] = 1.0 if is_attached(strut, failed, j) and isfinite(target[j]) else 0.0
    fitted = rates_of(motions, read, matrix(work, len(motions), n))
    for c in range(len(motions)):
        for j in range(n):
            fitted[c, j] /= scale[j]
    svd = decomposed(work, fitted)
    fit_rank = rank_of(svd.sigma)
    screws = vector(work, 6 * s * k).reshape((s, k, 6))
    twist, rates, misfit = vector(work, 6), vector(work, n), vector(work, n)
    error, shares = vector(work, len(structure.strut_of_row)), vector(work, len(motions))
    tips, follow = matrix(work, s, 6), matrix(work, s, k)
    travelled, arrived, steps = 0.0, False, 0
    for _ in range(MOST_CHORDS):
        _constraint_error(structure, closure_error, error)
        pseudo_solve(structure.svd, rank, error, twist)
        axpby(-1.0, twist, 0.0, twist, twist)
        for j in range(n):
            rates[j] = misfit[j] = 0.0
            if is_attached(strut, failed, j):
                rates[j] = dot(rows[j], twist) + dot(rows[j], closure_error[strut[j]])
            if read[j] != 0.0:
                misfit[j] = target[j] - values[strut[j], joint[j]] - rates[j]
        pseudo_solve(svd, fit_rank, misfit, shares)
        for i in range(6):
            twist[i] += weighted_sum(motions, shares, i)
        square = whole = 0.0
        for j in range(n):
            rates[j] += weighted_sum(motions, shares, 6 + j) / scale[j]
            square += (scale[j] * rates[j]) ** 2
        for i in range(s):
            axpby(1.0, closure_error[i], 1.0, twist, tips[i])
        joint_rates(m, e, failed, tips, rates, follow)
        for i in range(s):
            for j in range(joints[i]):
                if failed[i] == 0.0:
                    whole += abs(follow[i, j])
                elif not isfinite(follow[i, j]):
                    follow[i, j] = 0.0  # a lost strut may stay behind
        step = max(norm(twist), sqrt(square))
        if not isfinite(step + whole):
            return 0, False
        shortened = 1.0
        if step > LONGEST_STEP * length:
            shortened = LONGEST_STEP * length / step
        axpby(shortened, twist, 0.0, twist, twist)
        displace(m, e.pose, twist)
        for i in range(s):
            for j in range(joints[i]):
                values[i, j] += shortened * follow[i, j]
        place_struts(m, e, screws)
        steps += 1
        travelled += step
        arrived = step * travelled <= (CHORD_STEP * length) ** 2
        if arrived and travelled > CHORD_STEP * length:
            off = largest_misfit(m, e, failed, target)
            arrived = off * travelled <= (CHORD_FIT * length) ** 2
        if arrived or travelled > CHORD_REACH * length:
            break
    factorise(m, e, screws)
    return steps, arrived
