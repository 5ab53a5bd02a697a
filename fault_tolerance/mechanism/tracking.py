# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Following a mechanism from one configuration to a near one, at one evaluation each.

The decompositions made at the last configuration serve for the Newton step away from it. If that
step was not short enough to be the last, further ones are taken with the same decompositions
(chord steps): they only need to know where the struts' tips are. The rows are then derived
anew, once, and the same evaluation certifies what was found (docs/theory.md, section 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, sqrt

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.attachment import Attachment
from fault_tolerance.mechanism.chains import Chains
from fault_tolerance.mechanism.linear_algebra import length, row_products
from fault_tolerance.mechanism.regular import StrutInverses
from fault_tolerance.mechanism.screws import displaced_by
from fault_tolerance.mechanism.state import State, placed_state
from fault_tolerance.mechanism.tolerances import CLOSURE_TOLERANCE

_MOST_EVALUATIONS = 4
_MOST_CHORDS = 4
# Characteristic lengths; farther away the last decompositions are no guide any more.
_FARTHEST = 0.1


@dataclass(frozen=True, eq=False)
class Closed:
    """A state whose loops are closed, with its certificate.

    Attributes
    ----------
    state : State
    attachment : Attachment
        The struts that were closed.
    kept : int
        How many of their structural constraints the flexures do not absorb.
    converged : bool
    iterations : int
    """

    state: State
    attachment: Attachment
    kept: int
    converged: bool
    iterations: int

    @cached_property
    def open(self) -> tuple[float, float]:
        """Metres open outside, and along, the directions that flexures absorb."""
        return self.state.residuals(self.attachment, self.kept)

    @property
    def closes(self) -> bool:
        """Whether nothing is open but what the flexures absorb."""
        if self.attachment.complete and length(self.state.openings) <= CLOSURE_TOLERANCE:
            return True  # what is open outside some directions is a part of all that is
        return self.open[0] <= CLOSURE_TOLERANCE


def tracked(
    start: State, target: FloatArray, attachment: Attachment, compliance: float, last_step: float
) -> Closed | None:
    """Return the state near ``start`` that fits ``target``, or None: then take the long way.

    Parameters
    ----------
    start : State
    target : (N,) array
        Joint values of the actuators; those of attached struts must be finite here.
    attachment : Attachment
    compliance : float
    last_step : float
        Characteristic lengths; the relative length of a Newton step that need not be followed
        by another one. It leaves an error of about its square.
    """
    state, iterations = start, 0
    unit = start.chains.length
    shortest = last_step * unit
    kept = state.constraints.structure_of(attachment).kept(compliance)
    for _ in range(_MOST_EVALUATIONS):
        regular = state.regular
        steps = steps_from(state, attachment, kept)
        if regular is None or steps is None:
            return None
        pose, values, openings, travelled = state.pose, state.joint_values, state.openings, 0.0
        for _ in range(_MOST_CHORDS):
            twist, rates, step = steps.towards(target, values, openings)
            iterations += 1
            travelled += step
            if not travelled <= _FARTHEST * unit:
                return None  # NaN among them
            pose = displaced_by(pose, twist, unit)
            values = values + rates
            placement = regular.placed(pose, values)
            openings = placement.openings
            arrived = step * travelled <= shortest**2
            if arrived and travelled > shortest:
                # Readings in contradiction are weighed against each other by what the drives do
                # here, which is not quite what they did where the decompositions were made.
                misfit = steps.misfit(target, values)
                arrived = misfit * travelled <= shortest**2
            if arrived:
                break
        found = placed_state(state.chains, regular, placement)
        if found is None:
            return None
        freedom = kept
        state = found
        kept = state.constraints.structure_of(attachment).kept(compliance)
        # In an overconstrained mechanism the freedom to fit shows only once the loops close.
        if arrived and kept == freedom:
            closed = Closed(state, attachment, kept, True, iterations)
            if closed.closes:
                return closed
    return None


def steps_from(state: State, attachment: Attachment, kept: int) -> Steps | None:
    """Return the steps away from ``state``, made once; None where they are not that simple."""
    made = state.steps
    key = attachment.lost, kept
    if key not in made:
        made[key] = Steps.at(state, attachment, kept)
    found: Steps | None = made[key]
    return found


@dataclass(frozen=True, eq=False)
class Steps:
    """The Gauss-Newton steps that the decompositions at one state give.

    `closing` (6, g) turns the misclosures of ``structure`` (g, 6), rows of ``struts`` (g,), into
    the twist that mends them, `fit` (6, h) the errors of the actuators, whose ``rows`` are
    (h, 6), into the one that fits them.
    """

    attachment: Attachment
    chains: Chains
    inverses: StrutInverses
    structure: FloatArray
    struts: IntArray
    closing: FloatArray | None
    rows: FloatArray
    fit: FloatArray

    @classmethod
    def at(cls, state: State, attachment: Attachment, kept: int) -> Steps | None:
        """Return the steps at ``state``; None where they are not that simple."""
        constraints = state.constraints
        if constraints.inverses is None:
            return None
        freedom = constraints.freedom_of(attachment, kept)
        if not freedom.determined:
            return None
        structure, closing = constraints.structure_of(attachment), None
        if kept:
            scaled = structure.left[:, :kept] / -structure.sigma[:kept]
            closing = structure.right[:kept].T.dot(scaled.T)
        inverses, rows = constraints.inverses, constraints.inverses.actuator_rows
        if not attachment.complete:
            rows = rows[attachment.places]
        return cls(
            attachment, state.chains, inverses, structure.rows, structure.struts, closing, rows,
            freedom.fit,
        )

    def misfit(self, target: FloatArray, values: FloatArray) -> float:
        """Return how far the joint values (s, k) are from the target, metres."""
        chains = self.chains
        off = (target - values[chains.places]) * chains.drive_sizes
        return length(off if self.attachment.complete else off[self.attachment.places])

    def towards(
        self, target: FloatArray, values: FloatArray, openings: FloatArray
    ) -> tuple[FloatArray, FloatArray, float]:
        """Return the scaled twist (6,), the joint rates (s, k) and the length of one step."""
        attachment, chains = self.attachment, self.chains
        error = target - values[chains.places]
        ways = openings
        if not attachment.complete:
            error = error[attachment.places]
        struts = chains.places[0]
        if self.closing is not None:
            misclosure = row_products(self.structure, openings[self.struts])
            closing = self.closing.dot(misclosure)
            ways = openings + closing
        ways = ways[struts if attachment.complete else struts[attachment.places]]
        error -= row_products(self.rows, ways)
        twist = self.fit.dot(error)
        if self.closing is not None:
            twist += closing
        rates = self.inverses.joint_rates(openings + twist)
        driven = rates[chains.places] * chains.drive_sizes
        if not attachment.complete:
            driven = driven[attachment.places]
        square = max(float(twist.dot(twist)), float(driven.dot(driven)))
        return twist, rates, sqrt(square) if isfinite(square) else square
