# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Poses as a sensor gives them: position and quaternion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from fault_tolerance.mechanism.arrays import FloatArray

MAX_POSITION = 1e6
"""Metres; a pose farther away is rejected."""

UNIT_TOLERANCE = 0.01
"""Largest error of the norm of a quaternion: rounded ones pass."""


def pose_of(position: Sequence[float], quaternion: Sequence[float]) -> FloatArray:
    """Return a pose as a homogeneous transform (4, 4), metres.

    Parameters
    ----------
    position : (3,) sequence
        Metres.
    quaternion : (4,) sequence
        x, y, z, w.

    Returns
    -------
    (4, 4) array

    Raises
    ------
    ValueError
        If a number is not finite, the position too far away, or the norm of the quaternion not 1.
    """
    pose, turn = np.eye(4), np.array(quaternion, dtype=np.float64)
    pose[:3, 3] = position
    if not (np.isfinite(pose).all() and np.isfinite(turn).all()):
        raise ValueError('the pose is not finite')
    if (np.abs(pose) > MAX_POSITION).any():
        raise ValueError(f'the position is more than {MAX_POSITION:g} m away')
    if abs(np.linalg.norm(np.clip(turn, -2.0, 2.0)) - 1.0) > UNIT_TOLERANCE:
        raise ValueError('the norm of the quaternion is not 1')
    pose[:3, :3] = Rotation.from_quat(turn).as_matrix()
    return pose
