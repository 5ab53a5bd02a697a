# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The first command with new kinematics that have been worked out before, compiled.

What `fault_tolerance.control.resolved_rate.TaskInverse.resolved` and
`fault_tolerance.control.transition.Transition.eased` do, far from singularities and limits.

Where a transition is to lead, where it begins, and the way between are all linear in what is
asked for and what was sent before, so that one matrix gives everything. It runs once in a long
while, never from the processor's caches: what counts is that there is little of it.
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
def _speed(part: FloatArray, first: int, mobility: int) -> float:
    """Return the length of the reduced rates whose two parts begin at ``first``."""
    total = 0.0
    for place in range(first, first + mobility):
        total += (part[place] + part[place + mobility]) ** 2
    return sqrt(total)


@compiled
def _length(part: FloatArray, first: int, end: int) -> float:
    total = 0.0
    for place in range(first, end):
        total += part[place] ** 2
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
        One after the other: metres per second per unit of every drive; the stroke gain; the
        largest speeds (N,) and the ends of the strokes (2, N), see `keeps_limits`; and three
        matrices (s, l + N + m), row by row, for where the transition leads, where it begins, and
        the way between (both of them the major and the secondary part split alike). Each gives
        the s = 2 N + 6 + 2 n + m numbers of a command: rates (N,), the platform's twist (6,), the
        major (n,) and the secondary (n,) part of the reduced rates, and by how much the major
        velocity (m,) and the rates (N,) differ from the command before, in metres per second.
        They are applied to ``velocity``, ``sent_rates`` and ``sent_major``, one after the other.
    mobility : int
        n.
    values, velocity : (N,), (l,) array
        Joint values, and what is asked for.
    sent_rates, sent_major : (N,), (m,) array
        The command before, and its major velocity in metres per second.
    allowed : float
        By how much the drives' speed may change, metres per second.
    out : (3 s,) array
        Takes rates, platform twist, both parts of the reduced rates, and then the two lengths of
        the differences. What comes after is of no meaning.

    Returns
    -------
    int
        1 if it is what it is to be, 2 if it is on the way there, 0 if the definition is to be
        asked instead.
    """
    asked = 0.0
    for number in velocity:
        asked += abs(number)
    if not asked <= _LARGEST_SPEED:
        return 0
    drives, part = len(values), len(sent_major)
    unit, gain, limits = prepared[0], prepared[1], 2
    reduced = drives + 6
    jump = reduced + 2 * mobility
    size = jump + part + drives
    at = limits + 3 * drives
    for row in range(3 * size):
        total = 0.0
        for number in velocity:
            total += prepared[at] * number
            at += 1
        for number in sent_rates:
            total += prepared[at] * number
            at += 1
        for number in sent_major:
            total += prepared[at] * number
            at += 1
        out[row] = total
    if not (
        _length(out, 0, drives) > 0.0 and _allowed(out, 0, values, prepared, limits, gain)
    ):
        return 0
    major = _length(out, jump, jump + part)
    rates = _length(out, jump + part, size)
    kind = 1
    distance = unit * _speed(out, 2 * size + reduced, mobility)
    goal = unit * _speed(out, reduced, mobility)
    start = unit * _speed(out, size + reduced, mobility)
    if not distance <= allowed + _ROUNDING * max(goal, start):
        for place in range(size, 2 * size):
            out[place] += allowed / distance * out[place + size]
        if not _allowed(out, size, values, prepared, limits, gain):
            return 0
        eased_major = _length(out, size + jump, size + jump + part)
        eased_rates = _length(out, size + jump + part, 2 * size)
        if not (
            eased_major > (1.0 + _ROUNDING) * major + 1e-15
            or eased_rates > (1.0 + _ROUNDING) * rates + 1e-15
        ):
            kind, major, rates = 2, eased_major, eased_rates
            for place in range(jump):
                out[place] = out[size + place]
    out[jump], out[jump + 1] = major, rates
    return kind
