# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Closing the loops at given readings: Gauss-Newton with chord steps, from a warm start.

The structural rows are solved first, along the directions the flexures do not absorb. What
freedom is left fits the readings by least squares, and the joints follow strut by strut
(docs/theory.md, section 3). The factorisations of one configuration serve for several steps
(chord steps); the last evaluation serves for the next estimate. An estimate is the place: its
pose, joint values, openings and factorised struts are moved.
"""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import NamedTuple

from fault_tolerance.kernel.array_layout import EstimateArrays, Model
from fault_tolerance.kernel.jacobi_svd import (
    Decomposition,
    along,
    combined,
    copied,
    decomposed,
    dot,
    largest_of,
    norm,
    rank_of,
    solved,
)
from fault_tolerance.kernel.motions import (
    Structure,
    allowed_motions,
    freedom_of,
    holds,
    kept_constraints,
    rates_of,
    size_of,
    structure_of,
)
from fault_tolerance.kernel.scratch import matrix, vector
from fault_tolerance.kernel.strut_poses import displace, place_struts
from fault_tolerance.kernel.strut_qr import factorise, joint_rates
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


class Closing(NamedTuple):
    """How closing the loops has ended.

    ``outside`` and ``strain`` are the metres open outside, and along, the directions that the
    flexures absorb; ``steps`` is 0 where the loops do not close.
    """

    outside: float
    strain: float
    steps: int


class Linearisation(NamedTuple):
    """What turns openings and misfits into a step.

    ``kept`` constraints of the ``structure`` count; ``motions`` (w, 6 + N) are left. ``fit``
    decomposes their rates at the actuators with a reading, of which ``read`` (N,) is 1; ``rank``
    singular values are not zero.
    """

    structure: Structure
    kept: int
    motions: FloatArray
    fit: Decomposition
    rank: int
    read: FloatArray


def place(m: Model, e: EstimateArrays) -> None:
    """Write openings and factorised struts of ``m`` at the pose and joint values of ``e``."""
    mark = m.work[0]
    s, k = m.chains.actuator.shape
    screws = vector(m.work, 6 * s * k).reshape((s, k, 6))
    place_struts(m, e, screws)
    factorise(m, e, screws)
    m.work[0] = mark


def closed(m: Model, e: EstimateArrays, failed: FloatArray, target: FloatArray) -> Closing:
    """Move ``e`` to where the loops of the attached struts close and the readings fit best.

    Returns how that has ended. Of ``m``, from a warm start; ``target`` (N,) are joint values read,
    NaN where there is none, and those of struts that ``failed`` (s + 2 N,) says are lost are not
    looked at.
    """
    mark, steps, arrived, before, last = m.work[0], 0, False, -1, inf
    for _ in range(MOST_FACTORISATIONS):
        m.work[0] = mark
        structure = structure_of(m, e, failed)
        kept = kept_constraints(structure.found.sigma, m.law.closing_compliance)
        if arrived and kept == before:
            outside, strain = _open_ways(m, e, structure, failed, kept)
            if outside <= CLOSURE_TOLERANCE:
                m.work[0] = mark
                return Closing(outside, strain, steps)
            if not outside <= STALLED * last:
                break
            last = outside
        before = kept
        taken, arrived = _advance(m, e, failed, target, _linearised(
            m, e, failed, target, structure, kept
        ))
        if taken == 0:
            break
        steps += taken
    m.work[0] = mark
    return Closing(inf, inf, 0)


def largest_misfit(
    m: Model, e: EstimateArrays, failed: FloatArray, target: FloatArray
) -> float:
    """Return by how much ``target`` (N,) and the values in ``e`` differ, metres, at most.

    Of struts of ``m`` that have not ``failed`` (s + 2 N,).
    """
    largest, strut, joint, values = 0.0, m.chains.strut, m.chains.joint, e.values
    for j in range(len(target)):
        if strut[j] >= 0 and holds(strut, failed, j) and isfinite(target[j]):
            off = abs(target[j] - values[strut[j], joint[j]])
            largest = max(largest, off * m.drives.scale[j])
    return largest


def _open_ways(
    m: Model, e: EstimateArrays, structure: Structure, failed: FloatArray, kept: int
) -> tuple[float, float]:
    """Return `Closing.outside` and `strain` at ``e``."""
    mark, g, openings, left = m.work[0], len(structure.owner), e.openings, structure.found.left
    missing = _misclosures(structure, openings, vector(m.work, g))
    strain = copied(missing, vector(m.work, g))
    for k in range(kept):
        combined(1.0, strain, -dot(left[k], missing), left[k], strain)
    rest = matrix(m.work, len(openings), 6)
    for s in range(len(rest)):
        for c in range(6):
            rest[s, c] = openings[s, c] if failed[s] == 0.0 else 0.0
    for i in range(g):
        own = rest[int(structure.owner[i])]
        for c in range(6):
            own[c] -= strain[i] * structure.columns[c, i]
    m.work[0] = mark
    return size_of(rest, 0, 6), norm(strain)


def _misclosures(structure: Structure, openings: FloatArray, out: FloatArray) -> FloatArray:
    """Write what is open along each row of the ``structure``."""
    columns, owner = structure.columns, structure.owner
    for i in range(len(out)):
        own, out[i] = openings[int(owner[i])], 0.0
        for c in range(6):
            out[i] += columns[c, i] * own[c]
    return out


def _linearised(
    m: Model,
    e: EstimateArrays,
    failed: FloatArray,
    target: FloatArray,
    structure: Structure,
    kept: int,
) -> Linearisation:
    """Return what steps away from ``e`` are made with."""
    n, scale, strut = len(target), m.drives.scale, m.chains.strut
    motions = matrix(m.work, freedom_of(m, e, failed, kept), 6 + n)
    allowed_motions(m, e, failed, structure, kept, motions)
    read = vector(m.work, n)
    for j in range(n):
        read[j] = 1.0 if holds(strut, failed, j) and isfinite(target[j]) else 0.0
    rates = rates_of(motions, read, matrix(m.work, len(motions), n))
    for c in range(len(motions)):
        for j in range(n):
            rates[c, j] /= scale[j]
    fit = decomposed(m.work, rates)
    return Linearisation(
        structure, kept, motions, fit, rank_of(fit.sigma, largest_of(fit.sigma)), read
    )


def _advance(
    m: Model, e: EstimateArrays, failed: FloatArray, target: FloatArray, linear: Linearisation
) -> tuple[int, bool]:
    """Move ``e`` by chord steps; return how many, and whether they have arrived.

    None means that they lead nowhere (numbers that are not finite).
    """
    (s, k), size, joints = m.chains.actuator.shape, m.chains.length, m.chains.joints
    scale, openings, values = m.drives.scale, e.openings, e.values
    screws = vector(m.work, 6 * s * k).reshape((s, k, 6))
    twist, rates = vector(m.work, 6), vector(m.work, len(target))
    tips, follow = matrix(m.work, s, 6), matrix(m.work, s, k)
    travelled, arrived, steps = 0.0, False, 0
    for _ in range(MOST_CHORDS):
        _step(m, e, failed, target, linear, twist, rates)
        square = whole = 0.0
        for j in range(len(rates)):
            square += (scale[j] * rates[j]) ** 2
        for i in range(s):
            combined(1.0, openings[i], 1.0, twist, tips[i])
        joint_rates(m, e, failed, tips, rates, follow)
        for i in range(s):
            for j in range(joints[i]):
                if failed[i] == 0.0:
                    whole += abs(follow[i, j])
                elif not isfinite(follow[i, j]):
                    follow[i, j] = 0.0  # a lost strut may stay behind
        length = max(norm(twist), sqrt(square))
        if not isfinite(length + whole):
            return 0, False
        shortened = 1.0
        if length > LONGEST_STEP * size:
            shortened = LONGEST_STEP * size / length
        combined(shortened, twist, 0.0, twist, twist)
        displace(m, e.pose, twist)
        for i in range(s):
            for j in range(joints[i]):
                values[i, j] += shortened * follow[i, j]
        place_struts(m, e, screws)
        steps += 1
        travelled += length
        arrived = length * travelled <= (CHORD_STEP * size) ** 2
        if arrived and travelled > CHORD_STEP * size:
            misfit = largest_misfit(m, e, failed, target)
            arrived = misfit * travelled <= (CHORD_FIT * size) ** 2
        if arrived or travelled > CHORD_REACH * size:
            break
    factorise(m, e, screws)
    return steps, arrived


def _step(
    m: Model,
    e: EstimateArrays,
    failed: FloatArray,
    target: FloatArray,
    linear: Linearisation,
    twist: FloatArray,
    rates: FloatArray,
) -> None:
    """Write the scaled ``twist`` (6,) and the actuators' ``rates`` (N,) of one step."""
    mark, structure, motions = m.work[0], linear.structure, linear.motions
    strut, joint, scale, openings = m.chains.strut, m.chains.joint, m.drives.scale, e.openings
    missing = _misclosures(structure, e.openings, vector(m.work, len(structure.owner)))
    solved(structure.found, linear.kept, missing, twist)
    combined(-1.0, twist, 0.0, twist, twist)
    errors, rows, values, read = vector(m.work, len(rates)), e.rows, e.values, linear.read
    for j in range(len(rates)):
        rates[j] = errors[j] = 0.0
        if holds(strut, failed, j):
            rates[j] = dot(rows[j], twist) + dot(rows[j], openings[strut[j]])
        if read[j] != 0.0:
            errors[j] = target[j] - values[strut[j], joint[j]] - rates[j]
    shares = solved(linear.fit, linear.rank, errors, vector(m.work, len(motions)))
    for i in range(6):
        twist[i] += along(motions, shares, i)
    for j in range(len(rates)):
        rates[j] += along(motions, shares, 6 + j) / scale[j]
    m.work[0] = mark
