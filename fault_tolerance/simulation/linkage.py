# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The struts of the simulated mechanism as rigid links and turning or sliding joints.

Written apart from the controller's geometry, from joint axes and points alone, so that the two
can be held against each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

# Contracted with a vector it gives that vector's cross-product matrix, row by row.
_CROSS = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _CROSS[_i, _k, _j], _CROSS[_i, _j, _k] = 1.0, -1.0


@dataclass(frozen=True, eq=False)
class Placement:
    """Where the struts' own joint values put them; s struts of up to k joints; metres, base axes.

    Attributes
    ----------
    rotations : (s, 3, 3) array
        The platform's rotation from home as each strut alone would have it.
    origins : (s, 3) array
        The platform origin as each strut alone would have it.
    points : (s, k, 3) array
        A point on every joint axis.
    motions : (s, 6, k) array
        How each joint moves the strut's end: per unit rate, angular velocity times the
        characteristic length, then velocity of the platform origin.
    """

    rotations: FloatArray
    origins: FloatArray
    points: FloatArray
    motions: FloatArray


class Linkage:
    """The struts of a mechanism side by side, padded to the longest with joints that do nothing.

    Raises `MechanismError` if the mechanism has no struts: there is nothing to simulate.

    Attributes
    ----------
    origin : (3,) array
        Platform origin at home.
    length : float
        Characteristic length, metres.
    real : (s, k) bool array
        Where there is a joint.
    turning : (s, k) bool array
        Where it is a revolute one.
    slots : (N,) int array
        The places of the actuators in an array (s, k), flattened.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        if not mechanism.struts:
            reason = 'a mechanism given by its Jacobian only cannot be simulated'
            raise MechanismError(mechanism.name, 'struts', reason)
        shape = (len(mechanism.struts), max(len(strut.joints) for strut in mechanism.struts))
        self.origin = mechanism.origin
        self.length = mechanism.characteristic_length
        self.real = np.zeros(shape, dtype=np.bool_)
        self.turning = np.zeros(shape, dtype=np.bool_)
        slot_of: dict[str, int] = {}
        axes = np.zeros((*shape, 3))
        points = np.zeros((*shape, 3))
        for i, strut in enumerate(mechanism.struts):
            for j, joint in enumerate(strut.joints):
                self.real[i, j] = True
                self.turning[i, j] = joint.kind == 'revolute'
                axes[i, j] = joint.axis
                points[i, j] = joint.point
                if joint.actuator is not None:
                    slot_of[joint.actuator.name] = i * shape[1] + j
        self.slots = np.array([slot_of[name] for name in mechanism.actuator_names], dtype=np.intp)
        self._lines = np.zeros((*shape, 4, 2))
        self._lines[..., :3, 0] = axes
        self._lines[..., :3, 1] = points
        self._lines[..., 3, 1] = 1.0
        self._turning = self.turning.astype(np.float64)[..., None]
        self._displacements = _joint_displacements(axes, points, self.turning)

    def placement(self, joint_values: FloatArray) -> Placement:
        """Return the `Placement` of the struts at ``joint_values`` (s, k), radians and metres."""
        count, length = joint_values.shape
        weights = np.empty((count, length, 1, 3))
        weights[..., 0, 0] = np.sin(joint_values)
        weights[..., 0, 1] = 1.0 - np.cos(joint_values)
        weights[..., 0, 2] = joint_values
        steps = (weights @ self._displacements).reshape(count, length, 4, 4)
        steps += np.eye(4)
        before = np.empty((count, length + 1, 4, 4))
        before[:, 0] = np.eye(4)
        for j in range(length):
            np.matmul(before[:, j], steps[:, j], out=before[:, j + 1])
        rotations = before[:, -1, :3, :3]
        origins = rotations @ self.origin + before[:, -1, :3, 3]
        lines = before[:, :-1] @ self._lines
        axes, points = lines[..., :3, 0], lines[..., :3, 1]
        arms = origins[:, None, :] - points
        cross = np.tensordot(axes, _CROSS, axes=1)
        swung = (cross @ arms[..., None])[..., 0]
        motions = np.empty((count, 6, length))
        turning = self._turning
        motions[:, :3] = np.swapaxes(self.length * turning * axes, 1, 2)
        motions[:, 3:] = np.swapaxes(turning * swung + (1.0 - turning) * axes, 1, 2)
        return Placement(rotations, origins, points, motions)

    def gaps(self, placement: Placement, pose: FloatArray) -> FloatArray:
        """Return the gaps (s, 6) from the platform at ``pose`` (4, 4) to the struts' ends.

        A gap is the small rotation times the characteristic length, then the displacement;
        metres, base axes. ``placement`` says where the ends are.
        """
        turned = placement.rotations @ pose[:3, :3].T
        gaps = np.empty((len(turned), 6))
        half = 0.5 * self.length
        gaps[:, 0] = half * (turned[:, 2, 1] - turned[:, 1, 2])
        gaps[:, 1] = half * (turned[:, 0, 2] - turned[:, 2, 0])
        gaps[:, 2] = half * (turned[:, 1, 0] - turned[:, 0, 1])
        gaps[:, 3:] = placement.origins - pose[:3, 3]
        return gaps


def _joint_displacements(
    axes: FloatArray, points: FloatArray, turning: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
) -> FloatArray:
    """Return what a joint's displacement, less the identity, is made of, (s, k, 3, 16).

    It is ``sin q`` times the first, ``1 - cos q`` times the second (a rotation about an axis
    through a point) or ``q`` times the third (a slide) of three 4 x 4 matrices.
    """
    parts = np.zeros((*axes.shape[:2], 3, 4, 4))
    hat = np.tensordot(axes, _CROSS, axes=1) * turning[..., None, None]
    for part, matrix in ((0, hat), (1, hat @ hat)):
        parts[:, :, part, :3, :3] = matrix
        parts[:, :, part, :3, 3] = -(matrix @ points[..., None])[..., 0]
    parts[:, :, 2, :3, 3] = axes * ~turning[..., None]
    return parts.reshape(*axes.shape[:2], 3, 16)
