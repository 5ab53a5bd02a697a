# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The control law: from a task velocity to actuator rates within all limits.

With reduced rates x, so that ``v = J^ x`` and the actuators go ``T^ x``, in metres per second:

1. *Task priority.* x serves the major task exactly where it can (least squares where not), and
   among all such x the secondary task as well as it can:

       x = J_m^+ v_m + N (J_s N)^+ (v_s - J_s J_m^+ v_m),   N = null(J_m)   (theory, eq. 22)

   Directions with a transmission (a singular value) of at most `singular_below` are not driven.
   Secondary ones below `poor_below` of the best major one are not either; they fade in up to
   twice that.
2. *Near singularities* everything slows down, from the margin `slow_below` to 0 at `hold_below`
   (eq. 23).
3. *Limits.* Rates stay within ``lower <= T^ x <= upper``: the largest share of the secondary part
   that fits, and if none does, the major part alone by the largest factor that fits. Clipping
   single actuators would leave the range of T^ and make the struts fight.
4. *Transitions.* After the kinematics have changed, and after a rest, x goes from the point
   nearest to the last command that moves the major task as before, to what it should be, at
   limited acceleration of the drives.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np

from fault_tolerance.kernel.factorisation import (
    columns_from,
    combined,
    dot,
    largest_of,
    norm,
    product,
    rank_of,
    svd,
)
from fault_tolerance.kernel.margins import task_rows
from fault_tolerance.kernel.model import Drives, Law, TaskRows
from fault_tolerance.kernel.motions import Kinematics
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import LARGEST_SPEED, NEGLIGIBLE_RATE, SAME_COMMAND


class Priority(NamedTuple):
    """A task velocity resolved by priority.

    ``first`` and ``second`` (n,) are the parts of the reduced rates that serve the major and the
    secondary task; ``major`` (m, n) is J_m, ``sigma`` its singular values (the transmissions) and
    ``right`` its right directions, of which the first ``driven`` are driven.
    """

    first: FloatArray
    second: FloatArray
    major: FloatArray
    sigma: FloatArray
    right: FloatArray
    driven: int


class Within(NamedTuple):
    """A command within bounds: everything times ``scale``, the second part by ``share`` before.

    ``saturated`` (N,) is 1 for the actuators that would have crossed a bound.
    """

    scale: float
    share: float
    saturated: FloatArray


def asked_velocity(task: TaskRows, velocity: FloatArray) -> FloatArray:
    """Return a task ``velocity`` (l,) in metres per second, a huge one brought down."""
    result, size = np.empty(len(velocity)), 0.0
    for i in range(len(velocity)):
        size = max(size, abs(velocity[i]))
    for i in range(len(velocity)):
        bounded = velocity[i]
        if size > LARGEST_SPEED:
            bounded = LARGEST_SPEED * (velocity[i] / size)
        result[i] = task.scale[task.rows[i]] * bounded
    return result


def prioritised(
    task: TaskRows, law: Law, kinematics: Kinematics, asked: FloatArray
) -> Priority:
    """Return the reduced rates of ``kinematics`` for a task velocity ``asked`` (l,): step 1.

    The velocity is of the ``task``, m/s; ``law`` says what is too poor to be driven.
    """
    n = kinematics.mapping.shape[1]
    major = task_rows(task, kinematics.jacobian, task.major, False)
    left, sigma, right = svd(major)
    first, second = np.zeros(n), np.zeros(n)
    driven = 0
    for k in range(len(sigma)):
        if sigma[k] > law.singular_below:
            driven += 1
            share = 0.0
            for i in range(len(task.major)):
                share += left[i, k] * asked[task.major[i]]
            for c in range(n):
                first[c] += share / sigma[k] * right[k, c]
    best = largest_of(sigma)
    rank = rank_of(sigma, max(1.0, best))
    if rank < n and len(task.secondary) > 0:
        free = columns_from(right, rank)
        rows = task_rows(task, kinematics.jacobian, task.secondary, False)
        missing = np.empty(len(task.secondary))
        for i in range(len(missing)):
            missing[i] = asked[task.secondary[i]] - dot(rows[i], first)
        least = max(law.singular_below, law.poor_below * best)
        turned, gains, mixed = svd(product(rows, free))
        for k in range(len(gains)):
            if gains[k] > least:
                share = 0.0
                for i in range(len(missing)):
                    share += turned[i, k] * missing[i]
                share *= min(gains[k] / least - 1.0, 1.0) / gains[k]
                for c in range(n):
                    for d in range(free.shape[1]):
                        second[c] += free[c, d] * mixed[k, d] * share
    return Priority(first, second, major, sigma, right, driven)


def rate_bounds(
    drives: Drives, gain: float, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the bounds (N,) of ``drives`` at joint ``values`` (N,), NaN where there is none.

    Towards an end of its stroke an actuator goes no faster than ``gain`` times the way
    left, so it arrives without a jolt; beyond an end it may only come back (a velocity damper,
    Faverjon and Tournassoud, ICRA 1987).
    """
    lower, upper = np.empty(len(values)), np.empty(len(values))
    for j in range(len(values)):
        lower[j], upper[j] = -drives.speed[j], drives.speed[j]
        if isfinite(values[j]):
            lower[j] = -min(max(gain * (drives.low[j] + values[j]), 0.0), drives.speed[j])
            upper[j] = min(max(gain * (drives.high[j] - values[j]), 0.0), drives.speed[j])
    return lower, upper


def scaled_rates(
    drives: FloatArray, follow: FloatArray, reduced: FloatArray, scale: float
) -> FloatArray:
    """Return the rates (N,) of all actuators, in their units, for ``scale * reduced`` (n,).

    ``drives`` (N,) are metres per unit, ``follow`` (N, n) as in `Kinematics`.
    """
    rates = np.empty(len(drives))
    for j in range(len(rates)):
        # Adding zero turns -0.0 into 0.0.
        rates[j] = scale * dot(follow[j], reduced) / drives[j] + 0.0
    return rates


def limited(
    drives: FloatArray,
    follow: FloatArray,
    first: FloatArray,
    second: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    scale: float,
) -> Within:
    """Return what is left of ``scale * (first + second)`` (n,) within bounds: step 3.

    ``lower`` and ``upper`` (N,) bound the rates; ``drives`` and ``follow`` as in `scaled_rates`.
    """
    major = _without_rounding(scaled_rates(drives, follow, first, scale))
    other = _without_rounding(scaled_rates(drives, follow, second, scale))
    wanted = _without_rounding(combined(1.0, major, 1.0, other))
    saturated, crossing = np.zeros(len(major)), False
    for j in range(len(wanted)):
        if wanted[j] < lower[j] or wanted[j] > upper[j]:
            saturated[j], crossing = 1.0, True
    if not crossing:
        return Within(scale, 1.0, saturated)
    share = 1.0
    for j in range(len(major)):
        if other[j] != 0.0:
            low, high = (lower[j] - major[j]) / other[j], (upper[j] - major[j]) / other[j]
            share = min(share, max(low, high))
    share = max(share, 0.0)
    excess = size = 0.0
    for j in range(len(major)):
        rate = major[j] + share * other[j]
        excess = max(excess, lower[j] - rate, rate - upper[j])
        size = max(size, abs(rate))
    factor = 1.0
    if excess > NEGLIGIBLE_RATE * size:
        share = 0.0
        for j in range(len(major)):
            bound = lower[j] if major[j] < 0.0 else upper[j]
            if abs(major[j]) > abs(bound):
                factor = min(factor, bound / major[j])
    return Within(scale * factor, share, saturated)


def _without_rounding(rates: FloatArray) -> FloatArray:
    """Return rates (N,) with 0 for what is only rounding beside the largest."""
    largest = 0.0
    for j in range(len(rates)):
        largest = max(largest, abs(rates[j]))
    result = np.zeros(len(rates))
    for j in range(len(rates)):
        if abs(rates[j]) > NEGLIGIBLE_RATE * largest:
            result[j] = rates[j]
    return result


def jump_between(
    task: TaskRows,
    drives: FloatArray,
    kinematics: Kinematics,
    reduced: FloatArray,
    sent: FloatArray,
    twist: FloatArray,
) -> tuple[float, float]:
    """Return by how much ``reduced`` rates (n,) jump, m/s: major ``task``, and norm of the drives.

    They are of ``kinematics``; ``sent`` (N,) and ``twist`` (6,) are the last command, in true
    units; ``drives`` (N,) are metres per unit.
    """
    major = rates = 0.0
    for i in range(len(task.major)):
        row = task.rows[task.major[i]]
        away = dot(kinematics.jacobian[row], reduced) - task.scale[row] * twist[row]
        major += away * away
    for j in range(len(sent)):
        away = dot(kinematics.follow[j], reduced) - drives[j] * sent[j]
        rates += away * away
    return sqrt(major), sqrt(rates)


def eased(
    task: TaskRows,
    drives: FloatArray,
    kinematics: Kinematics,
    priority: Priority,
    goal: FloatArray,
    sent: FloatArray,
    twist: FloatArray,
    allowed: float,
) -> tuple[FloatArray, bool]:
    """Return the reduced rates on the way to ``goal`` (n,), and whether they are it: step 4.

    ``priority`` is what the ``task`` velocity has been resolved to by ``kinematics``; ``sent``
    (N,) and ``twist`` (6,) are the last command, in true units, ``drives`` (N,) metres per unit.
    By ``allowed`` (m/s) the drives' speed may differ from the start.
    """
    start = np.zeros(len(goal))
    for j in range(len(sent)):
        for c in range(len(start)):
            start[c] += kinematics.mapping[j, c] * drives[j] * sent[j]
    missing = np.empty(len(task.major))
    for i in range(len(missing)):
        row = task.rows[task.major[i]]
        missing[i] = task.scale[row] * twist[row] - dot(priority.major[i], start)
    for k in range(priority.driven):
        # The left direction times its singular value is J_m times the right one.
        share = 0.0
        for i in range(len(missing)):
            share += dot(priority.major[i], priority.right[k]) * missing[i]
        for c in range(len(start)):
            start[c] += share / priority.sigma[k] ** 2 * priority.right[k, c]
    way = combined(1.0, goal, -1.0, start)
    distance = norm(way)
    if distance <= allowed + SAME_COMMAND * max(norm(goal), norm(start)):
        return goal, True
    return combined(1.0, start, allowed / distance, way), False
