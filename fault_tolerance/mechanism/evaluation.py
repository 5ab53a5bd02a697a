# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The state of a mechanism: a pose, joint values, and everything that follows from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.chains import chains_of, forward_kinematics
from fault_tolerance.mechanism.constraints import StrutConstraints, strut_constraints
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.freedom import Attachment, Structure
from fault_tolerance.mechanism.screws import difference


@dataclass(frozen=True, eq=False)
class State:
    """A pose, joint values, and everything that follows from them."""

    pose: FloatArray
    """(4, 4): the platform frame in base axes."""
    joint_values: FloatArray
    """(s, k): radians and metres from home, zero where padded."""
    actuator_values: FloatArray
    """(N,): the actuated ones, in the mechanism's order."""
    openings: FloatArray
    """(s, 6): from each strut's tip to the platform, scaled: metres."""
    screws: FloatArray
    """(s, k, 6): joint twists, base axes, v at the platform's origin."""
    constraints: StrutConstraints

    def __repr__(self) -> str:
        return f'State({len(self.joint_values)} struts, {len(self.actuator_values)} actuators)'

    def residuals(self, structure: Structure, attachment: Attachment) -> tuple[float, float]:
        """Return what is open outside, and along, the absorbed directions, in metres.

        ``structure`` tells which directions are absorbed, ``attachment`` which struts count.
        """
        misclosure = np.einsum('ij,ij->i', structure.rows, self.openings[structure.struts])
        left = structure.left[:, : structure.kept]
        strain = misclosure - left @ (left.T @ misclosure)
        rest = np.where(attachment.attached[:, None], self.openings, 0.0)
        np.subtract.at(rest, structure.struts, structure.rows * strain[:, None])
        return float(np.linalg.norm(rest)), float(np.linalg.norm(strain))


def evaluated(mechanism: Mechanism, pose: FloatArray, joint_values: FloatArray) -> State:
    """Return the state of ``mechanism`` at ``pose`` (4, 4) and ``joint_values`` (s, k)."""
    chains = chains_of(mechanism)
    screws, tips = forward_kinematics(chains, joint_values, pose[:3, 3])
    return State(
        frozen(pose),
        frozen(joint_values),
        frozen(joint_values[chains.places]),
        frozen(difference(pose, tips) * chains.scale),
        frozen(screws),
        strut_constraints(chains, screws, mechanism.rate_scale),
    )


def home_state(mechanism: Mechanism) -> State:
    """Return the state of ``mechanism`` at home."""
    chains = chains_of(mechanism)
    return evaluated(mechanism, chains.home, np.zeros(chains.real.shape))
