# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The door between mechanism and kinematics: plain arrays with names.

Every strut says ``0 = G V`` and ``q'_a = A V + N xi`` of the platform twist and its drives, and
nothing more (docs/theory.md, section 2). A failure moves, adds or drops rows of this stack; no
kinematics beyond it is ever needed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray, frozen
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.configuration import Configuration, home_configuration
from fault_tolerance.mechanism.constraints import StrutConstraints
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.freedom import Attachment, Structure, motions, structure_of


@dataclass(frozen=True, eq=False)
class StrutRows:
    """What all struts say, at one configuration.

    The twist has d = 6 components, scaled (rotations times the characteristic length, so metres
    per second throughout). For a mechanism given by its Jacobian it is the task velocity, d = l,
    scaled to the size of the actuator rates.
    """

    configuration: Configuration
    """Where they hold."""
    constraints: StrutConstraints
    """The rows themselves; none for a mechanism given by its Jacobian."""
    twist_scale: FloatArray
    """(d,): the scaled twist is this times the twist."""
    rate_scale: FloatArray
    """(N,): turns actuator rates into metres per second."""
    task_rows: IntArray
    """(l,): the components of the twist that are the task, in the task's order."""
    compliance: float
    """Structural constraints up to this singular value are absorbed."""
    given: tuple[FloatArray, FloatArray] | None = None
    """Scaled twists (d, n) and actuator rates (N, n) of a mechanism given by its Jacobian."""

    def __repr__(self) -> str:
        return f'StrutRows({self.mechanism.name!r}, {len(self.structure)} structural rows)'

    @property
    def mechanism(self) -> Mechanism:
        """Whose rows they are."""
        return self.configuration.mechanism

    @property
    def structure(self) -> FloatArray:
        """``0 = structure @ twist``, (g, d), orthonormal within each strut."""
        return self.constraints.structure

    @property
    def structure_strut(self) -> IntArray:
        """Index of the strut each structural row belongs to, (g,)."""
        return self.constraints.structure_strut

    @property
    def actuator_rows(self) -> FloatArray:
        """``q'_a = actuator_rows @ twist``, (N, d), but for drives in series that move alone.

        Zero for a mechanism given by its Jacobian.
        """
        return self.constraints.actuator_rows

    def structure_of(self, attachment: Attachment) -> Structure:
        """Return the structural rows of the struts that ``attachment`` leaves, decomposed."""
        return structure_of(self.constraints, attachment, self.compliance)

    def motions(self, attachment: Attachment) -> tuple[FloatArray, FloatArray]:
        """Return all motions that the struts of ``attachment`` allow (docs/theory.md, eq. 8).

        Scaled twists (d, c) and actuator rates (N, c), all in metres per second.
        """
        if self.given is not None:
            return self.given
        allowed = self.structure_of(attachment).allowed
        return motions(self.constraints, attachment, allowed)

    def in_space(self, twists: FloatArray) -> FloatArray:
        """Return scaled ``twists`` (d, c) as such of all six components, (6, c), in metres.

        Of a mechanism given by its Jacobian those that are no task are zero.
        """
        if self.given is None:
            return twists
        chosen, whole = self.mechanism.task.rows, np.zeros((6, twists.shape[1]))
        lengths = chains_of(self.mechanism).scale[chosen] / self.twist_scale
        whole[chosen] = lengths[:, None] * twists
        return whole

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
            constraints=self.constraints.in_metres(),
            rate_scale=frozen(np.ones_like(self.rate_scale)),
            twist_scale=frozen(np.ones_like(self.twist_scale)),
        )


def strut_rows(configuration: Configuration) -> StrutRows:
    """Return the rows of all struts at ``configuration``, lost or not."""
    mechanism = configuration.mechanism
    if mechanism.working_point is not None:
        return _rows_by_jacobian(configuration)
    return StrutRows(
        configuration, configuration.constraints, chains_of(mechanism).scale,
        mechanism.rate_scale, mechanism.task.rows, mechanism.compliance,
    )


def home_rows(mechanism: Mechanism) -> StrutRows:
    """Return the rows of all struts of ``mechanism`` at home."""
    return strut_rows(home_configuration(mechanism))


def _rows_by_jacobian(configuration: Configuration) -> StrutRows:
    """Return rows whose motions are ``v = J x, q'_a = T x``."""
    mechanism = configuration.mechanism
    point = mechanism.working_point
    assert point is not None
    task, count = len(point.jacobian), len(point.mapping)
    # Whatever the units of the task velocity, it is scaled to the size of the actuator rates.
    size = float(np.linalg.norm(point.jacobian, 2)) or 1.0
    none = frozen(np.zeros(0, dtype=np.intp))
    constraints = StrutConstraints(
        frozen(np.zeros((0, task))), none, frozen(np.zeros((count, task))),
        frozen(np.zeros((count, 0))), none, mechanism.rate_scale,
    )
    return StrutRows(
        configuration,
        constraints,
        frozen(np.full(task, 1.0 / size)),
        mechanism.rate_scale,
        frozen(np.arange(task, dtype=np.intp)),
        0.0,
        (frozen(point.jacobian / size), frozen(point.mapping * mechanism.rate_scale[:, None])),
    )
