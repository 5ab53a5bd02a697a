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
from fault_tolerance.mechanism.configuration import Configuration, home_configuration
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
    structure : (g, d) array
        ``0 = structure @ twist``, orthonormal within each strut.
    structure_strut : (g,) int array
        Index of the strut each structural row belongs to.
    drive : (a, d) array
        ``drive @ twist = drive_rates @ q'_a``, with the actuators' true rates.
    drive_rates : (a, N) array
    drive_strut : (a,) int array
        Index of the strut each drive row belongs to; -1 where there are no struts.
    actuator_rows : (N, d) array or None
        ``q'_a = actuator_rows @ twist`` where every strut determines its drives well, else None.
    decomposition : tuple of arrays or None
        Singular values and right directions of the whole structure, if known already.
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
    structure: FloatArray
    structure_strut: IntArray
    drive: FloatArray
    drive_rates: FloatArray
    drive_strut: IntArray
    actuator_rows: FloatArray | None
    decomposition: tuple[FloatArray, FloatArray] | None
    twist_scale: FloatArray
    rate_scale: FloatArray
    task_rows: IntArray
    compliance: float

    def with_compliance(self, compliance: float) -> StrutRows:
        """Return the same rows, judged with another ``compliance``."""
        return replace(self, compliance=compliance)

    def in_metres(self) -> StrutRows:
        """Return the same rows for rates and twists in metres per second.

        What follows from them, the measures among it, does not depend on the units of drives
        and task, as it does where some drives turn and others slide.
        """
        rows = self.actuator_rows
        return replace(
            self,
            drive_rates=self.drive_rates / self.rate_scale,
            actuator_rows=None if rows is None else rows * self.rate_scale[:, None],
            rate_scale=np.ones_like(self.rate_scale),
            twist_scale=np.ones_like(self.twist_scale),
        )


def strut_rows(configuration: Configuration) -> StrutRows:
    """Return the rows of all struts at ``configuration``, lost or not."""
    mechanism = configuration.mechanism
    if mechanism.working_point is not None:
        return _rows_by_numbers(mechanism)
    constraints = configuration.constraints
    length = mechanism.characteristic_length
    twist_scale = np.ones(6)
    twist_scale[:3] = length
    revolute = [actuator.kind == 'revolute' for actuator in mechanism.actuators]
    return StrutRows(
        mechanism,
        constraints.structure,
        constraints.structure_strut,
        constraints.drive,
        constraints.drive_rates,
        constraints.drive_strut,
        constraints.actuator_rows,
        constraints.decomposition[1:],
        twist_scale,
        np.where(revolute, length, 1.0),
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
    return StrutRows(
        mechanism,
        np.zeros((0, task)),
        none,
        np.vstack([np.eye(task), np.zeros((count, task))]),
        np.vstack([jacobian @ mapping.T / size, outside]),
        np.full(task + count, -1, dtype=np.intp),
        None,
        None,
        np.full(task, 1.0 / size),
        np.ones(count),
        np.arange(task, dtype=np.intp),
        0.0,
    )
