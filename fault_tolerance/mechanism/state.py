# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A pose and joint values, and everything that follows from them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.attachment import Attachment
from fault_tolerance.mechanism.chains import Chains, forward_kinematics
from fault_tolerance.mechanism.constraints import (
    StrutConstraints,
    regular_constraints,
    strut_constraints,
)
from fault_tolerance.mechanism.linear_algebra import length, row_products
from fault_tolerance.mechanism.regular import Placement, RegularStruts
from fault_tolerance.mechanism.screws import difference


@dataclass(frozen=True, eq=False)
class State:
    """A pose, joint values, and everything that follows from them.

    Attributes
    ----------
    chains : Chains
    pose : (4, 4) array
    joint_values : (s, k) array
    actuator_values : (N,) array
    openings : (s, 6) array
        From each strut's tip to the platform, scaled: metres.
    constraints : StrutConstraints
    regular : RegularStruts or None
        What the next evaluation may take the short way with.
    steps : dict
        The ways on from here (`fault_tolerance.mechanism.tracking`), as far as they were asked
        for.
    """

    chains: Chains
    pose: FloatArray
    joint_values: FloatArray
    actuator_values: FloatArray
    openings: FloatArray
    constraints: StrutConstraints
    regular: RegularStruts | None
    steps: dict[tuple[tuple[str, ...], int], Any] = field(default_factory=dict, repr=False)

    @cached_property
    def screws(self) -> FloatArray:
        """Joint twists (s, k, 6), base axes, v at the platform's origin."""
        return forward_kinematics(self.chains, self.joint_values, self.pose[:3, 3])[0]

    def residuals(self, attachment: Attachment, kept: int) -> tuple[float, float]:
        """Return what is open outside, and along, the absorbed directions, in metres.

        Parameters
        ----------
        attachment : Attachment
        kept : int
            How many of the structural constraints count.
        """
        structure = self.constraints.structure_of(attachment)
        if attachment.complete:
            rest = self.openings
        else:
            rest = np.where(attachment.attached[:, None], self.openings, 0.0)
        if not len(structure.rows):
            return length(rest), 0.0
        rows, struts = structure.rows, structure.struts
        misclosure = row_products(rows, self.openings[struts])
        left = structure.left[:, :kept]
        strain = misclosure - left.dot(misclosure.dot(left))
        along = rows * strain[:, None]
        if len(struts) == len(rest):  # one row each, in their order
            rest = rest - along
        else:
            rest = rest.copy()
            np.subtract.at(rest, struts, along)
        return length(rest), length(strain)


def evaluated(
    chains: Chains, pose: FloatArray, joint_values: FloatArray, regular: RegularStruts | None
) -> State:
    """Return the state at ``pose`` (4, 4) and ``joint_values`` (s, k).

    By the short way where ``regular`` is given and the struts are far from singular, by the
    definition elsewhere.
    """
    if regular is not None:
        state = placed_state(chains, regular, regular.placed(pose, joint_values))
        if state is not None:
            return state
    return state_by_definition(chains, pose, joint_values, regular)


def placed_state(chains: Chains, regular: RegularStruts, placement: Placement) -> State | None:
    """Return the state that follows from ``placement``; None if struts are nearly singular."""
    constraints = regular_constraints(chains, placement, regular)
    if constraints is None:
        return None
    values = placement.joint_values
    return State(
        chains, placement.pose, values, values[chains.places], placement.openings, constraints,
        regular,
    )


def state_by_definition(
    chains: Chains,
    pose: FloatArray,
    joint_values: FloatArray,
    regular: RegularStruts | None = None,
) -> State:
    """Return the state at ``pose`` (4, 4) and ``joint_values`` (s, k), strut by strut."""
    screws, tips = forward_kinematics(chains, joint_values, pose[:3, 3])
    constraints = strut_constraints(chains, screws, len(chains.places[0]))
    if regular is not None:
        # What fills the gaps of the screws may only have turned too far from where it was made.
        found = regular.with_filling(constraints.structure, constraints.structure_strut)
        regular = found or regular
    return State(
        chains,
        pose,
        joint_values,
        joint_values[chains.places],
        difference(pose, tips) * chains.scale,
        constraints,
        regular,
    )
