# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What goes into the kernel and comes out of it: named views of flat arrays.

A compiled function takes a few flat arrays in a microsecond and a structure of forty arrays in
thirty. So each of model, estimate and command is one array of numbers; `model_of`, `estimate_of`
and `command_of` give its parts names, in compiled code and in Python alike.
"""

from __future__ import annotations

from typing import NamedTuple

from fault_tolerance.mechanism.arrays import FloatArray, IntArray

SIZES, SCALARS = 6, 13
"""How many sizes, and single numbers, are at the head of a model."""


class Chains(NamedTuple):
    """The struts at home: s of them with up to k joints each, and N actuators.

    ``joints`` and ``passive`` (s,) count the joints of each strut, and those without a drive.
    ``actuator`` (s, k) is the place of a joint's actuator, -1 where it is passive; ``strut`` and
    ``joint`` (N,) say where each actuator is, -1 for a mechanism given by its Jacobian.
    ``screws`` (s, k, 6) are joint twists, base axes, v at the base origin; ``origin`` (3,) is
    that of the platform, and ``length`` the characteristic length, metres.
    """

    joints: IntArray
    passive: IntArray
    actuator: IntArray
    strut: IntArray
    joint: IntArray
    screws: FloatArray
    origin: FloatArray
    length: float


class Drives(NamedTuple):
    """The actuators, (N,) arrays in their units.

    ``scale`` is metres per unit (the characteristic length for rotary ones, else 1), ``speed``
    the largest rate; ``low`` and ``high`` are the ways from home to the ends of the stroke.
    """

    scale: FloatArray
    speed: FloatArray
    low: FloatArray
    high: FloatArray


class TaskRows(NamedTuple):
    """What the platform is for.

    ``rows`` (l,) of a twist are the task; ``major`` (m,) and ``secondary`` (l - m,) are rows of
    the task. ``scale`` (6,) is metres per unit of a twist, ``measure`` (l,) the metric in which
    the measures p, t and h compare task coordinates.
    """

    rows: IntArray
    major: IntArray
    secondary: IntArray
    scale: FloatArray
    measure: FloatArray


class Law(NamedTuple):
    """The settings of estimate, verdict and control law.

    Attributes
    ----------
    compliance, closing_compliance : float
        Singular values up to which structural constraints count as absorbed by the flexures:
        for the verdict, and while loops are closed.
    misfit_limit : float
        Metres by which redundant readings may contradict each other.
    threshold : float
        The tolerance threshold.
    singular_below, poor_below : float
        Transmissions not driven: of any direction, and of a secondary one relative to the best.
    slow_below, hold_below : float
        Margins from singularities at which motion slows down, and ends.
    stroke_gain : float
        Speed per distance left towards the ends of a stroke, 1/s.
    max_acceleration : float
        Of the norm of all rates while a transition lasts, m/s^2.
    home_transmission, home_gain : float
        What margins are measured by: transmission and platform gain at home.
    """

    compliance: float = 0.0
    closing_compliance: float = 0.0
    misfit_limit: float = 5e-3
    threshold: float = 0.01
    singular_below: float = 5e-4
    poor_below: float = 0.05
    slow_below: float = 5e-3
    hold_below: float = 5e-4
    stroke_gain: float = 10.0
    max_acceleration: float = 10.0
    home_transmission: float = 1.0
    home_gain: float = 1.0


class Model(NamedTuple):
    """A mechanism and the settings of its controller: what does not change between two steps.

    ``given_twists`` (6, n) and ``given_rates`` (N, n) are all motions, scaled, of a mechanism
    given by its Jacobian; they have no columns elsewhere.
    """

    chains: Chains
    drives: Drives
    task: TaskRows
    law: Law
    given_twists: FloatArray
    given_rates: FloatArray


def model_of(counts: IntArray, numbers: FloatArray) -> Model:
    """Return the parts of a model packed by `fault_tolerance.kernel.packing`.

    ``counts`` begins with the sizes s, k, N, l, m and n, ``numbers`` with the characteristic
    length and `Law`.
    """
    s, k, n = counts[0], counts[1], counts[2]
    task, major, given = counts[3], counts[4], counts[5]
    a = SIZES + s
    b = a + s
    c = b + s * k
    d = c + n
    e = d + n
    f = e + task
    y = f + major
    g = SCALARS + 6 * s * k
    h = g + 3
    i = h + n
    j = i + 6
    o = j + task
    p = o + n
    q = p + n
    r = q + n
    t = r + 6 * given
    chains = Chains(
        counts[SIZES:a], counts[a:b], counts[b:c].reshape((s, k)), counts[c:d], counts[d:e],
        numbers[SCALARS:g].reshape((s, k, 6)), numbers[g:h], numbers[0],
    )
    law = Law(
        numbers[1], numbers[2], numbers[3], numbers[4], numbers[5], numbers[6], numbers[7],
        numbers[8], numbers[9], numbers[10], numbers[11], numbers[12],
    )
    return Model(
        chains,
        Drives(numbers[h:i], numbers[o:p], numbers[p:q], numbers[q:r]),
        TaskRows(counts[e:f], counts[f:y], counts[y:], numbers[i:j], numbers[j:o]),
        law,
        numbers[r:t].reshape((6, given)),
        numbers[t:].reshape((n, given)),
    )


FACTS = 19
"""Numbers at the head of an estimate; the places below are theirs."""

LOCATED, CLOSED, CONTRADICTORY, STEPS = 0, 1, 2, 3
OUTSIDE, STRAIN, MISFIT = 4, 5, 6
COMPLIANCE, MOBILITY, DRIFTING, NOMINAL_FREEDOM, FREEDOM = 7, 8, 9, 10, 11
VERDICT, MAJOR_RANK = 12, 13
POSITION, TORQUE, HARD, MOTION, REGULAR = 14, 15, 16, 17, 18

TOLERATED, DRIFTS, MAJOR_LOST, BELOW_THRESHOLD = 0, 1, 2, 3
"""Verdicts on the failures present."""


class EstimateArrays(NamedTuple):
    """Where the mechanism is and what its failures leave of it, scaled to metres.

    ``facts`` (FACTS,) are single numbers, by the places above; ``failed`` (s + 2 N,) is 1 for
    every strut lost, actuator stuck, and actuator free. ``pose`` (4, 4) is the platform frame in
    base axes; ``values`` (s, k) are all joint values, ``actuators`` (N,) those of the actuators;
    ``openings`` (s, 6) are what is open between struts and platform. ``q``, ``r``, ``order``,
    ``ranks`` and ``rows`` are the factorised struts, with which the next estimate begins.
    ``jacobian`` (6, n) is the twist, ``mapping`` (N, n) the driven actuators' rates (orthonormal
    columns) per unit reduced rate, ``follow`` (N, n) the same with what free ones do.
    """

    facts: FloatArray
    failed: FloatArray
    pose: FloatArray
    values: FloatArray
    actuators: FloatArray
    openings: FloatArray
    q: FloatArray
    r: FloatArray
    order: FloatArray
    ranks: FloatArray
    rows: FloatArray
    jacobian: FloatArray
    mapping: FloatArray
    follow: FloatArray


def estimate_size(s: int, k: int, n: int) -> int:
    """Return how many numbers an estimate has: ``s`` struts of ``k`` joints, ``n`` actuators."""
    fixed = FACTS + (s + 2 * n) + 16 + s * k + n
    return fixed + 6 * s + 36 * s + 6 * s * k + s * k + 2 * s + 6 * n + (6 + 2 * n) * n


def estimate_of(m: Model, numbers: FloatArray) -> EstimateArrays:
    """Return the named parts of an estimate of ``m`` with its ``numbers``."""
    s, k = m.chains.actuator.shape
    n, width = len(m.drives.scale), int(numbers[MOBILITY])
    a = FACTS + s + 2 * n
    b = a + 16
    c = b + s * k
    d = c + n
    e = d + 6 * s
    f = e + 36 * s
    g = f + 6 * s * k
    h = g + s * k
    i = h + 2 * s
    j = i + 6 * n
    o = j + 6 * n
    p = o + n * n
    return EstimateArrays(
        numbers[:FACTS],
        numbers[FACTS:a],
        numbers[a:b].reshape((4, 4)),
        numbers[b:c].reshape((s, k)),
        numbers[c:d],
        numbers[d:e].reshape((s, 6)),
        numbers[e:f].reshape((s, 6, 6)),
        numbers[f:g].reshape((s, k, 6)),
        numbers[g:h].reshape((s, k)),
        numbers[h:i].reshape((s, 2)),
        numbers[i:j].reshape((n, 6)),
        numbers[j : j + 6 * width].reshape((6, width)),
        numbers[o : o + n * width].reshape((n, width)),
        numbers[p : p + n * width].reshape((n, width)),
    )


COMMAND_FACTS = 14
"""Numbers at the head of a command; the places below are theirs."""

SCALE, SECONDARY_SCALE, MAJOR_JUMP, RATE_JUMP = 0, 1, 2, 3
UNDER_WAY, OBSTACLE, SLOWED, TIME, MOVED, COMMANDED_MOBILITY = 4, 5, 6, 7, 8, 9
TRANSMISSION, GAIN, DRIVEN = 10, 11, 12

NO_OBSTACLE, HARDLY_MOVES, HARDLY_HELD = 0, 1, 2
"""Near which kind of singularity motion is not allowed."""


class CommandArrays(NamedTuple):
    """One command, and what the next one needs to know of it.

    ``facts`` (COMMAND_FACTS,) are single numbers, by the places above; ``rates`` (N,) are in the
    actuators' units, free ones as they follow; ``twist`` (6,) is what they give the platform,
    rad/s and m/s; ``saturated`` (N,) is 1 for actuators that would have crossed a bound.
    """

    facts: FloatArray
    rates: FloatArray
    twist: FloatArray
    saturated: FloatArray


def command_size(n: int) -> int:
    """Return how many numbers a command of ``n`` actuators has."""
    return COMMAND_FACTS + 2 * n + 6


def command_of(numbers: FloatArray) -> CommandArrays:
    """Return the named parts of a command with its ``numbers``."""
    n = (len(numbers) - COMMAND_FACTS - 6) // 2
    a = COMMAND_FACTS + n
    return CommandArrays(
        numbers[:COMMAND_FACTS], numbers[COMMAND_FACTS:a], numbers[a : a + 6], numbers[a + 6 :]
    )
