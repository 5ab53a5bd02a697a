# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What each strut says about the platform: structural rows and actuator rows.

A strut with joint screws ``S`` transmits ``V = S q'`` to the platform. Let ``L`` be the left
annihilator of its passive columns. Then ``L V = L S_a q'_a`` is all the strut says. Its part in
the left annihilator of ``L S_a`` does not contain the drives: structure, ``0 = G V``. The rest
gives the drives: ``q'_a = A V + N xi`` with ``A = (L S_a)^+ L`` and N a basis of the null space
of ``L S_a``, empty unless drives in series can move against each other (docs/theory.md,
eq. 5-7).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray, frozen
from fault_tolerance.mechanism.chains import Chains
from fault_tolerance.tolerances import RANK_TOLERANCE


@dataclass(frozen=True, eq=False)
class StrutConstraints:
    """The rows of all struts, on scaled twists (rotations times the characteristic length)."""

    structure: FloatArray
    """(g, 6): ``0 = structure @ V``; orthonormal within each strut."""
    structure_strut: IntArray
    """(g,): the strut each of these rows belongs to."""
    actuator_rows: FloatArray
    """(N, 6): ``q'_a = actuator_rows @ V + spare @ xi``, rad/s or m/s."""
    spare: FloatArray
    """(N, k): motions of drives in series that leave the platform at rest; orthonormal in m/s."""
    spare_strut: IntArray
    """(k,): the strut each of these columns belongs to."""
    rate_scale: FloatArray
    """(N,): turns actuator rates into metres per second."""

    def __repr__(self) -> str:
        count, actuators = len(self.structure), len(self.actuator_rows)
        return f'StrutConstraints({count} structural rows, {actuators} actuators)'

    def in_metres(self) -> StrutConstraints:
        """Return the same rows for actuator rates in metres per second."""
        scale = self.rate_scale[:, None]
        return replace(
            self,
            actuator_rows=frozen(self.actuator_rows * scale),
            spare=frozen(self.spare * scale),
            rate_scale=frozen(np.ones(len(scale))),
        )


def strut_constraints(
    chains: Chains, screws: FloatArray, rate_scale: FloatArray
) -> StrutConstraints:
    """Return the rows of all struts ``chains``, whose joints have the twists ``screws`` (s, k, 6).

    Twists in base axes, v at the platform's origin; ``rate_scale`` (N,) turns actuator rates into
    metres per second.
    """
    count = len(rate_scale)
    structure, structure_strut, spare, spare_strut = [], [], [], []
    actuator_rows = np.zeros((count, 6))
    for strut, joints in enumerate(screws):
        # Columns in metres per second: what is small must not depend on the units.
        per_metre = np.where(joints[:, :3].any(axis=1), chains.scale[0], 1.0)
        columns = joints.T * chains.scale[:, None] / per_metre
        # One threshold for all of a strut: rounding errors are relative to its largest columns.
        threshold = RANK_TOLERANCE * np.linalg.norm(columns)
        places = chains.actuator[strut]
        driven = places >= 0
        mine = places[driven]
        left, sigma, _ = np.linalg.svd(columns[:, ~driven])
        annihilator = left[:, int((sigma > threshold).sum()) :].T
        left, sigma, right = np.linalg.svd(annihilator @ columns[:, driven])
        rank = int((sigma > threshold).sum())
        inverse = right[:rank].T / sigma[:rank] @ left[:, :rank].T
        actuator_rows[mine] = inverse @ annihilator / rate_scale[mine, None]
        structure.append(left[:, rank:].T @ annihilator)
        idle = np.zeros((count, len(right) - rank))
        idle[mine] = right[rank:].T / rate_scale[mine, None]
        spare.append(idle)
        structure_strut += [strut] * len(structure[-1])
        spare_strut += [strut] * idle.shape[1]
    return StrutConstraints(
        frozen(np.vstack(structure)),
        frozen(np.array(structure_strut, dtype=np.intp)),
        frozen(actuator_rows),
        frozen(np.hstack(spare)),
        frozen(np.array(spare_strut, dtype=np.intp)),
        rate_scale,
    )
