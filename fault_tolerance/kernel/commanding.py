# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""One command by the control law (`fault_tolerance.kernel.law`), from an estimate.

`command` is called from outside. Too near a singularity it writes zeros and says why.
"""

from __future__ import annotations

from math import isfinite

from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import (
    CommandArrays,
    Model,
    command_of,
    credible,
    estimate_of,
    model_of,
)
from fault_tolerance.kernel.jacobi_svd import along, combined, copied, dot, norm
from fault_tolerance.kernel.law import (
    Priority,
    asked_velocity,
    eased,
    jump_between,
    limited,
    prioritised,
    rate_bounds,
    scaled_rates,
)
from fault_tolerance.kernel.motions import Kinematics, size_of
from fault_tolerance.kernel.scratch import vector
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import NEGLIGIBLE_RATE, OBSTACLE_BAND, SAME_COMMAND


def command(
    counts: IntArray,
    numbers: FloatArray,
    estimated: FloatArray,
    readings: FloatArray,
    velocity: FloatArray,
    before: FloatArray,
    now: float,
    changed: bool,
    out: FloatArray,
    work: FloatArray,
) -> None:
    """Write the rates that serve a task velocity (`CommandArrays`); see `kernel.law`.

    Parameters
    ----------
    counts, numbers : arrays
        The model, see `model_of`.
    estimated : array
        The estimate to go by.
    readings : (N,) array
        Joint values from home, for the ends of strokes; NaN where there is none.
    velocity : (l,) array
        Task velocity, rad/s and m/s, in the task's order.
    before : array
        The last command.
    now : float
        Seconds.
    changed : bool
        Whether the failures are not those of the last command.
    out : array
        Of `command_size`.
    work : array
        Of `workspace_size`.
    """
    work[0] = 1.0
    m = model_of(counts, numbers, work)
    last = command_of(copied(before, vector(work, len(before))))
    e = estimate_of(m, copied(estimated, vector(work, len(estimated))))
    n, target = len(readings), credible(readings, vector(work, len(readings)))
    kinematics = Kinematics(e.motions, e.driving, 0)
    asked = asked_velocity(m.task, velocity, vector(work, len(velocity)))
    priority = prioritised(
        work, m.task, e.motions, asked, m.law.singular_below, m.law.poor_below
    )
    for i in range(len(out)):
        out[i] = 0.0
    result = command_of(out)
    facts = result.facts
    facts[at.MAJOR_JUMP], facts[at.RATE_JUMP] = last.facts[at.MAJOR_JUMP], last.facts[at.RATE_JUMP]
    facts[at.TIME], facts[at.UNDER_WAY], facts[at.FINITE] = now, last.facts[at.UNDER_WAY], 1.0
    facts[at.COMMANDED_MOBILITY], facts[at.DRIVEN] = len(e.motions), priority.driven
    facts[at.GAIN] = size_of(e.motions, 0, 6)
    if len(m.task.major) <= len(e.motions) and len(m.task.major) > 0:
        facts[at.TRANSMISSION] = priority.found.sigma[len(m.task.major) - 1]
    margin = _margin(m, last, facts)
    if facts[at.OBSTACLE] != at.NO_OBSTACLE:
        return
    slowing = (margin - m.law.hold_below) / (m.law.slow_below - m.law.hold_below)
    slowing = min(max(slowing, 0.0), 1.0)
    facts[at.SLOWED] = 1.0 if slowing < 1.0 else 0.0
    lower, upper = vector(work, n), vector(work, n)
    rate_bounds(m.drives, m.law.stroke_gain, target, lower, upper)
    goal = limited(
        work, m.drives.scale, e.motions, priority.first, priority.second, lower, upper, slowing
    )
    reduced = vector(work, len(e.motions))
    combined(goal.scale, priority.first, goal.scale * goal.share, priority.second, reduced)
    facts[at.SCALE], facts[at.SECONDARY_SCALE] = goal.scale, goal.share
    copied(goal.saturated, result.saturated)
    begins = changed or last.facts[at.MOVED] == 0.0
    begins = begins or last.facts[at.COMMANDED_MOBILITY] != facts[at.COMMANDED_MOBILITY]
    if isfinite(last.facts[at.TIME]) and (begins or last.facts[at.UNDER_WAY] != 0.0):
        facts[at.UNDER_WAY] = 1.0
        wanted = scaled_rates(m.drives.scale, e.motions, reduced, 1.0, vector(work, n))
        if norm(wanted) > 0.0:
            _ease(m, kinematics, priority, reduced, lower, upper, last, result, begins)
    facts[at.MOVED] = 1.0
    scaled_rates(m.drives.scale, e.motions, reduced, 1.0, result.rates)
    for i in range(6):
        result.twist[i] = along(e.motions, reduced, i) / m.task.scale[i]
    facts[at.FINITE] = 1.0 if isfinite(norm(result.rates) + norm(result.twist)) else 0.0


def _margin(m: Model, last: CommandArrays, facts: FloatArray) -> float:
    """Return the margin from singularities (eq. 23), and write whether it is too small.

    Two count: how fast the major task moves, and how well the drives hold the platform, each
    relative to home. Motion begins again only `OBSTACLE_BAND` above the margin it ended at.
    """
    moves, held = facts[at.TRANSMISSION] / m.law.home_transmission, 1.0
    if facts[at.GAIN] > m.law.home_gain:
        held = m.law.home_gain / facts[at.GAIN]
    limit = m.law.hold_below
    if last.facts[at.OBSTACLE] != at.NO_OBSTACLE:
        limit *= OBSTACLE_BAND
    facts[at.OBSTACLE] = at.NO_OBSTACLE
    if moves <= limit:
        facts[at.OBSTACLE] = at.HARDLY_MOVES
    elif held <= limit:
        facts[at.OBSTACLE] = at.HARDLY_HELD
    return min(moves, held)


def _ease(
    m: Model,
    kinematics: Kinematics,
    priority: Priority,
    reduced: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    last: CommandArrays,
    result: CommandArrays,
    begins: bool,
) -> None:
    """Bring ``reduced`` rates back to what the transition allows, and write how far it is."""
    facts, n, motions = result.facts, len(reduced), kinematics.motions
    allowed = m.law.max_acceleration * max(facts[at.TIME] - last.facts[at.TIME], 0.0)
    reached = vector(m.work, n)
    arrived = eased(m, kinematics, priority, reduced, last, allowed, reached)
    jump = jump_between(m, motions, reduced, last.rates, last.twist)
    if not arrived:
        major = vector(m.work, n)
        for c in range(n):
            major[c] = 0.0
        for k in range(priority.driven):
            direction = priority.found.right[k]
            combined(1.0, major, dot(direction, reached), direction, major)
        other = combined(1.0, reached, -1.0, major, vector(m.work, n))
        within = limited(m.work, m.drives.scale, motions, major, other, lower, upper, 1.0)
        combined(within.scale, major, within.scale * within.share, other, reached)
        smaller = jump_between(m, motions, reached, last.rates, last.twist)
        # Limits may have bent the way so that it jumps more than the goal: then it is no use.
        nothing = NEGLIGIBLE_RATE * (norm(reduced) + norm(reached))
        if not (_exceeds(smaller[0], jump[0], nothing) or _exceeds(smaller[1], jump[1], nothing)):
            copied(reached, reduced)
            jump = smaller
            for j in range(len(within.saturated)):
                result.saturated[j] = max(result.saturated[j], within.saturated[j])
        else:
            arrived = True
    facts[at.UNDER_WAY] = 0.0 if arrived else 1.0
    if begins or norm(last.rates) == 0.0:
        facts[at.MAJOR_JUMP], facts[at.RATE_JUMP] = jump[0], jump[1]


def _exceeds(one: float, other: float, nothing: float) -> bool:
    return one > (1.0 + SAME_COMMAND) * other + nothing
