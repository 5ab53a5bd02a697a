# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The way on from a closed configuration: what its decompositions say about the next step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, sqrt

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.attachment import Attachment
from fault_tolerance.mechanism.chains import Chains
from fault_tolerance.mechanism.linear_algebra import length, row_products
from fault_tolerance.mechanism.regular import StrutInverses
from fault_tolerance.mechanism.state import State
from fault_tolerance.tolerances import CLOSURE_TOLERANCE


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
