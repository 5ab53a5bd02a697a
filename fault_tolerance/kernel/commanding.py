# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Entry point `command`: one command by the control law (`fault_tolerance.kernel.law`).

Too near a singularity it writes zeros and says why.
"""

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
from fault_tolerance.kernel.jacobians import norm_of_columns
from fault_tolerance.kernel.law import (
    actuator_rates,
    asked_velocity,
    limited,
    prioritised,
    rate_bounds,
)
from fault_tolerance.kernel.scratch import set_zero, vector
from fault_tolerance.kernel.small_matrices import axpby, copy_to, norm, weighted_sum
from fault_tolerance.kernel.transition import ease
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import OBSTACLE_BAND


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

    ``counts`` and ``numbers`` are the model (`model_of`), ``estimated`` is the estimate.
    ``readings`` (N,) are joint values from home, for the ends of strokes, NaN where there is none;
    ``velocity`` (l,) is rad/s and m/s, in the task's order. ``before`` is the last command,
    ``now`` the time (s), and ``changed`` says that the failures are not those of that command.
    """
    work[0] = 1.0
    m = model_of(counts, numbers, work)
    last = command_of(copy_to(before, vector(work, len(before))))
    e = estimate_of(m, copy_to(estimated, vector(work, len(estimated))))
    n, motions, scale = len(readings), e.motions, m.actuators.scale
    target = credible(readings, vector(work, n))
    asked = asked_velocity(m.task, velocity, vector(work, len(velocity)))
    priority = prioritised(work, m.task, motions, asked, m.law.singular_below)
    result = command_of(set_zero(out))
    facts = result.facts
    facts[at.MAJOR_JUMP] = last.facts[at.MAJOR_JUMP]
    facts[at.RATE_JUMP] = last.facts[at.RATE_JUMP]
    facts[at.UNDER_WAY] = last.facts[at.UNDER_WAY]
    facts[at.TIME] = now
    facts[at.FINITE] = 1.0
    facts[at.COMMANDED_MOBILITY] = len(motions)
    facts[at.GAIN] = norm_of_columns(motions, 0, 6)
    if 0 < len(m.task.major) <= len(motions):
        facts[at.TRANSMISSION] = priority.svd.sigma[len(m.task.major) - 1]
    margin = _check_margin(m, last, facts)
    if facts[at.OBSTACLE] != at.NO_OBSTACLE:
        return
    slowing = (margin - m.law.hold_below) / (m.law.slow_below - m.law.hold_below)
    slowing = min(max(slowing, 0.0), 1.0)
    facts[at.SLOWED] = 1.0 if slowing < 1.0 else 0.0
    lower, upper = vector(work, n), vector(work, n)
    rate_bounds(m.actuators, m.law.stroke_gain, target, lower, upper)
    factor, share = limited(
        work, scale, motions, priority.first, priority.second, slowing, lower, upper,
        result.saturated,
    )
    reduced = vector(work, len(motions))
    axpby(factor, priority.first, factor * share, priority.second, reduced)
    facts[at.SCALE], facts[at.SECONDARY_SCALE] = factor, share
    transition_starts = (
        changed
        or last.facts[at.MOVED] == 0.0
        or last.facts[at.COMMANDED_MOBILITY] != facts[at.COMMANDED_MOBILITY]
    )
    in_transition = transition_starts or last.facts[at.UNDER_WAY] != 0.0
    if isfinite(last.facts[at.TIME]) and in_transition:
        facts[at.UNDER_WAY] = 1.0
        if norm(actuator_rates(scale, motions, reduced, 1.0, vector(work, n))) > 0.0:
            ease(m, motions, e.driving, priority, reduced, lower, upper, last, transition_starts,
                 result)
    facts[at.MOVED] = 1.0
    actuator_rates(scale, motions, reduced, 1.0, result.rates)
    for i in range(6):
        result.twist[i] = weighted_sum(motions, reduced, i) / m.task.scale[i]
    facts[at.FINITE] = 1.0 if isfinite(norm(result.rates) + norm(result.twist)) else 0.0


def _check_margin(m: Model, last: CommandArrays, facts: FloatArray) -> float:
    """Return the margin from singularities (eq. 23), and write whether it is too small.

    Two count: how fast the major task moves, and how well the actuators hold the platform, each
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
