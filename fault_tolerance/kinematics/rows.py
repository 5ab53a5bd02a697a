# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The door between mechanism and kinematics: plain arrays with names.

Every strut says ``L V = L S_a q'_a`` of the platform twist and its drives, and nothing more
(docs/theory.md, section 2). A failure moves, adds or drops rows of this stack; no kinematics
beyond it is ever needed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.configuration import Configuration, home_configuration
from fault_tolerance.mechanism.constraints import DriveRows, StrutConstraints
from fault_tolerance.mechanism.description import Mechanism


@dataclass(frozen=True, eq=False)
class StrutRows:
    """What all struts say, at one configuration.

    The twist has d = 6 components, scaled (rotations times the characteristic length, so metres
    per second throughout). For a mechanism given by numbers it is the task velocity, d = l,
    scaled to the size of the actuator rates.

    Attributes
    ----------
    mechanism : Mechanism
    constraints : StrutConstraints
        The rows themselves.
    twist_scale : (d,) array
        The scaled twist is this times the twist.
    rate_scale : (N,) array
        Turns actuator rates into metres per second.
    task_rows : (l,) int array
        The components of the twist that are the task, in the task's order.
    compliance : float
        Structural constraints up to this singular value are absorbed.
    """

    mechanism: Mechanism
    constraints: StrutConstraints
    twist_scale: FloatArray
    rate_scale: FloatArray
    task_rows: IntArray
    compliance: float

    @property
    def structure(self) -> FloatArray:
        """``0 = structure @ twist``, (g, d), orthonormal within each strut."""
        return self.constraints.structure

    @property
    def structure_strut(self) -> IntArray:
        """Index of the strut each structural row belongs to, (g,)."""
        return self.constraints.structure_strut

    @property
    def actuator_rows(self) -> FloatArray | None:
        """``q'_a = actuator_rows @ twist``, (N, d), where every strut determines its drives well.

        None elsewhere.
        """
        return self.constraints.actuator_rows

    @property
    def drive(self) -> FloatArray:
        """``drive @ twist = drive_rates @ q'_a``, (a, d), with the actuators' true rates."""
        return self.constraints.drives.drive

    @property
    def drive_rates(self) -> FloatArray:
        """See `drive`, (a, N)."""
        return self.constraints.drives.rates

    @property
    def drive_strut(self) -> IntArray:
        """Index of the strut each drive row belongs to, (a,); -1 where there are no struts."""
        return self.constraints.drives.struts

    def with_compliance(self, compliance: float) -> StrutRows:
        """Return the same rows, judged with another ``compliance``."""
        return replace(self, compliance=compliance)

    def in_metres(self) -> StrutRows:
        """Return the same rows for rates and twists in metres per second.

        What follows from them, the measures among it, does not depend on the units of drives
        and task, as it does where some drives turn and others slide.
        """
        return replace(
            self,
            constraints=self.constraints.with_rates_times(self.rate_scale),
            rate_scale=np.ones_like(self.rate_scale),
            twist_scale=np.ones_like(self.twist_scale),
        )


def strut_rows(configuration: Configuration) -> StrutRows:
    """Return the rows of all struts at ``configuration``, lost or not."""
    mechanism = configuration.mechanism
    if mechanism.working_point is not None:
        return _rows_by_numbers(mechanism)
    return StrutRows(
        mechanism,
        configuration.constraints,
        chains_of(mechanism).scale,
        mechanism.rate_scale,
        mechanism.task.rows,
        mechanism.compliance,
    )


def home_rows(mechanism: Mechanism) -> StrutRows:
    """Return the rows of all struts at home."""
    return strut_rows(home_configuration(mechanism))


def _rows_by_numbers(mechanism: Mechanism) -> StrutRows:
    """Return rows with the solutions ``v = J x, q'_a = T x``: v = J T^t q'_a, q'_a in range T."""
    point = mechanism.working_point
    assert point is not None
    jacobian, mapping = point.jacobian, point.mapping
    count, task = len(mapping), len(jacobian)
    outside = np.eye(count) - mapping @ mapping.T
    # Whatever the units of the task velocity, it is scaled to the size of the actuator rates.
    size = float(np.linalg.norm(jacobian, 2))
    size = size if size > 0.0 else 1.0
    none = np.zeros(0, dtype=np.intp)
    drives = DriveRows(
        np.vstack([np.eye(task), np.zeros((count, task))]),
        np.vstack([jacobian @ mapping.T / size, outside]),
        np.full(task + count, -1, dtype=np.intp),
        np.zeros((0, 0, task)),
    )
    return StrutRows(
        mechanism,
        StrutConstraints(np.zeros((0, task)), none, None, lambda: drives),
        np.full(task, 1.0 / size),
        np.ones(count),
        np.arange(task, dtype=np.intp),
        0.0,
    )
