# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Differential kinematics (Theorem 1) from rows, before and after any failures.

``v = J q' + J_xi xi`` with the actuator rates ``q'_a = T q'`` (docs/theory.md, eq. 1-2). A
position failure adds the row ``q'_j = 0``; a torque failure takes j out of the rows of which T
is made; a hard failure drops the strut's rows. Always from the nominal rows, never chained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from fault_tolerance.compiled.activation import Active, Kernels
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.subspaces import null_space, rank_of
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.attachment import Attachment, attachment_of
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.freedom import kept_constraints
from fault_tolerance.mechanism.linear_algebra import decomposed, length, row_products
from fault_tolerance.mechanism.task import Task
from fault_tolerance.tolerances import ROUNDING_TOLERANCE

_NONE = np.zeros((6, 0))
_NONE.setflags(write=False)


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

    @cached_property
    def major(self) -> FloatArray:
        """J_m, (m, n): the rows of the major coordinates."""
        return self.jacobian[self.task.major_rows]

    @cached_property
    def secondary(self) -> FloatArray:
        """J_s, (l - m, n): the rows of the secondary coordinates."""
        return self.jacobian[self.task.secondary_rows]

    def decomposed_major(
        self, weights: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the singular value decomposition of J_m with its rows times ``weights`` (m,).

        All right directions included; kept, as verdict and rates both ask for it.
        """
        kept = self.derived.setdefault('major', {})
        key = weights.tobytes()
        found: tuple[FloatArray, FloatArray, FloatArray] | None = kept.get(key)
        if found is None:
            found = kept[key] = decomposed(self.major * weights[:, None])
        return found

    @cached_property
    def derived(self) -> dict[str, dict[Any, Any]]:
        """What has been derived from these kinematics and may be asked for again, by kind."""
        return {}

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
    part = failed_parts(rows.mechanism, failures or FailureSet())
    if Active.kernels is not None and rows.actuator_rows is not None:
        found = _compiled(Active.kernels, rows, part)
        if found is not None:
            return found
    attachment = part.attachment
    structure = rows.constraints.structure_of(attachment)
    kept = structure.kept(rows.compliance)
    weakest = float(structure.sigma[kept - 1]) if kept else np.inf
    known = None
    if rows.actuator_rows is None:
        twists, rates = _motions(rows, structure.right[kept:].T, attachment)
    else:
        freedom = rows.constraints.freedom_of(attachment, kept)
        twists, rates = freedom.twists, freedom.rates
        if not attachment.complete:
            rates = np.zeros((len(rows.rate_scale), twists.shape[1]))
            rates[attachment.places] = freedom.rates
        if part.all_drive:
            known = freedom.left, freedom.gains, freedom.right
    # Motions are unit vectors in metres per second: rates are small or not compared with that,
    # so that a drive which does not move at all is not mistaken for a slow one.
    scale = max(1.0, _size_of_rates(rates, rows))
    if len(part.stuck):
        stuck = part.stuck
        unlocked = null_space(rates[stuck] * rows.rate_scale[stuck, None], scale)
        twists, rates = twists @ unlocked, rates @ unlocked
        rates[stuck] = 0.0

    # Columns of [twists; rates] span every motion; those the drives feel make T.
    active, weights = part.driving, rows.twist_scale[:, None]
    left, sigma, right = known or decomposed(rates[active])
    rank = rank_of(sigma, scale)
    dimension = len(rows.twist_scale)
    if rank == twists.shape[1]:
        unactuated = _NONE[:dimension]
        per_rate = right.T / sigma
        scaled = twists.dot(per_rate)
    else:
        unactuated = _independent(twists @ right[rank:].T) / weights
        # What the drives do not determine is chosen as the shortest motion, which needs an
        # orthonormal basis to have a meaning. The rank was decided above, whatever the units.
        basis, _ = np.linalg.qr(np.vstack([twists / weights, rates]))
        twists, rates = basis[:dimension], basis[dimension:]
        left, sigma, right = decomposed(rates[active])
        left = left[:, :rank]
        per_rate = right[:rank].T / sigma[:rank]
        scaled = weights * twists.dot(per_rate)
    if len(active) == len(rates):
        mapping = rate_map = left
    else:
        mapping = np.zeros((len(rates), rank))
        mapping[active] = left
        rate_map = rates.dot(per_rate)
        rate_map[active] = left
    twist_jacobian = _without_noise(scaled, mapping, rows) / weights
    return DifferentialKinematics(
        rows.mechanism.task,
        twist_jacobian.take(rows.task_rows, 0),
        mapping,
        twist_jacobian,
        rate_map,
        unactuated,
        part.active,
        rank_of(structure.sigma) - kept,
        weakest,
    )


def _compiled(
    kernels: Kernels, rows: StrutRows, part: FailedParts
) -> DifferentialKinematics | None:
    """Return the same by the compiled path; None where the drives do not determine it all."""
    if not rows.mechanism.rates_alike:
        return None
    attachment, task = part.attachment, rows.mechanism.task
    structure = rows.constraints.structure_of(attachment)
    kept = structure.kept(rows.compliance)
    freedom = rows.constraints.freedom_of(attachment, kept)
    weights = rows.twist_scale[rows.task_rows[task.major_rows]]
    sound, *found = kernels.reconfigure(
        freedom.twists, freedom.rates, attachment.places, len(rows.rate_scale), part.stuck,
        part.driving, float(rows.rate_scale[0]), rows.twist_scale, rows.task_rows,
        task.major_rows, weights, part.all_drive, freedom.left, freedom.gains, freedom.right,
    )
    return kinematics_from(rows, part, kept, found) if sound else None


def kinematics_from(
    rows: StrutRows, part: FailedParts, kept: int, found: Sequence[FloatArray]
) -> DifferentialKinematics:
    """Return the kinematics that the compiled path has found.

    Parameters
    ----------
    rows : StrutRows
    part : FailedParts
    kept : int
        Structural constraints that count.
    found : sequence of arrays
        As `fault_tolerance.compiled.resolving.reconfigure` returns them.
    """
    task, sigma = rows.mechanism.task, rows.constraints.structure_of(part.attachment).sigma
    jacobian, mapping, twist_jacobian, rate_map, *major = found
    made = DifferentialKinematics(
        task,
        jacobian,
        mapping,
        twist_jacobian,
        rate_map,
        _NONE[: len(twist_jacobian)],
        part.active,
        rank_of(sigma) - kept,
        float(sigma[kept - 1]) if kept else np.inf,
    )
    weights = rows.twist_scale[rows.task_rows[task.major_rows]]
    made.derived['major'] = {weights.tobytes(): tuple(major)}
    return made


def weakest_constraint(rows: StrutRows) -> float:
    """Return `DifferentialKinematics.weakest_kept` without failures, and without deriving them."""
    structure = rows.constraints.structure_of(attachment_of(rows.mechanism))
    kept = structure.kept(rows.compliance)
    return float(structure.sigma[kept - 1]) if kept else np.inf


@dataclass(frozen=True, eq=False)
class FailedParts:
    """What a set of failures leaves of each kind.

    Attributes
    ----------
    attachment : Attachment
        Of the struts that are not lost.
    stuck, driving : int arrays
        Places of the actuators that are stuck, and that drive.
    active : (N,) bool array
        Those that drive.
    all_drive : bool
        Whether all in attached struts do.
    """

    attachment: Attachment
    stuck: IntArray
    driving: IntArray
    active: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    all_drive: bool


@lru_cache(maxsize=256)
def failed_parts(mechanism: Mechanism, failures: FailureSet) -> FailedParts:
    """Return what ``failures`` leave (kept: asked for in every cycle)."""
    attachment = attachment_of(mechanism, failures.lost)
    names = mechanism.actuator_names
    failed = {*failures.stuck, *failures.free}
    active = attachment.held & np.array([name not in failed for name in names])
    active.setflags(write=False)
    stuck = [names.index(name) for name in failures.stuck]
    return FailedParts(
        attachment,
        np.array(stuck, dtype=np.intp),
        np.flatnonzero(active),
        active,
        bool((active == attachment.held).all()),
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
    structure = rows.structure[attached[rows.structure_strut]]
    _, sigma, right = decomposed(structure)
    return right[kept_constraints(sigma, rows.compliance) :].T


def _motions(
    rows: StrutRows, compatible: FloatArray, attachment: Attachment
) -> tuple[FloatArray, FloatArray]:
    """Return all motions the rows allow: scaled twists (d, b) and actuator rates (N, b).

    For drives that the platform does not determine (in series, or serial arms with spare
    joints): the motions are the null space of the whole stack.
    """
    attached, held = attachment.attached, attachment.held
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


def _without_noise(scaled: FloatArray, mapping: FloatArray, rows: StrutRows) -> FloatArray:
    """Return J (d, n), scaled, with 0 for the coordinates that the drives do not move.

    Otherwise rounding errors would pass for motion where there is nothing to compare them with.
    """
    squares: list[float] = row_products(scaled, scaled).tolist()
    least = ROUNDING_TOLERANCE**2 * max(_size_of_rates(mapping, rows) ** 2, sum(squares))
    if squares and min(squares) <= least:
        scaled[[square <= least for square in squares]] = 0.0
    return scaled


def _size_of_rates(rates: FloatArray, rows: StrutRows) -> float:
    """Return the norm of rates (N, c) in metres per second."""
    scale = rows.rate_scale
    if rows.mechanism.rates_alike:
        return float(scale[0]) * length(rates)
    return length(rates * scale[:, None])


def _independent(twists: FloatArray) -> FloatArray:
    """Return a basis of scaled platform twists (d, k); motions inside the struts drop out."""
    left, sigma, _ = decomposed(twists)
    # The motions are unit vectors together with their actuator rates: the yardstick is 1.
    return np.asarray(left[:, : rank_of(sigma, 1.0)])
