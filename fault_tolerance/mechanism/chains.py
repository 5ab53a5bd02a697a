# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The struts as padded arrays, and their forward kinematics, all struts at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.screws import BASE_ORIGIN, joint_displacements, powers, transformed


@dataclass(frozen=True, eq=False)
class Chains:
    """A mechanism's s struts, padded to k joints each with joints that do nothing."""

    screws: FloatArray
    """(s, k, 6): joint twists at home, base axes, v at the base origin; zero where padded."""
    powers: FloatArray
    """(3, s, k, 4, 4): first three powers of the screws' matrices."""
    actuator: IntArray
    """(s, k): the place of the joint's actuator in the mechanism's order, -1 where it has none."""
    real: BoolArray
    """(s, k): whether there is such a joint."""
    scale: FloatArray
    """(6,): the metric of twists: the characteristic length for rotations, 1 for translations."""
    home: FloatArray
    """(4, 4): the platform frame at home."""

    @cached_property
    def places(self) -> tuple[IntArray, IntArray]:
        """Strut and joint of each actuator, (N,) each."""
        strut, joint = np.nonzero(self.actuator >= 0)
        order = np.argsort(self.actuator[strut, joint])
        return frozen(strut[order]), frozen(joint[order])

    def __repr__(self) -> str:
        return f'Chains({self.real.shape[0]} struts of up to {self.real.shape[1]} joints)'


@lru_cache(maxsize=64)
def chains_of(mechanism: Mechanism) -> Chains:
    """Return the struts of ``mechanism`` as `Chains` (kept: mechanisms do not change)."""
    longest = max((len(strut.joints) for strut in mechanism.struts), default=0)
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
    return Chains(
        frozen(screws), frozen(powers(screws)), frozen(actuator), frozen(real), frozen(scale),
        frozen(home),
    )


def forward_kinematics(
    chains: Chains, joint_values: FloatArray, point: FloatArray = BASE_ORIGIN
) -> tuple[FloatArray, FloatArray]:
    """Return where the joints and the tips of all struts are (product of exponentials).

    At ``joint_values`` (s, k) of ``chains``, radians and metres from home: the joint twists
    (s, k, 6) in base axes with v at ``point`` (3,), and the platform frame as each strut alone
    would have it (s, 4, 4).
    """
    steps = joint_displacements(chains.powers, joint_values)
    count, length = joint_values.shape
    before = np.empty((count, length + 1, 4, 4))
    before[:, 0] = np.eye(4)
    for j in range(length):
        before[:, j + 1] = before[:, j] @ steps[:, j]
    return transformed(before[:, :-1], chains.screws, point), before[:, -1] @ chains.home
