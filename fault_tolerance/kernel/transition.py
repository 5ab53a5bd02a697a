# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From one way of moving to another at limited acceleration: step 4 of the control law (`law`)."""

from math import sqrt

from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import CommandArrays, Model
from fault_tolerance.kernel.law import Priority, limited
from fault_tolerance.kernel.scratch import set_zero, vector
from fault_tolerance.kernel.small_matrices import (
    axpby,
    copy_to,
    dot,
    norm,
    pseudo_solve,
    weighted_sum,
)
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import NEGLIGIBLE_RATE, SAME_COMMAND


def ease(
    m: Model,
    motions: FloatArray,
    driving: FloatArray,
    priority: Priority,
    reduced: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    last: CommandArrays,
    starts: bool,
    result: CommandArrays,
) -> None:
    """Bring ``reduced`` rates (n,) back to what the transition allows, in place.

    They are of ``motions``, with the actuators that are ``driving`` (N,), and serve the task
    velocity of ``priority``; ``lower`` and ``upper`` (N,) bound the actuators. ``last`` is the
    command before. Writes to ``result`` whether the transition is under way, what it saturates,
    and if it ``starts`` now or from rest, the jumps.
    """
    facts, n, scale, work = result.facts, len(reduced), m.actuators.scale, m.work
    start, missing = set_zero(vector(work, n)), vector(work, len(m.task.major))
    for c in range(n):
        for j in range(len(scale)):
            start[c] += driving[j] * motions[c, 6 + j] * scale[j] * last.rates[j]
    for i in range(len(missing)):
        row = m.task.rows[m.task.major[i]]
        missing[i] = m.task.scale[row] * last.twist[row] - weighted_sum(priority.major, start, i)
    nearest = pseudo_solve(priority.svd, priority.driven, missing, vector(work, n))
    axpby(1.0, start, 1.0, nearest, start)
    path = axpby(1.0, reduced, -1.0, start, vector(work, n))
    distance = norm(path)
    # The largest change of the rate norm in this cycle.
    seconds = max(facts[at.TIME] - last.facts[at.TIME], 0.0)
    allowed = m.law.transition_acceleration * seconds
    jump = _jump(m, motions, reduced, last)
    easing_done = distance <= allowed + SAME_COMMAND * max(norm(reduced), norm(start))
    if not easing_done:
        reached = axpby(1.0, start, allowed / distance, path, vector(work, n))
        major, saturated = set_zero(vector(work, n)), vector(work, len(scale))
        for k in range(priority.driven):
            direction = priority.svd.right[k]
            axpby(1.0, major, dot(direction, reached), direction, major)
        other = axpby(1.0, reached, -1.0, major, vector(work, n))
        factor, share = limited(
            work, scale, motions, major, other, 1.0, lower, upper, saturated
        )
        axpby(factor, major, factor * share, other, reached)
        smaller = _jump(m, motions, reached, last)
        # Limits may have bent the path so that it jumps more than the goal: then it is no use.
        nothing = NEGLIGIBLE_RATE * (norm(reduced) + norm(reached))
        if _exceeds(smaller[0], jump[0], nothing) or _exceeds(smaller[1], jump[1], nothing):
            easing_done = True
        else:
            copy_to(reached, reduced)
            jump = smaller
            for j in range(len(saturated)):
                result.saturated[j] = max(result.saturated[j], saturated[j])
    facts[at.UNDER_WAY] = 0.0 if easing_done else 1.0
    if starts or norm(last.rates) == 0.0:
        facts[at.MAJOR_JUMP], facts[at.RATE_JUMP] = jump[0], jump[1]


def _jump(
    m: Model, motions: FloatArray, reduced: FloatArray, last: CommandArrays
) -> tuple[float, float]:
    """Return by how much ``reduced`` rates differ from the last command, m/s.

    In the major task, and in the rates of the actuators (norms).
    """
    major = rates = 0.0
    for i in range(len(m.task.major)):
        row = m.task.rows[m.task.major[i]]
        major += (weighted_sum(motions, reduced, row) - m.task.scale[row] * last.twist[row]) ** 2
    for j in range(len(last.rates)):
        sent = m.actuators.scale[j] * last.rates[j]
        rates += (weighted_sum(motions, reduced, 6 + j) - sent) ** 2
    return sqrt(major), sqrt(rates)


def _exceeds(one: float, other: float, nothing: float) -> bool:
    return one > (1.0 + SAME_COMMAND) * other + nothing
