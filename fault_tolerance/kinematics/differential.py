# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Differential kinematics (Theorem 1) from rows, before and after any failures.

``v = J q' + J_xi xi`` with the actuator rates ``q'_a = T q'`` (docs/theory.md, eq. 1-2). A
position failure adds the row ``q'_j = 0``; a torque failure takes j out of the rows of which T
is made; a hard failure drops the strut's rows. Always from the nominal rows, never chained.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.subspaces import null_space, rank_of
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.closure import absorption_threshold
from fault_tolerance.mechanism.constraints import decomposed
from fault_tolerance.mechanism.task import Task
from fault_tolerance.mechanism.tolerances import ROUNDING_TOLERANCE


@dataclass(frozen=True, eq=False)
class DifferentialKinematics:
    """J and T of a manipulator at one configuration, with what comes along.

    J and T are unique only up to an orthogonal matrix on the right.

    Attributes
    ----------
    task : Task
    jacobian : (l, n) array
        Task velocity per unit reduced rate, rows in the task's order.
    mapping : (N, n) array
        Actuator rates per unit reduced rate: orthonormal columns; zero rows for actuators that
        are stuck, free or lost.
    twist_jacobian : (d, n) array
        The whole platform twist per unit reduced rate, ``[w; v]`` at the platform's origin in
        base axes (d = 6; for a mechanism given by numbers the task, d = l).
    rate_map : (N, n) array
        All actuators' motion per unit reduced rate: `mapping`, and for free actuators how they
        follow.
    unactuated : (d, k) array
        Basis of the platform twists that happen with every drive at rest (J_xi, all rows);
        k = 0 for a stable manipulator.
    active : (N,) bool array
        The actuators that still drive.
    absorbed : int
        Number of structural constraints that the compliance absorbs.
    weakest_kept : float
        Smallest singular value of the structural constraints that count; infinite if none.
    """

    task: Task
    jacobian: FloatArray
    mapping: FloatArray
    twist_jacobian: FloatArray
    rate_map: FloatArray
    unactuated: FloatArray
    active: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    absorbed: int
    weakest_kept: float

    @property
    def mobility(self) -> int:
        """Number n of reduced rates, the degrees of freedom the drives control."""
        return int(self.mapping.shape[1])

    @property
    def stable(self) -> bool:
        """Whether every motion of the platform is controlled by the drives."""
        return bool(self.unactuated.shape[1] == 0)

    @property
    def major(self) -> FloatArray:
        """J_m, (m, n): the rows of the major coordinates."""
        return self.jacobian[self.task.major_rows]

    @property
    def secondary(self) -> FloatArray:
        """J_s, (l - m, n): the rows of the secondary coordinates."""
        return self.jacobian[self.task.secondary_rows]

    @property
    def active_mapping(self) -> FloatArray:
        """T without the zero rows of failed actuators."""
        return self.mapping[self.active]


def differential_kinematics(
    rows: StrutRows, failures: FailureSet | None = None
) -> DifferentialKinematics:
    """Return J, T and J_xi with ``failures`` present (Theorem 1; docs/theory.md, eq. 8-10).

    Parameters
    ----------
    rows : StrutRows
        The nominal rows, of the complete mechanism.
    failures : FailureSet, optional
        Nothing by default.
    """
    failures = failures or FailureSet()
    mechanism = rows.mechanism
    held = np.array([actuator.strut not in failures.lost for actuator in mechanism.actuators])
    stuck = np.array([name in failures.stuck for name in mechanism.actuator_names])
    free = np.array([name in failures.free for name in mechanism.actuator_names])
    active = held & ~stuck & ~free
    attached = np.array([name not in failures.lost for name in mechanism.strut_names], dtype=bool)

    compatible, absorbed, weakest = _compatible_twists(rows, attached)
    twists, rates = _motions(rows, compatible, attached, held)
    # Motions are unit vectors in metres per second: rates are small or not compared with that,
    # so that a drive which does not move at all is not mistaken for a slow one.
    scale = max(1.0, float(np.linalg.norm(rates * rows.rate_scale[:, None])))
    if stuck.any():
        unlocked = null_space(rates[stuck] * rows.rate_scale[stuck, None], scale)
        twists, rates = twists @ unlocked, rates @ unlocked
        rates[stuck] = 0.0

    # Columns of [twists; rates] span every motion; those the drives feel make T.
    left, sigma, right = _decomposed(rates[active])
    rank = rank_of(sigma, scale)
    unactuated = _independent(twists @ right[rank:].T) / rows.twist_scale[:, None]
    twists = twists / rows.twist_scale[:, None]
    if rank < twists.shape[1]:
        # What the drives do not determine is chosen as the shortest motion, which needs an
        # orthonormal basis to have a meaning. The rank was decided above, whatever the units.
        basis, _ = np.linalg.qr(np.vstack([twists, rates]))
        twists, rates = basis[: len(twists)], basis[len(twists) :]
        left, sigma, right = _decomposed(rates[active])
    per_rate = right[:rank].T / sigma[:rank]
    mapping = np.zeros((len(rates), rank))
    mapping[active] = left[:, :rank]
    rate_map = rates @ per_rate
    rate_map[active] = left[:, :rank]
    twist_jacobian = _without_noise(twists @ per_rate, mapping, rows)
    return DifferentialKinematics(
        mechanism.task,
        twist_jacobian[rows.task_rows],
        mapping,
        twist_jacobian,
        rate_map,
        unactuated,
        active,
        absorbed,
        weakest,
    )


def compatible_twists(
    rows: StrutRows, attached: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
) -> FloatArray:
    """Return a basis (d, b), scaled, of the twists that the structure of the struts allows.

    Parameters
    ----------
    rows : StrutRows
    attached : (s,) bool array
        The struts that hold the platform.
    """
    return _compatible_twists(rows, attached)[0]


def _compatible_twists(
    rows: StrutRows, attached: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
) -> tuple[FloatArray, int, float]:
    """Return a basis of the twists the attached structure allows, and what it absorbed."""
    if rows.decomposition is not None and attached.all():
        sigma, right = rows.decomposition
    else:
        structure = rows.structure[attached[rows.structure_strut]]
        if len(structure) == 0:
            return np.eye(len(rows.twist_scale)), 0, np.inf
        _, sigma, right = decomposed(structure)
    threshold = absorption_threshold(sigma, rows.compliance)
    kept = int((sigma > threshold).sum())
    absorbed = rank_of(sigma) - kept
    weakest = float(sigma[kept - 1]) if kept else np.inf
    return right[kept:].T, absorbed, weakest


def _motions(
    rows: StrutRows,
    compatible: FloatArray,
    attached: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
    held: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
) -> tuple[FloatArray, FloatArray]:
    """Return all motions the rows allow: scaled twists (d, b) and actuator rates (N, b)."""
    if rows.actuator_rows is not None:
        rates = np.zeros((len(held), compatible.shape[1]))
        rates[held] = rows.actuator_rows[held] @ compatible
        return compatible, rates
    # Drives that the platform does not determine (in series, or serial arms with spare joints):
    # the motions are the null space of the whole stack.
    by_numbers = rows.drive_strut < 0
    mine = by_numbers | attached[rows.drive_strut] if len(attached) else by_numbers
    drive = rows.drive[mine] @ compatible
    gains = rows.drive_rates[mine][:, held]
    scaled = gains / rows.rate_scale[held]
    motions = null_space(np.hstack([drive, -scaled]))
    width = compatible.shape[1]
    rates = np.zeros((len(held), motions.shape[1]))
    rates[held] = motions[width:] / rows.rate_scale[held, None]
    return compatible @ motions[:width], rates


def _decomposed(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the singular value decomposition with all right directions."""
    if matrix.shape[0] == 0:
        width = matrix.shape[1]
        return np.zeros((0, 0)), np.zeros(0), np.eye(width)
    tall = matrix.shape[0] >= matrix.shape[1]
    return np.linalg.svd(matrix, full_matrices=not tall)


def _without_noise(
    twist_jacobian: FloatArray, mapping: FloatArray, rows: StrutRows
) -> FloatArray:
    """Return J (d, n) with 0 for the coordinates that the drives do not move.

    Otherwise rounding errors would pass for motion where there is nothing to compare them with.
    """
    speed = np.linalg.norm(twist_jacobian * rows.twist_scale[:, None], axis=1)
    drives = float(np.linalg.norm(mapping * rows.rate_scale[:, None]))
    moved = speed > ROUNDING_TOLERANCE * max(drives, float(np.linalg.norm(speed)))
    return np.where(moved[:, None], twist_jacobian, 0.0)


def _independent(twists: FloatArray) -> FloatArray:
    """Return a basis of scaled platform twists (d, k); motions inside the struts drop out."""
    if twists.shape[1] == 0:
        return twists
    left, sigma, _ = np.linalg.svd(twists, full_matrices=False)
    # The motions are unit vectors together with their actuator rates: the yardstick is 1.
    return np.asarray(left[:, : rank_of(sigma, 1.0)])
