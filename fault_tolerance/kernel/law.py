# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The control law: from a task velocity to actuator rates within all limits.

With reduced rates x the platform moves by ``v = J^ x`` and the actuators by ``F x``, in metres per
second; F equals T^ for driven actuators, and free ones follow (docs/theory.md, section 7).

1. *Task priority* (`prioritised`). x serves the major task exactly where it can (least squares
   where not), and among all such x the secondary task as well as it can (eq. 22). Directions with
   a transmission (a singular value) of at most `singular_below` are not driven. Secondary ones
   below `POOR_BELOW` of the best major one are not either; they fade in up to twice that.
2. *Near singularities* (`commanding`) everything slows down, from the margin `slow_below` to 0 at
   `hold_below` (eq. 23).
3. *Limits* (`limited`). Rates stay within ``lower <= F x <= upper``: the largest share of the
   secondary part that fits, and if none does, the major part alone by the largest factor that
   fits.
4. *Transitions* (`transition`). After the kinematics have changed, and after a rest, x moves in a
   straight line, at limited acceleration, from the x that best reproduces the last command (major
   task exactly) to the new x. A command of zero is not eased: it stops at once.
"""

from math import isfinite
from typing import NamedTuple

from fault_tolerance.kernel.array_layout import Actuators, TaskRows
from fault_tolerance.kernel.failure_measures import columns_of
from fault_tolerance.kernel.scratch import matrix, set_zero, vector
from fault_tolerance.kernel.small_matrices import (
    Decomposition,
    axpby,
    count_above,
    decomposed,
    dot,
    largest_of,
    product,
    pseudo_solve,
    weighted_sum,
)
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import (
    LARGEST_SPEED,
    NEGLIGIBLE_RATE,
    POOR_BELOW,
    RANK_TOLERANCE,
)


class Priority(NamedTuple):
    """A task velocity resolved by priority.

    ``first`` and ``second`` (n,) are the parts of the reduced rates that serve the major and the
    secondary task; ``major`` (n, m) are the columns of J_m, and ``svd`` is its decomposition: the
    singular values are the transmissions, and the first ``driven`` directions are driven.
    """

    first: FloatArray
    second: FloatArray
    major: FloatArray
    svd: Decomposition
    driven: int


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
) -> Priority:
    """Return the reduced rates of ``motions`` for a task velocity ``asked`` (l,): step 1.

    The velocity is of the ``task``, m/s. Transmissions up to ``singular_below``, and secondary
    ones up to `POOR_BELOW` of the best, are not driven.
    """
    n, m, q = len(motions), len(task.major), len(task.secondary)
    first, second, wanted = vector(work, n), set_zero(vector(work, n)), vector(work, m)
    major = columns_of(task, motions, task.major, False, matrix(work, n, m))
    svd = decomposed(work, major)
    driven = count_above(svd.sigma, singular_below)
    for i in range(m):
        wanted[i] = asked[task.major[i]]
    pseudo_solve(svd, driven, wanted, first)
    best = largest_of(svd.sigma)
    rank = count_above(svd.sigma, RANK_TOLERANCE * max(1.0, best))
    if rank < n and q > 0:
        columns = columns_of(task, motions, task.secondary, False, matrix(work, n, q))
        least, missing = max(singular_below, POOR_BELOW * best), vector(work, q)
        for i in range(q):
            missing[i] = asked[task.secondary[i]] - weighted_sum(columns, first, i)
        free = product(svd.right, rank, columns, matrix(work, n - rank, q))
        other = decomposed(work, free)
        for k in range(n - rank):
            gain = other.sigma[k]
            if gain > least:
                share = dot(other.left[k], missing) * min(gain / least - 1.0, 1.0) / gain
                for d in range(n - rank):
                    part = share * other.right[k, d]
                    axpby(1.0, second, part, svd.right[rank + d], second)
    return Priority(first, second, major, svd, driven)


def rate_bounds(
    actuators: Actuators, gain: float, values: FloatArray, lower: FloatArray, upper: FloatArray
) -> None:
    """Write the bounds (N,) of ``actuators`` at joint ``values`` (N,), NaN where there is none.

    To ``lower`` and ``upper``. Towards an end of its stroke an actuator goes no faster than
    ``gain`` times the distance left, so it arrives without a jolt; beyond an end it may only come
    back (a velocity damper, Faverjon and Tournassoud, ICRA 1987).
    """
    speed, to_low, to_high = actuators.speed, actuators.to_low, actuators.to_high
    for j in range(len(values)):
        lower[j], upper[j] = -speed[j], speed[j]
        if isfinite(values[j]):
            lower[j] = -min(max(gain * (to_low[j] + values[j]), 0.0), speed[j])
            upper[j] = min(max(gain * (to_high[j] - values[j]), 0.0), speed[j])


def actuator_rates(
    scale: FloatArray, motions: FloatArray, reduced: FloatArray, factor: float, out: FloatArray
) -> FloatArray:
    """Write the rates (N,) of all actuators, in their units, for ``factor * reduced`` (n,).

    ``scale`` (N,) is metres per unit, ``motions`` (n, 6 + N) are those of the reduced rates.
    Returns ``out``.
    """
    for j in range(len(scale)):
        # Adding zero turns -0.0 into 0.0.
        out[j] = factor * weighted_sum(motions, reduced, 6 + j) / scale[j] + 0.0
    return out


def limited(
    work: FloatArray,
    scale: FloatArray,
    motions: FloatArray,
    first: FloatArray,
    second: FloatArray,
    slowing: float,
    lower: FloatArray,
    upper: FloatArray,
    saturated: FloatArray,
) -> tuple[float, float]:
    """Return the factor and share that put ``factor * (first + share * second)`` within bounds.

    Step 3, of the parts (n,) of reduced rates. The factor is at most ``slowing``. ``lower`` and
    ``upper`` (N,) bound the rates; ``scale`` and ``motions`` as in `actuator_rates`. Writes 1 to
    ``saturated`` (N,) for the actuators that would have crossed a bound.
    """
    n = len(scale)
    major = actuator_rates(scale, motions, first, slowing, vector(work, n))
    other = actuator_rates(scale, motions, second, slowing, vector(work, n))
    _zero_small_rates(major)
    _zero_small_rates(other)
    wanted = axpby(1.0, major, 1.0, other, vector(work, n))
    _zero_small_rates(wanted)
    crossing = False
    for j in range(n):
        saturated[j] = 1.0 if wanted[j] < lower[j] or wanted[j] > upper[j] else 0.0
        crossing = crossing or saturated[j] != 0.0
    if not crossing:
        return slowing, 1.0
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
    return slowing * factor, share


def _zero_small_rates(rates: FloatArray) -> None:
    """Set to zero what is only rounding beside the largest of ``rates`` (N,)."""
    largest = 0.0
    for j in range(len(rates)):
        largest = max(largest, abs(rates[j]))
    for j in range(len(rates)):
        if not abs(rates[j]) > NEGLIGIBLE_RATE * largest:
            rates[j] = 0.0
