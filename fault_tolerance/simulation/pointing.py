# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The pointing loop around the controller: from where the mirror looks to how it should turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.screws import rotation_vector


@dataclass(frozen=True)
class PointingLoop:
    """Feedforward of the reference's rate, and feedback of the pointing error."""

    gain: float = 5.0
    """1/s, of the pointing error."""
    piston_gain: float = 5.0
    """1/s, with which everything else is drawn back to where it is at home: the platform's origin,
    and the turn about z. Of a mirror only the piston is part of the task, and a secondary one:
    after a failure that couples it the controller gives it up first."""

    def velocity(
        self, pose: FloatArray, home: FloatArray, angle: FloatArray, rate: FloatArray
    ) -> FloatArray:
        """Return the platform twist (6,) to ask for, base axes.

        The platform is at ``pose`` (4, 4), its origin at home at ``home`` (3,), metres; the
        reference is at ``angle`` (2,) about x and y, radians, and ``rate`` (2,) is fed forward.
        """
        error = platform_error(pose, home, angle)
        twist = self.piston_gain * error
        twist[:2] = rate + self.gain * error[:2]
        return twist


def pointing_error(pose: FloatArray, angle: FloatArray) -> FloatArray:
    """Return the reference ``angle`` (2,) less the rotation of ``pose`` about x and y, radians."""
    return np.asarray(angle - rotation_vector(pose[:3, :3])[:2])


def platform_error(pose: FloatArray, home: FloatArray, angle: FloatArray) -> FloatArray:
    """Return by how much the platform at ``pose`` is not where it should be (6,), base axes.

    First a rotation vector, radians, which should be ``angle`` (2,) about x and y, and zero about
    z; then the platform's origin, metres, which should be at ``home`` (3,).
    """
    error = np.empty(6)
    error[:3] = -rotation_vector(pose[:3, :3])
    error[:2] += angle
    error[3:] = home - pose[:3, 3]
    return error
