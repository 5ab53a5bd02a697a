# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism known by its Jacobian and its mapping matrix at one working point only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray, frozen_array
from fault_tolerance.mechanism.linear_algebra import singular_values
from fault_tolerance.tolerances import RANK_TOLERANCE


@dataclass(frozen=True, eq=False)
class WorkingPoint:
    """The differential kinematics of a mechanism of which nothing else is known."""

    jacobian: FloatArray
    """(l, n): task velocity per unit reduced rate, rows in the task's order."""
    mapping: FloatArray
    """(N, n): actuator rates per unit reduced rate; its columns are independent, and made
    orthonormal here (together with the jacobian, so that ``v = J T^+ q'`` is unchanged)."""

    def __repr__(self) -> str:
        (task, mobility), count = self.jacobian.shape, len(self.mapping)
        return f'WorkingPoint(J {task} x {mobility}, T {count} x {mobility})'

    def __post_init__(self) -> None:
        """Check that the two belong together, and orthonormalise the columns."""
        jacobian = frozen_array(self.jacobian, (None, None), 'jacobian')
        mapping = frozen_array(self.mapping, (None, None), 'mapping')
        if jacobian.shape[1] != mapping.shape[1]:
            reason = f'has {mapping.shape[1]} columns, the jacobian {jacobian.shape[1]}'
            raise MechanismError('working point', 'mapping', reason)
        if mapping.shape[0] < mapping.shape[1]:
            reason = f'is {mapping.shape[0]} x {mapping.shape[1]}: more columns than actuators'
            raise MechanismError('working point', 'mapping', reason)
        gram = mapping.T @ mapping
        if not np.allclose(gram, np.eye(len(gram)), rtol=0.0, atol=1e-14):
            sigma = singular_values(mapping)
            if sigma.min(initial=np.inf) <= RANK_TOLERANCE * sigma.max(initial=0.0):
                raise MechanismError('working point', 'mapping', 'has dependent columns')
            basis, triangle = np.linalg.qr(mapping)
            jacobian = np.linalg.solve(triangle.T, jacobian.T).T
            mapping = basis
        object.__setattr__(self, 'jacobian', frozen_array(jacobian, (None, None), 'jacobian'))
        object.__setattr__(self, 'mapping', frozen_array(mapping, (None, None), 'mapping'))
