# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The motions that the attached struts allow, and the drives' part in them.

Loop closure and differential kinematics both start here (docs/theory.md, eq. 8).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from fault_tolerance.errors import FailureError
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray, frozen
from fault_tolerance.mechanism.constraints import StrutConstraints
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.tolerances import RANK_TOLERANCE


@dataclass(frozen=True, eq=False)
class Attachment:
    """The struts left when some have been lost; made by `attachment_of`."""

    attached: BoolArray
    """(s,): the struts that hold the platform."""
    held: BoolArray
    """(N,): the actuators of those (all, for a mechanism given by its Jacobian)."""

    def __repr__(self) -> str:
        return f'Attachment({int(self.attached.sum())} of {len(self.attached)} struts)'


def attachment_of(mechanism: Mechanism, lost: Collection[str] = ()) -> Attachment:
    """Return what is attached in ``mechanism`` without its struts ``lost``.

    FailureError if it has no strut of such a name.
    """
    for name in lost:
        if name not in mechanism.strut_names:
            raise FailureError(name, 'not a strut', mechanism.strut_names)
    attached = np.array([name not in lost for name in mechanism.strut_names], dtype=np.bool_)
    held = np.array([actuator.strut not in lost for actuator in mechanism.actuators])
    return Attachment(frozen(attached), frozen(held))


@dataclass(frozen=True, eq=False)
class Structure:
    """The structural rows of the attached struts, decomposed."""

    rows: FloatArray
    """(g, 6): ``0 = rows @ V`` for scaled twists V."""
    struts: IntArray
    """(g,): the strut of each row."""
    left: FloatArray
    sigma: FloatArray
    right: FloatArray
    """Their singular value decomposition, with all six right directions."""
    kept: int
    """How many constraints count; the flexures absorb the others (docs/theory.md, section 6)."""

    def __repr__(self) -> str:
        return f'Structure({self.kept} of {len(self.sigma)} constraints kept)'

    @property
    def allowed(self) -> FloatArray:
        """Orthonormal basis (6, b) of the scaled twists that the structure allows."""
        return frozen(self.right[self.kept :].T)


def structure_of(
    constraints: StrutConstraints, attachment: Attachment, compliance: float
) -> Structure:
    """Return the structural rows of ``constraints`` that belong to the struts of ``attachment``.

    Those whose singular value is not above ``compliance`` are absorbed.
    """
    mine = attachment.attached[constraints.structure_strut]
    rows, struts = constraints.structure[mine], constraints.structure_strut[mine]
    left, sigma, right = decomposed(rows)
    threshold = max(compliance, RANK_TOLERANCE * sigma.max(initial=0.0))
    kept = int((sigma > threshold).sum())
    return Structure(
        frozen(rows), frozen(struts), frozen(left), frozen(sigma), frozen(right), kept
    )


def motions(
    constraints: StrutConstraints, attachment: Attachment, allowed: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return all motions that the struts of ``attachment`` allow (docs/theory.md, eq. 8).

    From the rows ``constraints`` and ``allowed`` (6, b), an orthonormal basis of the scaled twists
    that their structure allows. Returns scaled twists (6, c) and actuator rates (N, c), zero for
    lost struts, all in metres per second; columns of both together are orthonormal.
    """
    scale = constraints.rate_scale
    rows = np.where(attachment.held[:, None], constraints.actuator_rows * scale[:, None], 0.0)
    spare = constraints.spare[:, attachment.attached[constraints.spare_strut]]
    # Right singular directions make the rates of different columns orthogonal too, so that the
    # columns only have to be divided by their lengths.
    left, sigma, right = decomposed(rows @ allowed)
    lengths = np.ones(allowed.shape[1])
    lengths[: len(sigma)] = np.hypot(1.0, sigma)
    turned = np.zeros((len(rows), allowed.shape[1]))
    turned[:, : len(sigma)] = left * sigma
    twists = np.hstack([allowed @ right.T / lengths, np.zeros((len(allowed), spare.shape[1]))])
    return twists, np.hstack([turned / lengths, spare * scale[:, None]])
