# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What each strut says about the platform: structural rows and drive rows.

A strut with joint screws ``S`` transmits ``V = S q'`` to the platform. Let ``L`` be the left
annihilator of its passive columns. Then ``L V = L S_a q'_a`` is all the strut says. Its part in
the left annihilator of ``L S_a`` does not contain the drives: structure, ``0 = G V``. The rest
ties the drives to the platform: ``B V = C q'_a`` (docs/theory.md, eq. 5-7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.chains import Chains
from fault_tolerance.mechanism.tolerances import RANK_TOLERANCE


@dataclass(frozen=True, eq=False)
class StrutConstraints:
    """The rows of all struts, on scaled twists (rotations times the characteristic length).

    Attributes
    ----------
    structure : (g, 6) array
        ``0 = structure @ V``; orthonormal within each strut.
    structure_strut : (g,) int array
        The strut each of these rows belongs to.
    drive : (a, 6) array
        Orthonormal within each strut, and to its structure.
    drive_rates : (a, N) array
        ``drive @ V = drive_rates @ q'_a``.
    drive_strut : (a,) int array
        The strut each of these rows belongs to.
    passive_inverse : (s, k, 6) array
        Pseudo-inverse of each strut's passive columns; zero at its other joints.
    """

    structure: FloatArray
    structure_strut: IntArray
    drive: FloatArray
    drive_rates: FloatArray
    drive_strut: IntArray
    passive_inverse: FloatArray


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
        block = annihilator @ active[members]
        turned, gains, mixed = np.linalg.svd(block)
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
    return StrutConstraints(
        structure_rows, structure_strut, drive_rows, rate_rows, drive_strut, passive_inverse
    )


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
