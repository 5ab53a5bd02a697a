# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What failures cost: the measures p, t and h, present and next (docs/theory.md, section 5)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fault_tolerance.kernel.elimination import Elimination
from fault_tolerance.kernel.factorisation import (
    columns_from,
    largest_of,
    product,
    rank_of,
    rows_of,
    singular_values,
    svd,
)
from fault_tolerance.kernel.model import Model, TaskRows
from fault_tolerance.kernel.motions import (
    Kinematics,
    Structure,
    allowed_motions,
    holds,
    kept_constraints,
    kinematics_with,
    structure_of,
)
from fault_tolerance.mechanism.arrays import FloatArray, IntArray


class Failed(NamedTuple):
    """Failures by kind, 1 where they hold: struts lost (s,), actuators (N,) stuck and free.

    ``driving`` (N,) are those that still drive: attached, not stuck, not free.
    """

    lost: FloatArray
    stuck: FloatArray
    free: FloatArray
    driving: FloatArray


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


def failed_parts(m: Model, failed: FloatArray) -> Failed:
    """Return what ``failed`` (s + 2 N,) in ``m``, by kind."""
    s, n = len(m.chains.joints), len(m.chains.strut)
    driving = np.zeros(n)
    for j in range(n):
        if holds(m.chains.strut, failed, j) and failed[s + j] == 0.0 and failed[s + n + j] == 0.0:
            driving[j] = 1.0
    return Failed(failed[:s], failed[s : s + n], failed[s + n :], driving)


def any_of(flags: FloatArray) -> bool:
    """Return whether any of ``flags`` (k,) is set."""
    for i in range(len(flags)):
        if flags[i] != 0.0:
            return True
    return False


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


def task_rows(
    task: TaskRows, jacobian: FloatArray, which: IntArray, measured: bool
) -> FloatArray:
    """Return rows ``which`` (q,) of the ``task``'s Jacobian from a scaled ``jacobian`` (6, n).

    In metres, or if ``measured`` in the metric of the measures.
    """
    result = np.empty((len(which), jacobian.shape[1]))
    for i in range(len(which)):
        row = task.rows[which[i]]
        factor = task.measure[which[i]] / task.scale[row] if measured else 1.0
        for c in range(jacobian.shape[1]):
            result[i, c] = factor * jacobian[row, c]
    return result


def position_measure(
    major: FloatArray, sigma: FloatArray, mapping: FloatArray, stuck: FloatArray
) -> float:
    """Return p of ``stuck`` (N,) drives: ``w_m(J_m N) / w_m(J_m)``, N = null(T_F) (eq. 14).

    ``major`` (m, n) is J_m with singular values ``sigma``, ``mapping`` (N, n) is T.
    """
    scale = largest_of(sigma)
    before = manipulability(sigma, len(major), scale)
    if before == 0.0:
        return 0.0
    _, held, right = svd(rows_of(mapping, stuck))
    left = singular_values(product(major, columns_from(right, rank_of(held, 1.0))))
    return manipulability(left, len(major), scale) / before


def torque_measure(locked: Kinematics, free: FloatArray) -> float:
    """Return t of ``free`` (N,) drives after ``locked``: w_n of the rows of T left (eq. 15)."""
    remaining = np.empty(len(free))
    for j in range(len(free)):
        remaining[j] = 1.0 - free[j]
    sigma = singular_values(rows_of(locked.mapping, remaining))
    return manipulability(sigma, locked.mapping.shape[1], 1.0)


def hard_measure(task: TaskRows, before: Kinematics, after: Kinematics) -> float:
    """Return h of struts lost between ``before`` and ``after``: ``w_r(J) / w_r(P J^)`` (eq. 16).

    r is the rank of J, the rows of the ``task``, and P the projection on its range.
    """
    if after.drifting > 0:
        return 0.0
    every = np.arange(len(task.rows))
    basis, sigma, _ = svd(task_rows(task, before.jacobian, every, True))
    order = rank_of(sigma, largest_of(sigma))
    projection = np.empty((order, len(every)))
    for k in range(order):
        for i in range(len(every)):
            projection[k, i] = basis[i, k]
    found = singular_values(product(projection, task_rows(task, after.jacobian, every, True)))
    left = manipulability(found, order, largest_of(found))
    if left == 0.0:
        return 0.0
    return manipulability(sigma, order, largest_of(sigma)) / left


def kinematics_of(
    m: Model, struts: Elimination, structure: Structure, failed: FloatArray, compliance: float
) -> Kinematics:
    """Return J and T with what has ``failed`` (s + 2 N,) in ``m``.

    ``struts`` are factorised, ``structure`` is what those not lost bar, and ``compliance`` absorbs
    some of it.
    """
    kept, parts = kept_constraints(structure.sigma, compliance), failed_parts(m, failed)
    twists, rates = allowed_motions(m, struts, failed, structure, kept)
    return kinematics_with(twists, rates, parts.stuck, parts.driving)


def present_measures(
    m: Model,
    struts: Elimination,
    whole: Structure,
    failed: FloatArray,
    compliance: float,
    nominal: Kinematics,
    present: Kinematics,
) -> Measures:
    """Return what ``failed`` (s + 2 N,) has cost ``m`` between ``nominal`` and ``present``.

    ``struts`` are factorised, ``whole`` is what all of them bar, less what ``compliance`` absorbs.
    """
    parts, count = failed_parts(m, failed), len(m.chains.joints)
    stuck, free, lost = any_of(parts.stuck), any_of(parts.free), any_of(parts.lost)
    locked = freed = nominal
    flags = np.zeros(len(failed))
    for kind in range(2):  # the stuck set alone, then with the free set
        first = count + kind * len(parts.stuck)
        for j in range(len(parts.stuck)):
            flags[first + j] = failed[first + j]
        if (free or lost) if kind == 0 else lost:
            freed = kinematics_of(m, struts, whole, flags, compliance)
            locked = freed if kind == 0 else locked
    major = task_rows(m.task, nominal.jacobian, m.task.major, True)
    before = singular_values(major)
    position = position_measure(major, before, nominal.mapping, parts.stuck) if stuck else 1.0
    torque = torque_measure(locked, parts.free) if free else 1.0
    hard = hard_measure(m.task, freed, present) if lost else 1.0
    after = singular_values(task_rows(m.task, present.jacobian, m.task.major, True))
    order, motion = len(m.task.major), position
    size = manipulability(before, order, largest_of(before))
    if free or lost:
        motion = manipulability(after, order, largest_of(after)) / size if size > 0.0 else 0.0
    return Measures(position, torque, hard, motion)


def next_measures(
    m: Model, struts: Elimination, failed: FloatArray, compliance: float, present: Kinematics
) -> FloatArray:
    """Return p (N,), t (N,) and h (s,) of every single further failure, one after the other.

    The ``present`` system, with what has ``failed`` (s + 2 N,) in ``m``, is taken as nominal; NaN
    for what has failed already. ``struts`` are factorised, ``compliance`` absorbs constraints.
    """
    n, count = len(m.chains.strut), len(m.chains.joints)
    parts, result = failed_parts(m, failed), np.full(2 * n + count, np.nan)
    major = task_rows(m.task, present.jacobian, m.task.major, True)
    sigma = singular_values(major)
    for j in range(n):
        if parts.driving[j] != 0.0:
            one = np.zeros(n)
            one[j] = 1.0
            result[j] = position_measure(major, sigma, present.mapping, one)
            result[n + j] = torque_measure(present, one)
    for s in range(count):
        if failed[s] == 0.0:
            further = failed.copy()
            further[s] = 1.0
            for j in range(n):
                if m.chains.strut[j] == s:
                    further[count + j] = further[count + n + j] = 0.0
            structure = structure_of(struts, further)
            after = kinematics_of(m, struts, structure, further, compliance)
            result[2 * n + s] = hard_measure(m.task, present, after)
    return result
