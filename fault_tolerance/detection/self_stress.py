# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Forces of the drives against each other: how large they are, and how to lead them back."""

from __future__ import annotations

from math import inf

import numpy as np

from fault_tolerance.detection.responses import relative_stiffness
from fault_tolerance.detection.separation import self_stress, still_strains
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.arrays import FloatArray, frozen


class SelfStress:
    """The self-stress of a mechanism at one configuration (docs/detection.md, eq. 7-8).

    Stuck drives hold as springs do: they take part in the stress, and cannot be moved to relieve
    it.

    Parameters
    ----------
    rows : StrutRows
        Of the configuration.
    failures : FailureSet
        Those in force.

    Attributes
    ----------
    basis : (N, r) array
        Orthonormal motions of the setpoints that only strain the mechanism, metres; zero rows for
        drives that do not hold.
    probing : (N, k) array
        Orthonormal motions of the drives that still move which strain it at rest, metres: what a
        probe may use.
    """

    def __init__(self, rows: StrutRows, failures: FailureSet) -> None:
        mechanism = rows.mechanism
        self._scale = rows.rate_scale
        holding = differential_kinematics(rows, FailureSet((), failures.free, failures.lost))
        self.basis = self_stress(rows, holding)
        self.probing = still_strains(rows, failures)
        self._stiffness = mechanism.drive_stiffness
        yielding = 1.0 / relative_stiffness(mechanism)
        # Setpoints that do not move are those of drives that have failed.
        movable = self.basis * differential_kinematics(rows, failures).active[:, None]
        self._lead = np.linalg.pinv(movable.T, rcond=1e-6)
        self._stiff = self.basis @ np.linalg.pinv(self.basis.T @ (yielding[:, None] * self.basis))

    @property
    def stiffness_known(self) -> bool:
        """Whether the mechanism file has the stiffness of every drive."""
        return bool(np.isfinite(self._stiffness).all())

    @property
    def stiffest(self) -> float:
        """The largest stiffness of a drive, N/m; infinite where one is not known."""
        stiffness = self._stiffness / self._scale**2
        return float(stiffness.max()) if self.stiffness_known else inf

    def strain(self, efforts: FloatArray) -> FloatArray:
        """Return how far the setpoints are from one another, (r,), metres.

        ``efforts`` (N,) are in N or N m. What a load on the platform takes has no part in it.
        """
        return frozen(self.basis.T @ (self._scale * efforts / self._stiffness))

    def force(self, strain: FloatArray) -> float:
        """Return the largest force, N, that a ``strain`` (r,), metres, makes.

        Turning drives count at the characteristic length.
        """
        return float(np.abs(self._stiff @ strain).max(initial=0.0))

    def relieving(self, strain: FloatArray) -> FloatArray:
        """Return the shortest motion of the setpoints (N,) that takes a ``strain`` (r,) away.

        In the mechanism's units; zero for drives that have failed.
        """
        return frozen(-(self._lead @ strain) / self._scale)
