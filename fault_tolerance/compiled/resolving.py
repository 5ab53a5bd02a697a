# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From the motions that the struts allow to actuator rates, compiled.

What `fault_tolerance.kinematics.differential.differential_kinematics` and
`fault_tolerance.control.resolved_rate.RateResolver` do where the drives determine every motion
and all count in one unit.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from fault_tolerance.compiled.compiler import (
    COUNT,
    FLAG,
    NUMBER,
    FloatArray,
    IntArray,
    compiled,
    counts,
    entry,
    numbers,
)
from fault_tolerance.compiled.small_matrices import decomposition
from fault_tolerance.tolerances import RANK_TOLERANCE, ROUNDING_TOLERANCE


@compiled
def _rank(sigma: FloatArray, scale: float) -> int:
    count = 0
    for value in sigma:
        if value > RANK_TOLERANCE * scale:
            count += 1
    return count


@compiled
def _size(matrix: FloatArray) -> float:
    total = 0.0
    for value in matrix.flat:
        total += value * value
    return sqrt(total)


@compiled
def _product(left: FloatArray, right: FloatArray) -> FloatArray:
    result = np.zeros((left.shape[0], right.shape[1]))
    for i in range(left.shape[0]):
        for k in range(left.shape[1]):
            for j in range(right.shape[1]):
                result[i, j] += left[i, k] * right[k, j]
    return result


@entry(
    numbers(2), numbers(2), counts(), COUNT, counts(), counts(), NUMBER, numbers(1), counts(),
    counts(), numbers(1), FLAG, numbers(2), numbers(1), numbers(2),
)
def reconfigure(
    twists: FloatArray, held_rates: FloatArray, held: IntArray, count: int, stuck: IntArray,
    driving: IntArray, unit: float, weights: FloatArray, task: IntArray, major: IntArray,
    major_weights: FloatArray, known: bool, left: FloatArray, gains: FloatArray,
    right: FloatArray,
) -> tuple[Any, ...]:
    """Return J and T with failures present (Theorem 1).

    Parameters
    ----------
    twists : (6, b) array
        The scaled twists that the structure allows.
    held_rates : (h, b) array
        The rates of attached struts' drives along them.
    held, stuck, driving : int arrays
        Places of attached, stuck and driving drives.
    count : int
        How many drives there are.
    unit : float
        Metres per second per unit of every drive.
    weights : (6,) array
        The scaled twist is this times the twist.
    task, major : int arrays
        Places in the twist of the task's coordinates, and in these of the major ones.
    major_weights : (m,) array
        Their metric.
    known : bool
        Whether ``left``, ``gains`` and ``right`` are the decomposition of the driving rates.

    Returns
    -------
    sound : bool
        False: the definition is to be asked instead.
    further
        Jacobian of the task, mapping, Jacobian of the twist, rates of all drives, and the major
        Jacobian decomposed (3 arrays).
    """
    rates = np.zeros((count, held_rates.shape[1]))
    for place in range(len(held)):
        for j in range(held_rates.shape[1]):
            rates[held[place], j] = held_rates[place, j]
    scale = max(1.0, unit * _size(rates))
    basis = twists.copy()
    if len(stuck):
        locked = np.empty((len(stuck), rates.shape[1]))
        for place in range(len(stuck)):
            for j in range(rates.shape[1]):
                locked[place, j] = unit * rates[stuck[place], j]
        _, sigma, directions = decomposition(locked)
        unlocked = directions[_rank(sigma, scale):].T
        basis, rates = _product(basis, unlocked), _product(rates, unlocked)
        for drive in stuck:
            for j in range(rates.shape[1]):
                rates[drive, j] = 0.0
    width = rates.shape[1]
    if known:
        turned, sigma, mixed = left.copy(), gains.copy(), right.copy()
    else:
        moved = np.empty((len(driving), width))
        for place in range(len(driving)):
            for j in range(width):
                moved[place, j] = rates[driving[place], j]
        turned, sigma, mixed = decomposition(moved)
    sound = _rank(sigma, scale) == width
    per_rate = np.zeros((width, width))
    if sound:
        for i in range(width):
            for j in range(width):
                per_rate[i, j] = mixed[j, i] / sigma[j]
    scaled = _product(basis, per_rate)
    rate_map = _product(rates, per_rate)
    mapping = np.zeros((count, width))
    if sound:
        for place in range(len(driving)):
            for j in range(width):
                mapping[driving[place], j] = rate_map[driving[place], j] = turned[place, j]
    # Rows that are only rounding are none (`_without_noise`).
    squares = np.zeros(6)
    for i in range(6):
        for j in range(width):
            squares[i] += scaled[i, j] ** 2
    least = ROUNDING_TOLERANCE**2 * max((unit * _size(mapping)) ** 2, squares.sum())
    for i in range(6):
        for j in range(width):
            scaled[i, j] = 0.0 if squares[i] <= least else scaled[i, j] / weights[i]
    jacobian = np.empty((len(task), width))
    for i in range(len(task)):
        for j in range(width):
            jacobian[i, j] = scaled[task[i], j]
    weighted = np.empty((len(major), width))
    for i in range(len(major)):
        for j in range(width):
            weighted[i, j] = major_weights[i] * jacobian[major[i], j]
    first, transmissions, second = decomposition(weighted)
    return sound, jacobian, mapping, scaled, rate_map, first, transmissions, second


@entry(
    numbers(2), numbers(2), numbers(1), numbers(2), numbers(1), counts(), counts(), NUMBER, NUMBER,
    NUMBER,
)
def invert_task(
    jacobian: FloatArray, left: FloatArray, sigma: FloatArray, right: FloatArray,
    weights: FloatArray, major: IntArray, secondary: IntArray, unit: float,
    singular_below: float, poor_below: float,
) -> tuple[FloatArray, FloatArray, int]:
    """Return what resolves task velocities: reduced rates per task velocity, in two parts.

    Parameters
    ----------
    jacobian : (l, n) array
    left, sigma, right : arrays
        Decomposition of its major rows times their weights.
    weights : (l,) array
        Turn task velocities into metres per second.
    major, secondary : int arrays
        Places of these coordinates in the task.
    unit : float
        Metres per second per unit of every drive.
    singular_below, poor_below : float
        See `fault_tolerance.control.resolved_rate`.

    Returns
    -------
    parts : two (n, l) arrays
    driven : int
        Directions of the major task that can be followed.
    """
    task, width = jacobian.shape
    first, second = np.zeros((width, task)), np.zeros((width, task))
    driven = 0
    for value in sigma:
        if value / unit > singular_below:
            driven += 1
    for k in range(driven):
        for i in range(width):
            for j in range(len(major)):
                first[i, major[j]] += right[k, i] * left[j, k] * weights[major[j]] / sigma[k]
    best = sigma[0] / unit if len(sigma) else 0.0
    rank = _rank(sigma, unit * max(1.0, best))
    if rank < width and len(secondary):
        free = right[rank:].T
        rows = np.empty((len(secondary), width))
        for i in range(len(secondary)):
            for j in range(width):
                rows[i, j] = weights[secondary[i]] * jacobian[secondary[i], j] / unit
        missing = np.zeros((len(secondary), task))
        spent = _product(rows, first)
        for i in range(len(secondary)):
            for j in range(task):
                missing[i, j] = -unit * spent[i, j]
            missing[i, secondary[i]] += weights[secondary[i]]
        least = max(singular_below, poor_below * best)
        turned, gains, mixed = decomposition(_product(rows, free))
        inverse = np.zeros((free.shape[1], len(secondary)))
        for k in range(len(gains)):
            if gains[k] > least:
                factor = min(gains[k] / least - 1.0, 1.0) / gains[k]
                for i in range(free.shape[1]):
                    for j in range(len(secondary)):
                        inverse[i, j] += mixed[k, i] * factor * turned[j, k]
        found = _product(_product(free, inverse), missing)
        for i in range(width):
            for j in range(task):
                second[i, j] = found[i, j] / unit
    return first, second, driven


@compiled
def keeps_limits(
    rate: float, value: float, speed: float, low: float, high: float, stroke_gain: float
) -> bool:
    """Return whether the rate of a drive keeps its limits at its joint value.

    Parameters
    ----------
    rate, value : float
    speed : float
        The largest.
    low, high : float
        From home to the ends of the stroke, both counted outwards.
    stroke_gain : float
        See `fault_tolerance.control.limits.rate_bounds`.
    """
    down = up = speed
    if np.isfinite(value):
        down = min(max(stroke_gain * (low + value), 0.0), speed)
        up = min(max(stroke_gain * (high - value), 0.0), speed)
    return -down <= rate <= up


@entry(numbers(1), numbers(1), numbers(1), numbers(2), NUMBER)
def within(
    rates: FloatArray, values: FloatArray, speeds: FloatArray, ends: FloatArray,
    stroke_gain: float,
) -> bool:
    """Return whether rates (N,) keep all limits at the joint values (N,).

    See `fault_tolerance.control.limits.rate_bounds`.
    """
    for drive in range(len(rates)):
        if not keeps_limits(
            rates[drive], values[drive], speeds[drive], ends[0, drive], ends[1, drive],
            stroke_gain,
        ):
            return False
    return True
