# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""One command by the control law (`fault_tolerance.kernel.law`), from an estimate.

`command` is called from outside. Too near a singularity it writes zeros and says why.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from fault_tolerance.kernel import model as at
from fault_tolerance.kernel.factorisation import combined, dot, frobenius, norm
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
from fault_tolerance.kernel.model import CommandArrays, Model, command_of, estimate_of, model_of
from fault_tolerance.kernel.motions import Kinematics
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
    """
    m = model_of(counts, numbers)
    last, target = command_of(before.copy()), readings.copy()
    e = estimate_of(m, estimated.copy())
    kinematics = Kinematics(e.jacobian, e.mapping, e.follow, 0)
    priority = prioritised(m.task, m.law, kinematics, asked_velocity(m.task, velocity))
    for i in range(len(out)):
        out[i] = 0.0
    result = command_of(out)
    facts = result.facts
    facts[at.MAJOR_JUMP], facts[at.RATE_JUMP] = last.facts[at.MAJOR_JUMP], last.facts[at.RATE_JUMP]
    facts[at.TIME], facts[at.UNDER_WAY] = now, last.facts[at.UNDER_WAY]
    facts[at.COMMANDED_MOBILITY] = kinematics.mapping.shape[1]
    facts[at.DRIVEN], facts[at.GAIN] = priority.driven, frobenius(kinematics.jacobian)
    facts[at.TRANSMISSION] = 0.0
    if len(priority.sigma) == len(m.task.major):
        facts[at.TRANSMISSION] = priority.sigma[len(m.task.major) - 1]
    margin = _margin(m, last, facts)
    if facts[at.OBSTACLE] != at.NO_OBSTACLE:
        return
    slowing = (margin - m.law.hold_below) / (m.law.slow_below - m.law.hold_below)
    slowing = min(max(slowing, 0.0), 1.0)
    facts[at.SLOWED] = 1.0 if slowing < 1.0 else 0.0
    lower, upper = rate_bounds(m.drives, m.law.stroke_gain, target)
    goal = limited(
        m.drives.scale, kinematics.follow, priority.first, priority.second, lower, upper, slowing
    )
    reduced = combined(
        goal.scale, priority.first, goal.scale * goal.share, priority.second
    )
    facts[at.SCALE], facts[at.SECONDARY_SCALE] = goal.scale, goal.share
    for j in range(len(target)):
        result.saturated[j] = goal.saturated[j]
    begins = changed or last.facts[at.MOVED] == 0.0
    begins = begins or last.facts[at.COMMANDED_MOBILITY] != facts[at.COMMANDED_MOBILITY]
    if isfinite(last.facts[at.TIME]) and (begins or last.facts[at.UNDER_WAY] != 0.0):
        facts[at.UNDER_WAY] = 1.0
        if norm(scaled_rates(m.drives.scale, kinematics.follow, reduced, 1.0)) > 0.0:
            reduced = _on_the_way(
                m, kinematics, priority, reduced, lower, upper, last, result, begins
            )
    facts[at.MOVED] = 1.0
    _send(m, kinematics, reduced, result)


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


def _on_the_way(
    m: Model,
    kinematics: Kinematics,
    priority: Priority,
    goal: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    last: CommandArrays,
    result: CommandArrays,
    begins: bool,
) -> FloatArray:
    """Return the reduced rates on the way to ``goal``, and write how far the transition is."""
    facts = result.facts
    allowed = m.law.max_acceleration * max(facts[at.TIME] - last.facts[at.TIME], 0.0)
    reached, arrived = eased(
        m.task, m.drives.scale, kinematics, priority, goal, last.rates, last.twist, allowed
    )
    jump = jump_between(m.task, m.drives.scale, kinematics, goal, last.rates, last.twist)
    chosen = goal
    if not arrived:
        major = np.zeros(len(goal))
        for k in range(priority.driven):
            share = dot(priority.right[k], reached)
            for c in range(len(major)):
                major[c] += share * priority.right[k, c]
        other = combined(1.0, reached, -1.0, major)
        within = limited(m.drives.scale, kinematics.follow, major, other, lower, upper, 1.0)
        reached = combined(within.scale, major, within.scale * within.share, other)
        smaller = jump_between(m.task, m.drives.scale, kinematics, reached, last.rates, last.twist)
        # Limits may have bent the way so that it jumps more than the goal: then it is no use.
        nothing = NEGLIGIBLE_RATE * (norm(goal) + norm(reached))
        if not (_exceeds(smaller[0], jump[0], nothing) or _exceeds(smaller[1], jump[1], nothing)):
            chosen, jump = reached, smaller
            for j in range(len(within.saturated)):
                result.saturated[j] = max(result.saturated[j], within.saturated[j])
        else:
            arrived = True
    facts[at.UNDER_WAY] = 0.0 if arrived else 1.0
    if begins or norm(last.rates) == 0.0:
        facts[at.MAJOR_JUMP], facts[at.RATE_JUMP] = jump[0], jump[1]
    return chosen


def _exceeds(one: float, other: float, nothing: float) -> bool:
    return one > (1.0 + SAME_COMMAND) * other + nothing


def _send(m: Model, kinematics: Kinematics, reduced: FloatArray, result: CommandArrays) -> None:
    """Write the rates and the twist of reduced rates (n,)."""
    rates = scaled_rates(m.drives.scale, kinematics.follow, reduced, 1.0)
    for j in range(len(rates)):
        result.rates[j] = rates[j]
    for i in range(6):
        result.twist[i] = dot(kinematics.jacobian[i], reduced) / m.task.scale[i]
