# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The first command with new kinematics that have been worked out before, compiled.

What `fault_tolerance.control.resolved_rate.TaskInverse.resolved` and
`fault_tolerance.control.transition.Transition.eased` do, far from singularities and limits.

It runs once in a long while, never from the processor's caches: what counts is that there is
little of it. So all that does not depend on the motion at that moment is worked out before, and
nothing is allocated.
"""

from __future__ import annotations

from math import sqrt

from fault_tolerance.compiled.compiler import (
    COUNT,
    NUMBER,
    FloatArray,
    compiled,
    entry,
    numbers,
    results,
)
from fault_tolerance.compiled.resolving import keeps_limits

_LARGEST_SPEED = 1e100
_ROUNDING = 1e-9


@compiled
def _add_product(
    prepared: FloatArray, at: int, rows: int, vector: FloatArray, first: int, columns: int,
    out: FloatArray, to: int,
) -> int:
    """Add a matrix in ``prepared`` times a part of ``vector``; return where the matrix ends."""
    for row in range(to, to + rows):
        for column in range(first, first + columns):
            out[row] += prepared[at] * vector[column]
            at += 1
    return at


@compiled
def _length(part: FloatArray, first: int, count: int) -> float:
    total = 0.0
    for place in range(first, first + count):
        total += part[place] ** 2
    return sqrt(total)


@compiled
def _away(part: FloatArray, first: int, other: FloatArray) -> float:
    """Return how far the part from ``first`` on is from another vector."""
    total = 0.0
    for place in range(len(other)):
        total += (part[first + place] - other[place]) ** 2
    return sqrt(total)


@compiled
def _allowed(
    rates: FloatArray, first: int, values: FloatArray, prepared: FloatArray, at: int, gain: float
) -> bool:
    """Return whether the rates from ``first`` on keep the limits, prepared from ``at`` on."""
    drives = len(values)
    for drive in range(drives):
        place = at + drive
        if not keeps_limits(
            rates[first + drive], values[drive], prepared[place], prepared[place + drives],
            prepared[place + 2 * drives], gain,
        ):
            return False
    return True


@entry(
    numbers(1), COUNT, numbers(1), numbers(1), numbers(1), numbers(1), NUMBER, results(),
)
def begin(
    prepared: FloatArray, mobility: int, values: FloatArray, velocity: FloatArray,
    sent_rates: FloatArray, sent_major: FloatArray, allowed: float, out: FloatArray,
) -> int:
    """Write the first command into ``out``.

    Parameters
    ----------
    prepared : array
        One after the other, matrices row by row: metres per second per unit of every drive; the
        stroke gain; the largest speeds (N,) and the ends of the strokes (2, N), see
        `keeps_limits`; the major and the secondary part of the reduced rates per task velocity,
        (2 n, l); the reduced rates a transition begins with per rates (n, N) and major velocity
        (n, m) sent before; the projection on those that drive the major task (n, n); and what
        reduced rates come to, (N + 6 + m, n): rates of all drives, the platform's twist, and the
        major velocity in metres per second.
    mobility : int
        n.
    values, velocity : (N,), (l,) array
        Joint values, and what is asked for.
    sent_rates, sent_major : (N,), (m,) array
        The command before, and its major velocity in metres per second.
    allowed : float
        By how much the drives' speed may change, metres per second.
    out : (3 (N + 6) + 2 m + 4 n + 2,) array
        Takes rates, platform twist, both parts of the reduced rates, and by how much major
        velocity and rates differ from the command before, in metres per second. What comes after
        is of no meaning.

    Returns
    -------
    int
        1 if it is what it is to be, 2 if it is on the way there, 0 if the definition is to be
        asked instead.
    """
    drives, task, part = len(values), len(velocity), len(sent_major)
    effects = drives + 6 + part
    limits = 2
    maps = limits + 3 * drives
    size = maps + mobility * (2 * task + drives + part + mobility + effects)
    # Places in what is written.
    major = drives + 6
    jumps = major + 2 * mobility
    goal = jumps + 2
    start = goal + mobility
    goes = start + mobility
    comes = goes + effects
    if len(prepared) != size or len(out) != comes + effects:
        return 0
    asked = 0.0
    for number in velocity:
        asked += abs(number)
    if not asked <= _LARGEST_SPEED:
        return 0

    for place in range(len(out)):
        out[place] = 0.0
    unit, gain = prepared[0], prepared[1]
    at = _add_product(prepared, maps, 2 * mobility, velocity, 0, task, out, major)
    at = _add_product(prepared, at, mobility, sent_rates, 0, drives, out, start)
    at = _add_product(prepared, at, mobility, sent_major, 0, part, out, start)
    driving = at
    last = driving + mobility * mobility
    distance = 0.0
    for i in range(mobility):
        out[goal + i] = out[major + i] + out[major + mobility + i]
        distance += (out[goal + i] - out[start + i]) ** 2
    distance = unit * sqrt(distance)
    _add_product(prepared, last, effects, out, goal, mobility, out, goes)
    if not (
        _length(out, goes, drives) > 0.0 and _allowed(out, goes, values, prepared, limits, gain)
    ):
        return 0
    major_jump = _away(out, goes + drives + 6, sent_major)
    rate_jump = unit * _away(out, goes, sent_rates)
    kind, chosen = 1, goes
    longest = unit * max(_length(out, goal, mobility), _length(out, start, mobility))
    if not distance <= allowed + _ROUNDING * longest:
        for i in range(mobility):
            out[start + i] += allowed / distance * (out[goal + i] - out[start + i])
        _add_product(prepared, last, effects, out, start, mobility, out, comes)
        if not _allowed(out, comes, values, prepared, limits, gain):
            return 0
        eased_major_jump = _away(out, comes + drives + 6, sent_major)
        eased_rate_jump = unit * _away(out, comes, sent_rates)
        if not (
            eased_major_jump > (1.0 + _ROUNDING) * major_jump + 1e-15
            or eased_rate_jump > (1.0 + _ROUNDING) * rate_jump + 1e-15
        ):
            kind, chosen = 2, comes
            major_jump, rate_jump = eased_major_jump, eased_rate_jump
            for i in range(mobility):
                out[major + i] = 0.0
            _add_product(prepared, driving, mobility, out, start, mobility, out, major)
            for i in range(mobility):
                out[major + mobility + i] = out[start + i] - out[major + i]
    for place in range(major):
        out[place] = out[chosen + place]
    out[jumps], out[jumps + 1] = major_jump, rate_jump
    return kind
