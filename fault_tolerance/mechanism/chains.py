# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The struts as padded arrays, and their forward kinematics, all struts at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.regular import RegularStruts, regular_struts
from fault_tolerance.mechanism.screws import (
    BASE_ORIGIN,
    joint_displacements,
    moved_to,
    powers,
    transformed,
)


@dataclass(frozen=True, eq=False)
class Chains:
    """A mechanism's s struts, padded to k joints each with joints that do nothing.

    Attributes
    ----------
    screws : (s, k, 6) array
        Joint twists at home, base axes, v at the base origin; zero where padded.
    powers : (3, s, k, 4, 4) array
        First three powers of the screws' matrices.
    actuator : (s, k) int array
        The place of the joint's actuator in the mechanism's order, -1 where it has none.
    real : (s, k) bool array
        False where padded.
    scale : (6,) array
        The metric of twists: rotations times the characteristic length, translations as is.
    home : (4, 4) array
        The platform frame at home.
    """

    screws: FloatArray
    powers: FloatArray
    actuator: IntArray
    real: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    scale: FloatArray
    home: FloatArray

    @cached_property
    def active(self) -> FloatArray:
        """1 at actuated joints, else 0, (s, k)."""
        return (self.actuator >= 0).astype(np.float64)

    @cached_property
    def passive(self) -> FloatArray:
        """1 at joints without a drive, else 0, (s, k)."""
        return (self.real & (self.actuator < 0)).astype(np.float64)

    @cached_property
    def places(self) -> tuple[IntArray, IntArray]:
        """Strut and joint of each actuator, (N,) each."""
        strut, joint = np.nonzero(self.actuator >= 0)
        order = np.argsort(self.actuator[strut, joint])
        return strut[order], joint[order]

    @cached_property
    def length(self) -> float:
        """The characteristic length, metres."""
        return float(self.scale[0])

    @cached_property
    def drive_sizes(self) -> FloatArray:
        """Metres at home per unit of each actuated joint, (N,): the lengths of its screws."""
        at_home = moved_to(self.screws[self.places], self.home[:3, 3]) * self.scale
        return np.asarray(np.linalg.norm(at_home, axis=1))

    @cached_property
    def regular(self) -> RegularStruts | None:
        """The same struts prepared for the short way; None if some are not regular."""
        origin = self.home[:3, 3]
        return regular_struts(self.screws, self.real, self.places, self.length, origin)


@lru_cache(maxsize=64)
def chains_of(mechanism: Mechanism) -> Chains:
    """Return the struts of ``mechanism`` as `Chains` (kept: mechanisms do not change)."""
    longest = max(len(strut.joints) for strut in mechanism.struts)
    shape = (len(mechanism.struts), longest)
    screws = np.zeros((*shape, 6))
    actuator = np.full(shape, -1, dtype=np.intp)
    real = np.zeros(shape, dtype=np.bool_)
    place = {name: index for index, name in enumerate(mechanism.actuator_names)}
    for i, strut in enumerate(mechanism.struts):
        for j, joint in enumerate(strut.joints):
            screws[i, j] = joint.screw
            real[i, j] = True
            if joint.actuator is not None:
                actuator[i, j] = place[joint.actuator.name]
    scale = np.ones(6)
    scale[:3] = mechanism.characteristic_length
    home = np.eye(4)
    home[:3, 3] = mechanism.origin
    screw_powers = powers(screws)
    for array in (screws, screw_powers, actuator, real, scale, home):
        array.setflags(write=False)
    return Chains(screws, screw_powers, actuator, real, scale, home)


def forward_kinematics(
    chains: Chains, joint_values: FloatArray, point: FloatArray = BASE_ORIGIN
) -> tuple[FloatArray, FloatArray]:
    """Return where the joints and the tips of all struts are (product of exponentials).

    Parameters
    ----------
    chains : Chains
    joint_values : (s, k) array
        Radians and metres from home.
    point : (3,) array
        Where the velocity of twists is measured, metres, base axes; their origin by default.

    Returns
    -------
    screws : (s, k, 6) array
        Joint twists at the present configuration, base axes, v at ``point``.
    tips : (s, 4, 4) array
        The platform frame as each strut alone would have it.
    """
    steps = joint_displacements(chains.powers, joint_values)
    count, length = joint_values.shape
    before = np.empty((count, length + 1, 4, 4))
    before[:, 0] = np.eye(4)
    for j in range(length):
        before[:, j + 1] = before[:, j] @ steps[:, j]
    return transformed(before[:, :-1], chains.screws, point), before[:, -1] @ chains.home
