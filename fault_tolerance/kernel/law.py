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

from fault_tolerance.kernel.array_layout import CommandArrays, Drives, Model, TaskRows
from fault_tolerance.kernel.failure_measures import columns_of
from fault_tolerance.kernel.jacobi_svd import (
    Decomposition,
    along,
    combined,
    copied,
    decomposed,
    dot,
    largest_of,
    norm,
    product,
    rank_of,
    solved,
)
from fault_tolerance.kernel.motions import Kinematics
from fault_tolerance.kernel.scratch import matrix, vector
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import LARGEST_SPEED, NEGLIGIBLE_RATE, SAME_COMMAND


class Priority(NamedTuple):
    """A task velocity resolved by priority.

    ``first`` and ``second`` (n,) are the parts of the reduced rates that serve the major and the
    secondary task; ``major`` (n, m) are the columns of J_m, which is decomposed in ``found``: its
    singular values are the transmissions, and the first ``driven`` directions are driven.
    """

    first: FloatArray
    second: FloatArray
    major: FloatArray
    found: Decomposition
    driven: int


class Within(NamedTuple):
    """A command within bounds: everything times ``scale``, the second part by ``share`` before.

    ``saturated`` (N,) is 1 for the actuators that would have crossed a bound.
    """

    scale: float
    share: float
    saturated: FloatArray


def asked_velocity(task: TaskRows, velocity: FloatArray, out: FloatArray) -> FloatArray:
    """Write a ``task`` ``velocity`` (l,) in m/s, a huge one brought down; return ``out``."""
    size = 0.0
    for i in range(len(velocity)):
        size = max(size, abs(velocity[i]))
    for i in range(len(velocity)):
        bounded = velocity[i]
        if size > LARGEST_SPEED:
            bounded = LARGEST_SPEED * (velocity[i] / size)
        out[i] = task.scale[task.rows[i]] * bounded
    return out


def prioritised(
    work: FloatArray,
    task: TaskRows,
    motions: FloatArray,
    asked: FloatArray,
    singular_below: float,
    poor_below: float,
) -> Priority:
    """Return the reduced rates of ``motions`` for a task velocity ``asked`` (l,): step 1.

    The velocity is of the ``task``, m/s. Transmissions up to ``singular_below``, and secondary
    ones up to ``poor_below`` of the best, are not driven. The results are parts of ``work``.
    """
    n, m, q = len(motions), len(task.major), len(task.secondary)
    first, second, wanted, driven = vector(work, n), vector(work, n), vector(work, m), 0
    major = columns_of(task, motions, task.major, False, matrix(work, n, m))
    found = decomposed(work, major)
    for c in range(n):
        second[c] = 0.0
        if found.sigma[c] > singular_below:
            driven += 1
    for i in range(m):
        wanted[i] = asked[task.major[i]]
    solved(found, driven, wanted, first)
    best = largest_of(found.sigma)
    rank = rank_of(found.sigma, max(1.0, best))
    if rank < n and q > 0:
        columns = columns_of(task, motions, task.secondary, False, matrix(work, n, q))
        least, missing = max(singular_below, poor_below * best), vector(work, q)
        for i in range(q):
            missing[i] = asked[task.secondary[i]] - along(columns, first, i)
        free = product(found.right, rank, columns, matrix(work, n - rank, q))
        other = decomposed(work, free)
        for k in range(n - rank):
            gain = other.sigma[k]
            if gain > least:
                share = dot(other.left[k], missing) * min(gain / least - 1.0, 1.0) / gain
                for d in range(n - rank):
                    part = share * other.right[k, d]
                    combined(1.0, second, part, found.right[rank + d], second)
    return Priority(first, second, major, found, driven)


def rate_bounds(
    drives: Drives, gain: float, values: FloatArray, lower: FloatArray, upper: FloatArray
) -> None:
    """Write the bounds (N,) of ``drives`` at joint ``values`` (N,), NaN where there is none.

    To ``lower`` and ``upper``. Towards an end of its stroke an actuator goes no faster than
    ``gain`` times the way left, so it arrives without a jolt; beyond an end it may only come back
    (a velocity damper, Faverjon and Tournassoud, ICRA 1987).
    """
    for j in range(len(values)):
        lower[j], upper[j] = -drives.speed[j], drives.speed[j]
        if isfinite(values[j]):
            lower[j] = -min(max(gain * (drives.low[j] + values[j]), 0.0), drives.speed[j])
            upper[j] = min(max(gain * (drives.high[j] - values[j]), 0.0), drives.speed[j])


def scaled_rates(
    drives: FloatArray, motions: FloatArray, reduced: FloatArray, scale: float, out: FloatArray
) -> FloatArray:
    """Write the rates (N,) of all actuators, in their units, for ``scale * reduced`` (n,).

    ``drives`` (N,) are metres per unit, ``motions`` (n, 6 + N) those of the reduced rates. Returns
    ``out``.
    """
    for j in range(len(drives)):
        # Adding zero turns -0.0 into 0.0.
        out[j] = scale * along(motions, reduced, 6 + j) / drives[j] + 0.0
    return out


def limited(
    work: FloatArray,
    drives: FloatArray,
    motions: FloatArray,
    first: FloatArray,
    second: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    scale: float,
) -> Within:
    """Return what is left of ``scale * (first + second)`` (n,) within bounds: step 3.

    ``lower`` and ``upper`` (N,) bound the rates; ``drives`` and ``motions`` as in `scaled_rates`.
    The result is part of ``work``.
    """
    n = len(drives)
    major = scaled_rates(drives, motions, first, scale, vector(work, n))
    other = scaled_rates(drives, motions, second, scale, vector(work, n))
    _clear_rounding(major)
    _clear_rounding(other)
    wanted = combined(1.0, major, 1.0, other, vector(work, n))
    _clear_rounding(wanted)
    saturated, crossing = vector(work, n), False
    for j in range(n):
        saturated[j] = 1.0 if wanted[j] < lower[j] or wanted[j] > upper[j] else 0.0
        crossing = crossing or saturated[j] != 0.0
    if not crossing:
        return Within(scale, 1.0, saturated)
    share = 1.0
    for j in range(n):
        if other[j] != 0.0:
            low, high = (lower[j] - major[j]) / other[j], (upper[j] - major[j]) / other[j]
            share = min(share, max(low, high))
    share = max(share, 0.0)
    excess = size = 0.0
    for j in range(n):
        rate = major[j] + share * other[j]
        excess = max(excess, lower[j] - rate, rate - upper[j])
        size = max(size, abs(rate))
    factor = 1.0
    if excess > NEGLIGIBLE_RATE * size:
        share = 0.0
        for j in range(n):
            bound = lower[j] if major[j] < 0.0 else upper[j]
            if abs(major[j]) > abs(bound):
                factor = min(factor, bound / major[j])
    return Within(scale * factor, share, saturated)


def _clear_rounding(rates: FloatArray) -> None:
    """Set to zero what is only rounding beside the largest of ``rates`` (N,)."""
    largest = 0.0
    for j in range(len(rates)):
        largest = max(largest, abs(rates[j]))
    for j in range(len(rates)):
        if not abs(rates[j]) > NEGLIGIBLE_RATE * largest:
            rates[j] = 0.0


def jump_between(
    m: Model, motions: FloatArray, reduced: FloatArray, sent: FloatArray, twist: FloatArray
) -> tuple[float, float]:
    """Return by how much ``reduced`` rates (n,) jump, m/s: major task, and norm of the drives.

    They are of ``motions`` of ``m``; ``sent`` (N,) and ``twist`` (6,) are the last command, in
    true units.
    """
    major = rates = 0.0
    for i in range(len(m.task.major)):
        row = m.task.rows[m.task.major[i]]
        major += (along(motions, reduced, row) - m.task.scale[row] * twist[row]) ** 2
    for j in range(len(sent)):
        rates += (along(motions, reduced, 6 + j) - m.drives.scale[j] * sent[j]) ** 2
    return sqrt(major), sqrt(rates)


def eased(
    m: Model,
    k: Kinematics,
    priority: Priority,
    goal: FloatArray,
    last: CommandArrays,
    allowed: float,
    out: FloatArray,
) -> bool:
    """Write the reduced rates on the way to ``goal`` (n,); return whether they are it: step 4.

    To ``out``. ``priority`` is what the task velocity has been resolved to by the kinematics
    ``k``. By ``allowed`` (m/s) the drives' speed may differ from the start, which is next to the
    ``last`` command.
    """
    n, work = len(goal), m.work
    start, missing = vector(work, n), vector(work, len(m.task.major))
    sent, scale, motions, driving = last.rates, m.drives.scale, k.motions, k.driving
    for c in range(n):
        start[c] = 0.0
        for j in range(len(sent)):
            start[c] += driving[j] * motions[c, 6 + j] * scale[j] * sent[j]
    for i in range(len(missing)):
        row = m.task.rows[m.task.major[i]]
        missing[i] = m.task.scale[row] * last.twist[row] - along(priority.major, start, i)
    nearest = solved(priority.found, priority.driven, missing, vector(work, n))
    combined(1.0, start, 1.0, nearest, start)
    way = combined(1.0, goal, -1.0, start, vector(work, n))
    distance = norm(way)
    if distance <= allowed + SAME_COMMAND * max(norm(goal), norm(start)):
        copied(goal, out)
        return True
    combined(1.0, start, allowed / distance, way, out)
    return False
