# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The first command with new kinematics that have been worked out before, compiled.

What `fault_tolerance.control.resolved_rate.TaskInverse.resolved` and
`fault_tolerance.control.transition.Transition.eased` do, far from singularities and limits.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from fault_tolerance.compiled.compiler import (
    COUNT,
    NUMBER,
    FloatArray,
    IntArray,
    compiled,
    counts,
    entry,
    numbers,
    results,
)
from fault_tolerance.compiled.resolving import within

_LARGEST_SPEED = 1e100
_ROUNDING = 1e-9


@compiled
def _applied(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return the product of a matrix (r, c) and a vector (c,)."""
    result = np.zeros(len(matrix))
    for i in range(len(matrix)):
        for j in range(len(vector)):
            result[i] += matrix[i, j] * vector[j]
    return result


@compiled
def _length(vector: FloatArray) -> float:
    total = 0.0
    for value in vector:
        total += value * value
    return sqrt(total)


@compiled
def _jumps(
    reduced: FloatArray, jacobian: FloatArray, rate_map: FloatArray, weights: FloatArray,
    major: IntArray, unit: float, sent_rates: FloatArray, sent_major: FloatArray,
) -> tuple[float, float]:
    """Return by how much the major velocity, and the rates, differ from the command before."""
    velocity, rates = _applied(jacobian, reduced), _applied(rate_map, reduced)
    first = second = 0.0
    for row in range(len(major)):
        first += (weights[major[row]] * velocity[major[row]] - sent_major[row]) ** 2
    for drive in range(len(rates)):
        second += (unit * (rates[drive] - sent_rates[drive])) ** 2
    return sqrt(first), sqrt(second)


@compiled
def _begin(
    major_inverse: FloatArray, secondary_inverse: FloatArray, jacobian: FloatArray,
    mapping: FloatArray, twist_jacobian: FloatArray, rate_map: FloatArray,
    left: FloatArray, sigma: FloatArray, right: FloatArray,
    weights: FloatArray, major: IntArray, unit: float, singular_below: float,
    speeds: FloatArray, ends: FloatArray, stroke_gain: float, mobility: int,
    values: FloatArray, velocity: FloatArray, sent_rates: FloatArray, sent_major: FloatArray,
    allowed: float, out: FloatArray,
) -> int:
    """Do what `begin` does, the parts of ``prepared`` one by one.

    Parameters
    ----------
    major_inverse, secondary_inverse : (n, l) array
        Reduced rates per task velocity.
    jacobian, mapping, twist_jacobian, rate_map : arrays
        See `fault_tolerance.kinematics.differential.DifferentialKinematics`.
    left, sigma, right : arrays
        Decomposition of the major rows times their weights.
    weights : (l,) array
        Turn task velocities into metres per second.
    major : int array
        Places of major coordinates in the task.
    unit : float
        Metres per second per unit of every drive.
    singular_below : float
        Smaller transmissions are not driven.
    speeds, ends, stroke_gain
        See `within`.
    mobility : int
        n.
    values, velocity : (N,), (l,) array
        Joint values, and what is asked for.
    sent_rates, sent_major : (N,), (m,) array
        The command before, and its major velocity in metres per second.
    allowed : float
        By how much the drives' speed may change, metres per second.
    """
    size = 0.0
    for value in velocity:
        size += abs(value)
    if not size <= _LARGEST_SPEED:
        return 0
    major_part = _applied(major_inverse, velocity)
    secondary_part = _applied(secondary_inverse, velocity)
    goal = major_part + secondary_part
    rates = _applied(rate_map, goal)
    if not (_length(rates) > 0.0 and within(rates, values, speeds, ends, stroke_gain)):
        return 0
    jumps = _jumps(goal, jacobian, rate_map, weights, major, unit, sent_rates, sent_major)
    kind = 1

    # In coordinates in which the drives' speed is a length.
    nearest = np.zeros(mobility)
    for i in range(mobility):
        for drive in range(len(sent_rates)):
            nearest[i] += unit * mapping[drive, i] * sent_rates[drive]
    asked = np.empty(len(major))
    for row in range(len(major)):
        asked[row] = sent_major[row]
        for i in range(mobility):
            asked[row] -= weights[major[row]] * jacobian[major[row], i] * nearest[i] / unit
    driven = 0
    for value in sigma:
        if value / unit > singular_below:
            driven += 1
    start = nearest.copy()
    for k in range(driven):
        share = 0.0
        for row in range(len(major)):
            share += left[row, k] * asked[row]
        for i in range(mobility):
            start[i] += right[k, i] * share * unit / sigma[k]
    way = unit * goal - start
    distance = _length(way)
    if not distance <= allowed + _ROUNDING * max(unit * _length(goal), _length(start)):
        reached = start + (allowed / distance) * way
        eased_major = np.zeros(mobility)
        for k in range(driven):
            share = 0.0
            for i in range(mobility):
                share += right[k, i] * reached[i]
            for i in range(mobility):
                eased_major[i] += share * right[k, i] / unit
        reduced = reached / unit
        eased = _applied(rate_map, reduced)
        if not within(eased, values, speeds, ends, stroke_gain):
            return 0
        eased_jumps = _jumps(
            reduced, jacobian, rate_map, weights, major, unit, sent_rates, sent_major
        )
        if not (
            eased_jumps[0] > (1.0 + _ROUNDING) * jumps[0] + 1e-15
            or eased_jumps[1] > (1.0 + _ROUNDING) * jumps[1] + 1e-15
        ):
            kind, goal, rates, jumps = 2, reduced, eased, eased_jumps
            major_part, secondary_part = eased_major, reduced - eased_major

    achieved = _applied(twist_jacobian, goal)
    at = 0
    for array in (rates, achieved, major_part, secondary_part):
        for value in array:
            out[at] = value
            at += 1
    out[at], out[at + 1] = jumps
    return kind


@entry(
    results(), counts(), COUNT, COUNT, NUMBER, NUMBER, NUMBER,
    numbers(1), numbers(1), numbers(1), numbers(1), NUMBER, results(),
)
def begin(
    prepared: FloatArray, major: IntArray, mobility: int, rank: int, unit: float,
    singular_below: float, stroke_gain: float,
    values: FloatArray, velocity: FloatArray, sent_rates: FloatArray, sent_major: FloatArray,
    allowed: float, out: FloatArray,
) -> int:
    """Write the first command into ``out``.

    Parameters
    ----------
    prepared : array
        One after the other, row by row: both parts of the inverse (n, l), the Jacobian of the task
        (l, n), the mapping (N, n), the Jacobian of the twist (6, n), the rates of all drives
        (N, n), the decomposition of the major rows times their weights ((m, k), (k,), (n, n)),
        the weights (l,), the largest speeds (N,) and the ends of the strokes (2, N). One array is
        found faster than a dozen.
    major : int array
        Places of major coordinates in the task.
    mobility, rank : int
        n and k.
    unit, singular_below, stroke_gain : float
    values, velocity : (N,), (l,) array
        Joint values, and what is asked for.
    sent_rates, sent_major : (N,), (m,) array
        The command before, and its major velocity in metres per second.
    allowed : float
        By how much the drives' speed may change, metres per second.
    out : (N + 6 + 2 n + 2,) array
        Takes rates, platform twist, the major and the secondary part of the reduced rates, and
        the jumps of major velocity and rates.

    Returns
    -------
    int
        1 if it is what it is to be, 2 if it is on the way there, 0 if the definition is to be
        asked instead.
    """
    drives, task, part = len(values), len(velocity), len(major)
    a = mobility * task
    b = a + mobility * task
    c = b + task * mobility
    d = c + drives * mobility
    e = d + 6 * mobility
    f = e + drives * mobility
    g = f + part * rank
    h = g + rank
    i = h + mobility * mobility
    j = i + task
    k = j + drives
    return _begin(
        prepared[:a].reshape((mobility, task)),
        prepared[a:b].reshape((mobility, task)),
        prepared[b:c].reshape((task, mobility)),
        prepared[c:d].reshape((drives, mobility)),
        prepared[d:e].reshape((6, mobility)),
        prepared[e:f].reshape((drives, mobility)),
        prepared[f:g].reshape((part, rank)),
        prepared[g:h],
        prepared[h:i].reshape((mobility, mobility)),
        prepared[i:j], major, unit, singular_below,
        prepared[j:k], prepared[k:].reshape((2, drives)), stroke_gain, mobility,
        values, velocity, sent_rates, sent_major, allowed, out,
    )
