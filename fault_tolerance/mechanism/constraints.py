# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What each strut says about the platform: structural rows and drive rows.

A strut with joint screws ``S`` transmits ``V = S q'`` to the platform. Let ``L`` be the left
annihilator of its passive columns. Then ``L V = L S_a q'_a`` is all the strut says. Its part in
the left annihilator of ``L S_a`` does not contain the drives: structure, ``0 = G V``. The rest
ties the drives to the platform: ``B V = C q'_a`` (docs/theory.md, eq. 5-7).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.attachment import Attachment
from fault_tolerance.mechanism.chains import Chains, forward_kinematics
from fault_tolerance.mechanism.freedom import Freedom, Structure, freedom
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.mechanism.regular import Placement, RegularStruts, StrutInverses
from fault_tolerance.tolerances import RANK_TOLERANCE, WELL_CONDITIONED


@dataclass(frozen=True, eq=False)
class DriveRows:
    """How the drives come into it where struts do not determine them; seldom asked for.

    Attributes
    ----------
    drive : (a, 6) array
        Orthonormal within each strut, and to its structure.
    rates : (a, N) array
        ``drive @ V = rates @ q'_a``.
    struts : (a,) int array
        The strut each of these rows belongs to.
    passive_inverse : (s, k, 6) array
        Pseudo-inverse of each strut's passive columns; zero at its other joints.
    """

    drive: FloatArray
    rates: FloatArray
    struts: IntArray
    passive_inverse: FloatArray


@dataclass(frozen=True, eq=False)
class StrutConstraints:
    """The rows of all struts, on scaled twists (rotations times the characteristic length).

    Attributes
    ----------
    structure : (g, 6) array
        ``0 = structure @ V``; orthonormal within each strut.
    structure_strut : (g,) int array
        The strut each of these rows belongs to.
    actuator_rows : (N, 6) array or None
        ``q'_a = actuator_rows @ V``: the drive rows solved for the drives, where every strut
        determines its own well (the usual case), else None.
    make_drives : callable
        Gives the `DriveRows`.
    inverses : StrutInverses or None
        The inverted struts, where the rows come from them.
    """

    structure: FloatArray
    structure_strut: IntArray
    actuator_rows: FloatArray | None
    make_drives: Callable[[], DriveRows]
    inverses: StrutInverses | None = None
    _structures: dict[tuple[str, ...], Structure] = field(default_factory=dict, repr=False)
    _freedoms: dict[tuple[tuple[str, ...], int], Freedom] = field(
        default_factory=dict, repr=False
    )

    @cached_property
    def drives(self) -> DriveRows:
        """The drive rows themselves."""
        return self.make_drives()

    def structure_of(self, attachment: Attachment) -> Structure:
        """Return the structural rows of the attached struts, decomposed once."""
        found = self._structures.get(attachment.lost)
        if found is None:
            rows, struts = attachment.rows_of(self.structure, self.structure_strut)
            found = Structure(rows, struts, *decomposed(rows))
            self._structures[attachment.lost] = found
        return found

    def with_rates_times(self, scale: FloatArray) -> StrutConstraints:
        """Return the same rows for actuator rates ``scale`` (N,) times as large: other units."""

        def make_drives() -> DriveRows:
            return replace(self.drives, rates=self.drives.rates / scale)

        rows = self.actuator_rows
        rows = None if rows is None else rows * scale[:, None]
        return StrutConstraints(
            self.structure, self.structure_strut, rows, make_drives, _structures=self._structures
        )

    def freedom_of(self, attachment: Attachment, kept: int) -> Freedom:
        """Return what ``kept`` constraints leave; only where there are `actuator_rows`."""
        key = attachment.lost, kept
        found = self._freedoms.get(key)
        if found is None:
            assert self.actuator_rows is not None
            rows = self.actuator_rows
            rows = rows if attachment.complete else rows[attachment.places]
            found = freedom(self.structure_of(attachment), rows, kept)
            self._freedoms[key] = found
        return found


def strut_constraints(chains: Chains, screws: FloatArray, count: int) -> StrutConstraints:
    """Return the rows of all struts.

    Parameters
    ----------
    chains : Chains
    screws : (s, k, 6) array
        Joint twists at the present configuration, v at the platform's origin.
    count : int
        Number N of actuators.
    """
    columns = np.swapaxes(screws, 1, 2) * chains.scale[:, None]
    passive = columns * chains.passive[:, None, :]
    active = columns * chains.active[:, None, :]
    left, sigma, right = np.linalg.svd(passive)
    # One yardstick for all struts: a strut without passive joints has rank 0, not noise.
    threshold = RANK_TOLERANCE * np.linalg.norm(columns, axis=(1, 2))[:, None]
    kept = sigma > threshold
    inverse = np.where(kept, 1.0 / np.where(kept, sigma, 1.0), 0.0)
    width = sigma.shape[1]
    passive_inverse = np.swapaxes(right, 1, 2)[:, :, :width] @ (
        inverse[..., None] * np.swapaxes(left, 1, 2)[:, :width]
    )
    ranks = kept.sum(axis=1)
    structure, drive, rates = [], [], []
    for rank in np.unique(ranks):
        members = np.flatnonzero(ranks == rank)
        annihilator = np.swapaxes(left[members][:, :, rank:], 1, 2)
        turned, gains, mixed = _decomposed_drives(annihilator @ active[members])
        drive_ranks = (gains > threshold[members]).sum(axis=1)
        for drive_rank in np.unique(drive_ranks):
            chosen = np.flatnonzero(drive_ranks == drive_rank)
            struts = members[chosen]
            rows = np.swapaxes(turned[chosen], 1, 2) @ annihilator[chosen]
            local = gains[chosen][:, :drive_rank, None] * mixed[chosen][:, :drive_rank]
            structure.append((struts, rows[:, drive_rank:]))
            drive.append((struts, rows[:, :drive_rank]))
            rates.append((struts, _by_actuator(local, chains.actuator[struts], count)))
    structure_rows, structure_strut = _stacked(structure, 6)
    drive_rows, drive_strut = _stacked(drive, 6)
    rate_rows, _ = _stacked(rates, count)
    drives = DriveRows(drive_rows, rate_rows, drive_strut, passive_inverse)
    solved = _actuator_rows(drive_rows, rate_rows, chains)
    return StrutConstraints(structure_rows, structure_strut, solved, lambda: drives)


def regular_constraints(
    chains: Chains, placement: Placement, regular: RegularStruts
) -> StrutConstraints | None:
    """Return the same from the inverted struts; None where some are nearly singular."""
    inverses = regular.inverted(placement)
    if inverses is None:
        return None

    def make_drives() -> DriveRows:
        return drives_at(chains, placement.joint_values, placement.pose)

    return StrutConstraints(
        inverses.structure, regular.structure_strut, inverses.actuator_rows, make_drives, inverses
    )


def drives_at(chains: Chains, joint_values: FloatArray, pose: FloatArray) -> DriveRows:
    """Return the drive rows at joint values (s, k) and a pose (4, 4)."""
    screws, _ = forward_kinematics(chains, joint_values, pose[:3, 3])
    return strut_constraints(chains, screws, len(chains.places[0])).drives


def _decomposed_drives(block: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the singular value decompositions of the blocks (g, r, k) of driven columns.

    With one drive a strut, which is nearly always so, a reflection does it without iteration.
    """
    driven = np.abs(block).max(axis=1, initial=0.0) > 0.0
    if block.shape[1] == 0 or (driven.sum(axis=1) != 1).any():
        return np.linalg.svd(block)
    count, rank, width = block.shape
    members, joints = np.nonzero(driven)
    columns = block[members, :, joints]
    lengths = np.sqrt(np.einsum('gr,gr->g', columns, columns))
    # The reflection that takes the column to the first axis; away from it, to lose no digits.
    signs = np.where(columns[:, 0] < 0.0, -1.0, 1.0)
    normals = columns.copy()
    normals[:, 0] += signs * lengths
    halves = 0.5 * np.einsum('gr,gr->g', normals, normals)
    reflected = np.eye(rank) - normals[:, :, None] * (normals / halves[:, None])[:, None, :]
    reflected[:, :, 0] *= -signs[:, None]
    gains = np.zeros((count, min(rank, width)))
    gains[:, 0] = lengths
    mixed = np.zeros((count, 1, width))
    mixed[members, 0, joints] = 1.0
    return reflected, gains, mixed


def _actuator_rows(
    drive: FloatArray, rates: FloatArray, chains: Chains
) -> FloatArray | None:
    """Return the drive rows solved for the drives, or None where they do not determine them."""
    count = rates.shape[1]
    if len(rates) != count:
        return None
    struts, joints = chains.places
    # Radians count by the characteristic length: what is small must not depend on units.
    turning = np.abs(chains.screws[struts, joints, :3]).max(axis=1) > 0.0
    scaled = rates / np.where(turning, chains.scale[0], 1.0)
    rows, columns = np.nonzero(rates)
    if len(rows) == count:
        # One drive a row: entry by entry, however many there are.
        entries, size = rates[rows, columns], np.abs(scaled[rows, columns])
        if len(np.unique(columns)) < count or size.min() <= WELL_CONDITIONED * size.max():
            return None
        solved = np.empty_like(drive)
        solved[columns] = drive[rows] / entries[:, None]
        return solved
    sigma = np.linalg.svd(scaled, compute_uv=False)
    if sigma[-1] <= WELL_CONDITIONED * sigma[0]:
        return None
    return np.asarray(np.linalg.solve(rates, drive))


def _by_actuator(local: FloatArray, actuator: IntArray, count: int) -> FloatArray:
    """Spread rows on a strut's joints (g, r, k) over all actuators (g, r, N)."""
    result = np.zeros((*local.shape[:2], count))
    member, joint = np.nonzero(actuator >= 0)
    result[member, :, actuator[member, joint]] = local[member, :, joint]
    return result


def _stacked(
    groups: list[tuple[IntArray, FloatArray]], width: int
) -> tuple[FloatArray, IntArray]:
    """Join groups of (struts, rows (g, r, width)) into rows in the order of the struts."""
    rows = np.concatenate([block.reshape(-1, width) for _, block in groups])
    struts = np.concatenate([np.repeat(members, block.shape[1]) for members, block in groups])
    if len(groups) == 1:
        return rows, struts
    order = np.argsort(struts, kind='stable')
    return rows[order], struts[order]
