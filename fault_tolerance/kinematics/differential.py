# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Differential kinematics (Theorem 1) from rows, before and after any failures.

``v = J q' + J_xi xi`` with the actuator rates ``q'_a = T q'`` (docs/theory.md, eq. 1-2). A
position failure adds the row ``q'_j = 0``; a torque failure takes j out of the rows of which T
is made; a hard failure drops the strut's rows. Always from the nominal rows, never chained.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.subspaces import null_space, rank_of
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen
from fault_tolerance.mechanism.freedom import attachment_of
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.mechanism.task import Task
from fault_tolerance.tolerances import ROUNDING_TOLERANCE


@dataclass(frozen=True, eq=False)
class DifferentialKinematics:
    """J and T of a manipulator at one configuration, with what comes along.

    J and T are unique only up to an orthogonal matrix on the right.
    """

    task: Task
    jacobian: FloatArray
    """(l, n): task velocity per unit reduced rate, rows in the task's order."""
    mapping: FloatArray
    """(N, n): actuator rates per unit reduced rate: orthonormal columns; zero rows for actuators
    that are stuck, free or lost."""
    twist_jacobian: FloatArray
    """(d, n): the whole platform twist per unit reduced rate, ``[w; v]`` at the platform's origin
    in base axes (d = 6; for a mechanism given by its Jacobian the task, d = l)."""
    rate_map: FloatArray
    """(N, n): all actuators' motion per unit reduced rate: `mapping`, and for free actuators how
    they follow."""
    unactuated: FloatArray
    """(d, k): basis of the platform twists that happen with every drive at rest (J_xi, all rows);
    k = 0 for a stable manipulator."""
    active: BoolArray
    """(N,): the actuators that still drive."""
    absorbed: int
    """Number of structural constraints that the compliance absorbs."""
    weakest_kept: float
    """Smallest singular value of the structural constraints that count; infinite if none."""

    def __repr__(self) -> str:
        count, mobility = self.mapping.shape
        stable = 'stable' if self.stable else 'not stable'
        return f'DifferentialKinematics(J {len(self.jacobian)} x {mobility}, T {count} x ' \
               f'{mobility}, {stable})'

    @property
    def mobility(self) -> int:
        """Number n of reduced rates, the degrees of freedom the drives control."""
        return int(self.mapping.shape[1])

    @property
    def stable(self) -> bool:
        """Whether every motion of the platform is controlled by the drives."""
        return bool(self.unactuated.shape[1] == 0)

    @cached_property
    def major(self) -> FloatArray:
        """J_m, (m, n): the rows of the major coordinates."""
        return frozen(self.jacobian[self.task.major_rows])

    @cached_property
    def secondary(self) -> FloatArray:
        """J_s, (l - m, n): the rows of the secondary coordinates."""
        return frozen(self.jacobian[self.task.secondary_rows])


def differential_kinematics(
    rows: StrutRows, failures: FailureSet | None = None
) -> DifferentialKinematics:
    """Return J, T and J_xi with ``failures`` present (Theorem 1; docs/theory.md, eq. 8-10).

    From the nominal ``rows`` of the complete mechanism; FailureError if it does not have what
    failed.
    """
    mechanism = rows.mechanism
    failures = (failures or FailureSet()).of(mechanism)
    attachment = attachment_of(mechanism, failures.lost)
    structure = rows.structure_of(attachment)
    stuck = [mechanism.actuator_index(name) for name in failures.stuck]
    free = [mechanism.actuator_index(name) for name in failures.free]
    active = attachment.held.copy()
    active[stuck + free] = False
    # Motions are unit vectors, so rates are compared with 1: a drive that does not move at all
    # is not mistaken for a slow one.
    twists, rates = rows.motions(attachment)
    unlocked = null_space(rates[stuck], 1.0)
    twists, rates = twists @ unlocked, rates @ unlocked

    _, sigma, right = decomposed(rates[active])
    rank = rank_of(sigma, 1.0)
    twist_scale, rate_scale = rows.twist_scale[:, None], rows.rate_scale[:, None]
    unactuated = _independent(twists @ right[rank:].T) / twist_scale
    rates = rates / rate_scale
    if rank < twists.shape[1]:
        # What the drives do not determine is chosen as the shortest motion, in the units of the
        # mechanism: that needs an orthonormal basis in these units.
        basis, _ = np.linalg.qr(np.vstack([twists / twist_scale, rates]))
        twists, rates = twist_scale * basis[: len(twists)], basis[len(twists) :]
    left, sigma, right = decomposed(rates[active])
    per_rate = right[:rank].T / sigma[:rank]
    rate_map = rates @ per_rate
    rate_map[active] = left[:, :rank]
    rate_map[stuck] = rate_map[~attachment.held] = 0.0
    mapping = np.where(active[:, None], rate_map, 0.0)
    scaled = _without_noise(twists @ per_rate, mapping * rate_scale)
    twist_jacobian = frozen(scaled / twist_scale)
    return DifferentialKinematics(
        mechanism.task,
        frozen(twist_jacobian[rows.task_rows]),
        frozen(mapping),
        twist_jacobian,
        frozen(rate_map),
        frozen(unactuated),
        frozen(active),
        rank_of(structure.sigma) - structure.kept,
        float(structure.sigma[structure.kept - 1]) if structure.kept else np.inf,
    )


def _without_noise(scaled: FloatArray, rates: FloatArray) -> FloatArray:
    """Return J (d, n), scaled, with 0 for the coordinates that the drives do not move.

    Otherwise rounding errors would pass for motion where there is nothing to compare them with.
    """
    size = max(float(np.linalg.norm(rates)), float(np.linalg.norm(scaled)))
    moved = np.linalg.norm(scaled, axis=1) > ROUNDING_TOLERANCE * size
    return np.where(moved[:, None], scaled, 0.0)


def _independent(twists: FloatArray) -> FloatArray:
    """Return a basis of scaled platform twists (d, k); motions inside the struts drop out."""
    left, sigma, _ = decomposed(twists)
    # The motions are unit vectors together with their actuator rates: they are compared with 1.
    return left[:, : rank_of(sigma, 1.0)]
