# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Layout of the flat arrays (model, estimate, command) and their named views.

A compiled function takes a few flat arrays in a microsecond and a structure of forty arrays in
thirty. So estimate and command are one array of numbers each, a model two. `model_of`,
`estimate_of` and `command_of` give their parts names, in compiled code and in Python alike.

Part i of an array with start offsets p is ``[p[i] : p[i + 1]]``. A part that is added needs its
size in `fault_tolerance.kernel.packing` (in `estimate_sizes` for an estimate), at the same place
as its view here, and one more in the count of parts.
"""

from math import nan
from typing import NamedTuple

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import FARTHEST, SINGULAR_BELOW

N_SIZES = 6
"""Sizes at the head of ``counts``; the start offsets of all parts follow."""

N_COUNT_OFFSETS, N_NUMBER_OFFSETS, N_ESTIMATE_OFFSETS = 8, 10, 15
"""Start offsets of the parts of ``counts``, of ``numbers`` and of an estimate, and their ends."""


class Chains(NamedTuple):
    """The struts at home: s of them with up to k joints each, and N actuators.

    ``joints`` and ``passive`` (s,) count the joints of each strut, and those without an actuator.
    ``actuator`` (s, k) is the index of a joint's actuator, -1 where it is passive; ``strut`` and
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


class Actuators(NamedTuple):
    """The actuators, (N,) arrays in their units.

    ``scale`` is metres per unit (the characteristic length for rotary ones, else 1), ``speed``
    the largest rate; ``to_low`` and ``to_high`` are the distances from home to the ends of the
    stroke.
    """

    scale: FloatArray
    speed: FloatArray
    to_low: FloatArray
    to_high: FloatArray


class TaskRows(NamedTuple):
    """What the platform is for.

    ``rows`` (l,) of a twist are the task; ``major`` (m,), ``secondary`` (l - m,) and ``every``
    (l,) are rows of the task. ``scale`` (6,) is metres per unit of a twist, ``measure`` (l,) the
    metric in which the measures p, t and h compare task coordinates.
    """

    rows: IntArray
    major: IntArray
    secondary: IntArray
    every: IntArray
    scale: FloatArray
    measure: FloatArray


class Law(NamedTuple):
    """The settings of estimate, verdict and control law.

    Attributes
    ----------
    misfit_limit : float
        Metres by which redundant readings may contradict each other.
    threshold : float
        The tolerance threshold.
    slow_below, hold_below : float
        Margins from singularities at which motion slows down, and ends.
    stroke_gain : float
        Speed per distance left towards the ends of a stroke, 1/s.
    transition_acceleration : float
        Of the norm of all rates while a transition lasts, m/s^2.
    compliance, closing_compliance : float
        Singular values up to which structural constraints count as absorbed by the flexures:
        for the verdict, and while loops are closed.
    singular_below : float
        Transmissions not driven.
    home_transmission, home_gain : float
        What margins are measured by: transmission and platform gain at home.
    """

    misfit_limit: float
    threshold: float
    slow_below: float
    hold_below: float
    stroke_gain: float
    transition_acceleration: float
    compliance: float = 0.0
    closing_compliance: float = 0.0
    singular_below: float = SINGULAR_BELOW
    home_transmission: float = 1.0
    home_gain: float = 1.0


N_SCALARS = 1 + len(Law._fields)
"""Single numbers at the head of ``numbers``: the characteristic length, and `Law`."""


class Model(NamedTuple):
    """A mechanism and the settings of its controller: what does not change between two steps.

    ``given`` (n, 6 + N) are all motions of a mechanism given by its Jacobian; it has no rows
    elsewhere. ``offsets`` are where the parts of an estimate begin, ``work`` is scratch memory.
    """

    chains: Chains
    actuators: Actuators
    task: TaskRows
    law: Law
    given: FloatArray
    offsets: IntArray
    work: FloatArray


def model_of(counts: IntArray, numbers: FloatArray, work: FloatArray) -> Model:
    """Return the parts of a model packed by `fault_tolerance.kernel.packing`.

    ``counts`` begins with the sizes s, k, N, l, m and n, and the start offsets of all parts;
    ``numbers`` with the characteristic length and `Law`.
    """
    s, k, n, major, given = counts[0], counts[1], counts[2], counts[4], counts[5]
    number_parts = N_SIZES + N_COUNT_OFFSETS
    estimate_parts = number_parts + N_NUMBER_OFFSETS
    c, p, v = counts[N_SIZES:number_parts], counts[number_parts:estimate_parts], numbers
    chains = Chains(
        counts[c[0] : c[1]], counts[c[1] : c[2]], counts[c[2] : c[3]].reshape((s, k)),
        counts[c[3] : c[4]], counts[c[4] : c[5]],
        v[p[0] : p[1]].reshape((s, k, 6)), v[p[1] : p[2]], v[0],
    )
    every = counts[c[6] : c[7]]
    task = TaskRows(
        counts[c[5] : c[6]], every[:major], every[major:], every, v[p[3] : p[4]], v[p[4] : p[5]]
    )
    law = Law(v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9], v[10], v[11])
    actuators = Actuators(v[p[2] : p[3]], v[p[5] : p[6]], v[p[6] : p[7]], v[p[7] : p[8]])
    motions = v[p[8] : p[9]].reshape((given, 6 + n))
    offsets = counts[estimate_parts : estimate_parts + N_ESTIMATE_OFFSETS]
    return Model(chains, actuators, task, law, motions, offsets, work)


def credible(readings: FloatArray, out: FloatArray) -> FloatArray:
    """Write ``readings`` (N,), NaN for any that cannot be true; return ``out``."""
    for j in range(len(readings)):
        out[j] = readings[j] if abs(readings[j]) <= FARTHEST else nan
    return out


N_FACTS = 17
"""Numbers at the head of an estimate; these are their indices."""

LOCATED, CLOSED, CONTRADICTORY, UNREAD, STRAIN, MISFIT = 0, 1, 2, 3, 4, 5
COMPLIANCE, MOBILITY, UNCONTROLLED, NOMINAL_FREEDOM, FREEDOM = 6, 7, 8, 9, 10
TOLERATED, TORQUE, HARD, MOTION, SELF_MOTIONS, REGULAR = 11, 12, 13, 14, 15, 16


class EstimateArrays(NamedTuple):
    """Where the mechanism is and what its failures leave of it, scaled to metres.

    ``facts`` (N_FACTS,) are single numbers, by the indices above. ``failed`` (s + 2 N,) is 1 for
    every strut lost, actuator stuck, and actuator free, ``driving`` (N,) for the actuators that
    still drive. ``pose`` (4, 4) is the platform frame in base axes; ``values`` (s, k) are all
    joint values, ``actuator_values`` (N,) those of the actuators; ``closure_error`` (s, 6) is
    the displacement from each strut's tip to the platform.

    The factorised struts (`fault_tolerance.kernel.strut_qr`): ``q`` (s, 6, 6) is Q^T of each,
    passive range, then actuator rows, then constraints; ``r`` (s, k, 6) has the columns of R,
    ``order`` (s, k) the joints they belong to, ``ranks`` (s, 2) the rank of the passive columns
    and what the actuators add. ``rows`` (N, 6) give the rates of the actuators, ``q'_a = rows @
    V``; the first ``facts[SELF_MOTIONS]`` rows of ``self_motions`` (N, N) are motions of
    actuators that leave the platform at rest (actuators in series, or at a singularity of their
    strut). ``facts[REGULAR]``: there are none, and the rows are well conditioned.

    ``motions`` (n, 6 + N) are those that the actuators control, one for each reduced rate; the
    rates of the driving actuators are orthonormal.
    """

    facts: FloatArray
    failed: FloatArray
    driving: FloatArray
    pose: FloatArray
    values: FloatArray
    actuator_values: FloatArray
    closure_error: FloatArray
    q: FloatArray
    r: FloatArray
    order: FloatArray
    ranks: FloatArray
    rows: FloatArray
    self_motions: FloatArray
    motions: FloatArray

    @property
    def jacobian(self) -> FloatArray:
        """J, (6, n): the platform's twist per unit reduced rate."""
        return self.motions[:, :6].T

    @property
    def follow(self) -> FloatArray:
        """Rates of all actuators per unit reduced rate, (N, n); free ones go along."""
        return self.motions[:, 6:].T


def estimate_sizes(s: int, k: int, n: int) -> list[int]:
    """Return the sizes of an estimate's parts: ``s`` struts of ``k`` joints, ``n`` actuators."""
    return [
        N_FACTS, s + 2 * n, n, 16, s * k, n, 6 * s,
        36 * s, 6 * s * k, s * k, 2 * s, 6 * n, n * n, n * (6 + n),
    ]


def estimate_of(m: Model, numbers: FloatArray) -> EstimateArrays:
    """Return the named parts of an estimate with its ``numbers``."""
    s, k = m.chains.actuator.shape
    n, p, v, width = len(m.actuators.scale), m.offsets, numbers, int(numbers[MOBILITY])
    return EstimateArrays(
        v[: p[1]], v[p[1] : p[2]], v[p[2] : p[3]],
        v[p[3] : p[4]].reshape((4, 4)), v[p[4] : p[5]].reshape((s, k)),
        v[p[5] : p[6]], v[p[6] : p[7]].reshape((s, 6)),
        v[p[7] : p[8]].reshape((s, 6, 6)), v[p[8] : p[9]].reshape((s, k, 6)),
        v[p[9] : p[10]].reshape((s, k)), v[p[10] : p[11]].reshape((s, 2)),
        v[p[11] : p[12]].reshape((n, 6)), v[p[12] : p[13]].reshape((n, n)),
        v[p[13] : p[13] + width * (6 + n)].reshape((width, 6 + n)),
    )


N_COMMAND_FACTS = 13
"""Numbers at the head of a command; these are their indices."""

SCALE, SECONDARY_SCALE, MAJOR_JUMP, RATE_JUMP = 0, 1, 2, 3
UNDER_WAY, OBSTACLE, SLOWED, TIME, MOVED, COMMANDED_MOBILITY = 4, 5, 6, 7, 8, 9
TRANSMISSION, GAIN, FINITE = 10, 11, 12

NO_OBSTACLE, HARDLY_MOVES, HARDLY_HELD = 0, 1, 2
"""Near which kind of singularity motion is not allowed."""


class CommandArrays(NamedTuple):
    """One command, and what the next one needs to know of it.

    ``facts`` (N_COMMAND_FACTS,) are single numbers, by the indices above; ``rates`` (N,) are in
    the actuators' units, free ones as they follow; ``twist`` (6,) is what they give the platform,
    rad/s and m/s; ``saturated`` (N,) is 1 for actuators that would have crossed a bound.
    """

    facts: FloatArray
    rates: FloatArray
    twist: FloatArray
    saturated: FloatArray


def command_size(n: int) -> int:
    """Return how many numbers a command of ``n`` actuators has."""
    return N_COMMAND_FACTS + 2 * n + 6


def command_of(numbers: FloatArray) -> CommandArrays:
    """Return the named parts of a command with its ``numbers``."""
    n = (len(numbers) - N_COMMAND_FACTS - 6) // 2
    rates_end = N_COMMAND_FACTS + n
    twist_end = rates_end + 6
    return CommandArrays(
        numbers[:N_COMMAND_FACTS],
        numbers[N_COMMAND_FACTS:rates_end],
        numbers[rates_end:twist_end],
        numbers[twist_end:],
    )
