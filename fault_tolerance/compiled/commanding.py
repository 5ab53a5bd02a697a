# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From joint values and a task velocity to actuator rates, compiled as one.

All that a command needs where nothing is out of the ordinary: the same failures as before, the
same number of freedoms, far from singularities and limits. Everything found on the way is written
into one array, to be looked at when the command is on its way.
"""

from __future__ import annotations

from math import sqrt

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
    flags,
    numbers,
    results,
)
from fault_tolerance.compiled.following import follow, kept_constraints
from fault_tolerance.compiled.resolving import invert_task, reconfigure, within
from fault_tolerance.tolerances import CLOSURE_TOLERANCE, RANK_TOLERANCE

_LARGEST_SPEED = 1e100


@compiled
def _store(out: FloatArray, start: int, array: FloatArray) -> int:
    """Write ``array`` into ``out`` from ``start`` on; return where it ends."""
    for value in array.flat:
        out[start] = value
        start += 1
    return start


@entry(
    numbers(3), counts(), numbers(2), numbers(3), numbers(1), counts(), counts(), numbers(1),
    numbers(1), NUMBER,
    flags(), counts(), counts(), counts(),
    NUMBER, NUMBER, NUMBER, NUMBER,
    numbers(1), counts(), counts(), counts(), numbers(1), NUMBER, NUMBER, NUMBER,
    numbers(1), numbers(2), NUMBER,
    counts(), counts(), FLAG, NUMBER, NUMBER, NUMBER,
    COUNT, COUNT,
    numbers(2), numbers(2), numbers(2), numbers(3), numbers(2), numbers(2), numbers(2), numbers(2),
    numbers(1), numbers(1), results(),
)
def command(
    screws: FloatArray, lengths: IntArray, sizes: FloatArray, filling: FloatArray,
    origin: FloatArray, struts: IntArray, places: IntArray, drive_sizes: FloatArray,
    most: FloatArray, length: float,
    attached: FloatArray, held: IntArray, in_use: IntArray, owners: IntArray,
    yielding: float, shortest: float, farthest: float, compliance: float,
    twist_scale: FloatArray, task: IntArray, major: IntArray, secondary: IntArray,
    weights: FloatArray, unit: float, singular_below: float, poor_below: float,
    speeds: FloatArray, ends: FloatArray, stroke_gain: float,
    stuck: IntArray, driving: IntArray, all_drive: bool, yardstick: float, tight: float,
    least: float,
    kept: int, mobility: int,
    pose: FloatArray, values: FloatArray, openings: FloatArray, joints: FloatArray,
    structure: FloatArray, closing: FloatArray, drives: FloatArray, fit: FloatArray,
    target: FloatArray, velocity: FloatArray, out: FloatArray,
) -> tuple[int, int]:
    """Write the command, and all that is found on the way, into ``out``.

    The parameters are those of `follow`, `reconfigure`, `invert_task` and `within`, and:

    Parameters
    ----------
    yielding, compliance : float
        Structural constraints up to the first are absorbed while loops are closed, up to the
        second in the kinematics; here both must absorb the same ones.
    most : (4,) array
        The last: metres by which readings may contradict each other.
    yardstick, tight, least : float
        What margins are measured by, and the smallest with which nothing is slowed down
        (`fault_tolerance.control.command`).
    kept, mobility : int
        Constraints and freedoms before, which must be the same here.
    target : (N,) array
        Joint values.
    velocity : (l,) array
        What is asked for.
    out : array
        As large as `fault_tolerance.control.shortcut` makes it.

    Returns
    -------
    steps : int
        Towards the configuration; 0: something is out of the ordinary, and nothing has been
        written but rubbish.
    driven : int
        Directions of the major task that can be followed.
    """
    size = 0.0
    for value in velocity:
        size += abs(value)
    if not size <= _LARGEST_SPEED:
        return 0, 0
    (
        steps, new_pose, new_values, reached, new_openings, new_joints, all_rows, new_drives,
        left, sigma, right, twists, free, turned, gains, mixed, new_closing, new_fit,
        outside, along,
    ) = follow(
        screws, lengths, sizes, filling, origin, struts, places, drive_sizes, most, length,
        attached, held, in_use, owners,
        pose, values, openings, joints, structure, closing, drives, fit,
        target, kept, yielding, shortest, farthest,
    )
    if steps == 0 or not outside <= CLOSURE_TOLERANCE:
        return 0, 0
    if kept_constraints(sigma, compliance) != kept:
        return 0, 0
    for place in range(len(held)):
        drive = held[place]
        if not abs(target[drive] - reached[drive]) * unit <= most[3]:
            return 0, 0
    major_weights = np.empty(len(major))
    for row in range(len(major)):
        major_weights[row] = weights[major[row]]
    sound, jacobian, mapping, twist_jacobian, rate_map, first, transmissions, second = reconfigure(
        twists, free, held, len(struts), stuck, driving, unit, twist_scale, task, major,
        major_weights, all_drive, turned, gains, mixed,
    )
    if not sound or mapping.shape[1] != mobility or len(transmissions) < len(major):
        return 0, 0
    total = weighted = 0.0
    for row in range(6):
        for column in range(mobility):
            total += twist_jacobian[row, column] ** 2
            weighted += (twist_scale[row] * twist_jacobian[row, column]) ** 2
    weakest = transmissions[len(major) - 1]
    if not weakest > RANK_TOLERANCE * max(1.0, twist_scale[0]) * sqrt(total):
        return 0, 0
    looseness = sqrt(weighted) / unit
    if not (
        weakest / unit / yardstick >= least and tight >= least * looseness
    ):
        return 0, 0
    majors, secondaries, driven = invert_task(
        jacobian, first, transmissions, second, weights, major, secondary, unit, singular_below,
        poor_below,
    )
    major_part, secondary_part = np.zeros(mobility), np.zeros(mobility)
    rates, achieved = np.zeros(len(struts)), np.zeros(6)
    for i in range(mobility):
        for j in range(len(velocity)):
            major_part[i] += majors[i, j] * velocity[j]
            secondary_part[i] += secondaries[i, j] * velocity[j]
        for drive in range(len(struts)):
            rates[drive] += rate_map[drive, i] * (major_part[i] + secondary_part[i])
        for row in range(6):
            achieved[row] += twist_jacobian[row, i] * (major_part[i] + secondary_part[i])
    if not within(rates, target, speeds, ends, stroke_gain):
        return 0, 0
    end = _store(out, 0, rates)
    end = _store(out, end, achieved)
    end = _store(out, end, major_part)
    end = _store(out, end, secondary_part)
    end = _store(out, end, majors)
    end = _store(out, end, secondaries)
    end = _store(out, end, jacobian)
    end = _store(out, end, mapping)
    end = _store(out, end, twist_jacobian)
    end = _store(out, end, rate_map)
    end = _store(out, end, first)
    end = _store(out, end, transmissions)
    end = _store(out, end, second)
    end = _store(out, end, new_pose)
    end = _store(out, end, new_values)
    end = _store(out, end, reached)
    end = _store(out, end, new_openings)
    end = _store(out, end, new_joints)
    end = _store(out, end, all_rows)
    end = _store(out, end, new_drives)
    end = _store(out, end, left)
    end = _store(out, end, sigma)
    end = _store(out, end, right)
    end = _store(out, end, twists)
    end = _store(out, end, free)
    end = _store(out, end, turned)
    end = _store(out, end, gains)
    end = _store(out, end, mixed)
    end = _store(out, end, new_closing)
    end = _store(out, end, new_fit)
    out[end], out[end + 1], out[end + 2] = outside, along, looseness
    return steps, driven
