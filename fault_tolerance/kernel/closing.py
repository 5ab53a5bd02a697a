# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Closing the loops at given readings: Gauss-Newton with chord steps, from a warm start.

The structural rows are solved first, along the directions the flexures do not absorb. What
freedom is left fits the readings by least squares, and the joints follow strut by strut
(docs/theory.md, section 3). The factorisations of one configuration serve for several steps
(chord steps); the last evaluation serves for the next estimate.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np

from fault_tolerance.kernel.elimination import Elimination, eliminated, joint_rates
from fault_tolerance.kernel.factorisation import (
    dot,
    frobenius,
    largest_of,
    norm,
    pseudo_inverse,
    rank_of,
    rows_of,
    svd,
)
from fault_tolerance.kernel.model import Model
from fault_tolerance.kernel.motions import (
    Structure,
    allowed_motions,
    holds,
    kept_constraints,
    structure_of,
)
from fault_tolerance.kernel.placement import displaced_pose, placed_struts
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import (
    CHORD_FIT,
    CHORD_REACH,
    CHORD_STEP,
    CLOSURE_TOLERANCE,
    LONGEST_STEP,
    STALLED,
)

MOST_FACTORISATIONS, MOST_CHORDS = 60, 4

class Location(NamedTuple):
    """A pose (4, 4), joint values (s, k), and what follows: openings (s, 6), factorised struts."""

    pose: FloatArray
    values: FloatArray
    openings: FloatArray
    struts: Elimination


class Closing(NamedTuple):
    """Where closing the loops has ended, and the structure of the attached struts there.

    ``outside`` and ``strain`` are the metres open outside, and along, the directions that the
    flexures absorb; ``steps`` is 0 where the loops do not close.
    """

    location: Location
    structure: Structure
    outside: float
    strain: float
    steps: int


class Linearisation(NamedTuple):
    """What turns openings and misfits into a step.

    ``closing`` (6, g) is the twist per misclosure of the structural rows; ``twists`` (6, w) and
    ``rates`` (N, w) are the motions left, ``fit`` (w, h) their coordinates per misfit of a
    reading; ``read`` (N,) is 1 for the h actuators with a reading.
    """

    closing: FloatArray
    twists: FloatArray
    rates: FloatArray
    fit: FloatArray
    read: FloatArray


def located(m: Model, pose: FloatArray, values: FloatArray) -> Location:
    """Return the location of ``m`` at a ``pose`` (4, 4) and joint ``values`` (s, k)."""
    screws, openings = placed_struts(m.chains, pose, values)
    return Location(pose, values, openings, eliminated(m.chains, m.drives.scale, screws))


def closed(m: Model, start: Location, failed: FloatArray, target: FloatArray) -> Closing:
    """Return where the loops of the attached struts close and the readings fit best.

    Of ``m``, from a warm ``start``; ``target`` (N,) are joint values read, NaN where there is
    none, and those of struts that ``failed`` (s + 2 N,) says are lost are not looked at.
    """
    location, steps, arrived, before, last = start, 0, False, -1, np.inf
    structure = structure_of(location.struts, failed)
    for _ in range(MOST_FACTORISATIONS):
        kept = kept_constraints(structure.sigma, m.law.closing_compliance)
        if arrived and kept == before:
            outside, strain = open_ways(location, structure, failed, kept)
            if outside <= CLOSURE_TOLERANCE:
                return Closing(location, structure, outside, strain, steps)
            if not outside <= STALLED * last:
                break
            last = outside
        before = kept
        steps_now, arrived, location = _advanced(
            m, location, _linearised(m, location, failed, target, structure, kept), structure,
            failed, target,
        )
        if steps_now == 0:
            break
        steps += steps_now
        structure = structure_of(location.struts, failed)
    return Closing(location, structure, np.inf, np.inf, 0)


def largest_misfit(
    m: Model, values: FloatArray, failed: FloatArray, target: FloatArray
) -> float:
    """Return by how much ``target`` (N,) and ``values`` (s, k) of ``m`` differ, metres, at most.

    Of struts that have not ``failed`` (s + 2 N,).
    """
    largest = 0.0
    for j in range(len(target)):
        if m.chains.strut[j] >= 0 and holds(m.chains.strut, failed, j) and isfinite(target[j]):
            off = abs(target[j] - values[m.chains.strut[j], m.chains.joint[j]]) * m.drives.scale[j]
            largest = max(largest, off)
    return largest


def open_ways(
    location: Location, structure: Structure, failed: FloatArray, kept: int
) -> tuple[float, float]:
    """Return `Closing.outside` and `strain` at a ``location``.

    ``kept`` constraints of the ``structure`` count; struts ``failed`` (s + 2 N,) may be lost.
    """
    rest = location.openings.copy()
    for s in range(len(rest)):
        if failed[s] != 0.0:
            for i in range(6):
                rest[s, i] = 0.0
    strain = _misclosures(structure, location.openings)
    missing = strain.copy()
    for k in range(kept):
        share = 0.0
        for i in range(len(missing)):
            share += structure.left[i, k] * missing[i]
        for i in range(len(missing)):
            strain[i] -= share * structure.left[i, k]
    for i in range(len(strain)):
        for c in range(6):
            rest[structure.owner[i], c] -= strain[i] * structure.rows[i, c]
    return frobenius(rest), norm(strain)


def _misclosures(structure: Structure, openings: FloatArray) -> FloatArray:
    missing = np.empty(len(structure.owner))
    for i in range(len(missing)):
        missing[i] = dot(structure.rows[i], openings[structure.owner[i]])
    return missing


def _linearised(
    m: Model,
    location: Location,
    failed: FloatArray,
    target: FloatArray,
    structure: Structure,
    kept: int,
) -> Linearisation:
    """Return what steps away from ``location`` are made with."""
    closing = pseudo_inverse(structure.left, structure.sigma, structure.right, kept)
    twists, rates = allowed_motions(m, location.struts, failed, structure, kept)
    read = np.zeros(len(target))
    for j in range(len(target)):
        if holds(m.chains.strut, failed, j) and isfinite(target[j]):
            read[j] = 1.0
    fitted = rows_of(rates, read)
    place = 0
    for j in range(len(target)):
        if read[j] != 0.0:
            for c in range(rates.shape[1]):
                fitted[place, c] /= m.drives.scale[j]
            place += 1
    left, sigma, right = svd(fitted)
    fit = pseudo_inverse(left, sigma, right, rank_of(sigma, largest_of(sigma)))
    return Linearisation(closing, twists, rates, fit, read)


def _advanced(
    m: Model,
    start: Location,
    linear: Linearisation,
    structure: Structure,
    failed: FloatArray,
    target: FloatArray,
) -> tuple[int, bool, Location]:
    """Return how many chord steps were taken, whether they have arrived, and where.

    No step means that they lead nowhere (numbers that are not finite).
    """
    pose, values, openings, screws = start.pose, start.values, start.openings, m.chains.screws
    travelled, arrived, steps = 0.0, False, 0
    for _ in range(MOST_CHORDS):
        twist, rates = _step(m, start.struts, linear, structure, failed, target, openings, values)
        length, tips = norm(twist), np.empty(openings.shape)
        for s in range(len(tips)):
            for i in range(6):
                tips[s, i] = openings[s, i] + twist[i]
        follow = joint_rates(m.chains, start.struts, failed, tips, rates)
        square = 0.0
        for j in range(len(rates)):
            square += (m.drives.scale[j] * rates[j]) ** 2
        length = max(length, sqrt(square))
        if not isfinite(length + frobenius(follow)):
            return 0, False, start
        shortened = 1.0
        if length > LONGEST_STEP * m.chains.length:
            shortened = LONGEST_STEP * m.chains.length / length
        for i in range(6):
            twist[i] *= shortened
        pose, values = displaced_pose(pose, twist, m.chains.length), values.copy()
        for s in range(len(values)):
            for j in range(values.shape[1]):
                values[s, j] += shortened * follow[s, j]
        screws, openings = placed_struts(m.chains, pose, values)
        steps += 1
        travelled += length
        arrived = length * travelled <= (CHORD_STEP * m.chains.length) ** 2
        if arrived and travelled > CHORD_STEP * m.chains.length:
            misfit = largest_misfit(m, values, failed, target)
            arrived = misfit * travelled <= (CHORD_FIT * m.chains.length) ** 2
        if arrived or travelled > CHORD_REACH * m.chains.length:
            break
    struts = eliminated(m.chains, m.drives.scale, screws)
    return steps, arrived, Location(pose, values, openings, struts)


def _step(
    m: Model,
    struts: Elimination,
    linear: Linearisation,
    structure: Structure,
    failed: FloatArray,
    target: FloatArray,
    openings: FloatArray,
    values: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the scaled twist (6,) and the actuators' rates (N,) of one step."""
    missing = _misclosures(structure, openings)
    twist, rates = np.zeros(6), np.zeros(len(target))
    for i in range(6):
        twist[i] = -dot(linear.closing[i], missing)
    for j in range(len(rates)):
        if holds(m.chains.strut, failed, j):
            for i in range(6):
                rates[j] += struts.rows[j, i] * (twist[i] + openings[m.chains.strut[j], i])
    shares, place = np.zeros(linear.fit.shape[0]), 0
    for j in range(len(rates)):
        if linear.read[j] != 0.0:
            error = target[j] - values[m.chains.strut[j], m.chains.joint[j]] - rates[j]
            for c in range(len(shares)):
                shares[c] += linear.fit[c, place] * error
            place += 1
    for c in range(len(shares)):
        for i in range(6):
            twist[i] += linear.twists[i, c] * shares[c]
        for j in range(len(rates)):
            rates[j] += linear.rates[j, c] * shares[c] / m.drives.scale[j]
    return twist, rates
