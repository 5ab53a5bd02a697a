# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Theorem 1 in the paper's own form, from loop-closure Jacobians.

Independent of the row form: loops are chosen (every strut against the first), all joints are
unknowns, and J, T, J_xi follow from equations (3) to (5) of the paper. Rigid: compliance has no
place in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.subspaces import null_space
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.configuration import Configuration
from fault_tolerance.tolerances import RANK_TOLERANCE


@dataclass(frozen=True, eq=False)
class LoopJacobians:
    """The task and the loops in terms of actuator and passive joint rates (theory, eq. 3-4)."""

    task_active: FloatArray
    """(6, N): J_Ta: platform twist through the first strut."""
    task_passive: FloatArray
    """(6, P): J_Tp."""
    loop_active: FloatArray
    """(c, N): J_Ca: 0 = J_Ca q'_a + J_Cp q'_p."""
    loop_passive: FloatArray
    """(c, P): J_Cp."""

    def __repr__(self) -> str:
        loops, active = self.loop_active.shape
        return f'LoopJacobians({loops} loop equations, {active} actuators)'


def loop_jacobians(configuration: Configuration) -> LoopJacobians:
    """Return the loop-closure Jacobians at ``configuration``, all struts attached.

    Twists are scaled (rotations times the characteristic length), so that ranks can be judged.
    MechanismError for a mechanism given by its Jacobian.
    """
    mechanism, state = configuration.mechanism, configuration.state
    if state is None:
        reason = 'a mechanism given by its Jacobian has no loops'
        raise MechanismError(mechanism.name, 'struts', reason)
    chains = chains_of(mechanism)
    columns = np.swapaxes(state.screws, 1, 2) * chains.scale[:, None]
    count, struts = len(mechanism.actuators), len(mechanism.struts)
    passive = np.argwhere(chains.real & (chains.actuator < 0))
    by_actuator = np.zeros((struts, 6, count))
    by_passive = np.zeros((struts, 6, len(passive)))
    for strut, joint in np.argwhere(chains.actuator >= 0):
        by_actuator[strut, :, chains.actuator[strut, joint]] = columns[strut, :, joint]
    for place, (strut, joint) in enumerate(passive):
        by_passive[strut, :, place] = columns[strut, :, joint]
    # A serial arm is one strut without a loop, and may have no passive joint either.
    loops = 6 * (struts - 1)
    return LoopJacobians(
        frozen(by_actuator[0]),
        frozen(by_passive[0]),
        frozen((by_actuator[0] - by_actuator[1:]).reshape(loops, count)),
        frozen((by_passive[0] - by_passive[1:]).reshape(loops, len(passive))),
    )


def theorem_1(loops: LoopJacobians) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return J (6, n), T (N, n) and J_xi (6, k) of the whole twist, scaled as ``loops`` is.

    Paper, Theorem 1: ``T`` spans the null space of ``L J_Ca`` with L the left annihilator of
    J_Cp; ``J = (J_Ta - J_Tp J_Cp^+ J_Ca) T``; ``J_xi = J_Tp N`` with N a basis of the null space
    of J_Cp.
    """
    annihilator = null_space(loops.loop_passive.T).T
    mapping = null_space(annihilator @ loops.loop_active, 1.0)
    inverse = np.linalg.pinv(loops.loop_passive, rcond=RANK_TOLERANCE)
    jacobian = loops.task_active - loops.task_passive @ inverse @ loops.loop_active
    return jacobian @ mapping, mapping, loops.task_passive @ null_space(loops.loop_passive)
