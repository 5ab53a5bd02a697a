# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The elastic structure: where platform and joints come to rest, and how slowly they drift.

Unknown are the platform's pose and every joint value. The energy is that of the joint springs
(an actuator holds its setpoint as a spring does), plus that of each attached strut's end being
strained off the platform, less the work of the load. Motion is overdamped, and one implicit
Euler step of it is a minimisation: energy plus ``damping * displacement^2 / (2 dt)``. It is
found by Gauss-Newton, the joints of each strut eliminated first, so that six unknowns are left.
Directions the springs hold come to rest within a step; those nothing holds creep at load over
damping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.simulation.linkage import Linkage

_MOST_ITERATIONS = 8
# A Gauss-Newton step of d characteristic lengths leaves an error of about d^2 of them.
_SMALL_STEP = 3e-5
_LONGEST_STEP = 0.3


@dataclass(frozen=True, eq=False)
class Structure:
    """What pulls at the linkage during one step; metric: rotations times the length.

    Attributes
    ----------
    joint_stiffness : (s, k) array
        N/m, or N m/rad at turning joints; 0 where nothing holds the joint.
    joint_rest : (s, k) array
        Joint values at which those springs are at ease.
    joint_damping : (s, k) array
        N s/m, or N m s/rad; positive at every joint.
    strut_stiffness : (s, 6, 6) array
        What holds each strut's end to the platform, N/m in the metric, base axes; 0 for a strut
        that is off.
    strut_offsets : (s, 6) array
        Gaps at which the struts' ends are at ease, metric.
    platform_damping : float
        N s/m in the metric.
    load : (6,) array
        Moment over characteristic length, then force, on the platform at its origin, newtons.
    """

    joint_stiffness: FloatArray
    joint_rest: FloatArray
    joint_damping: FloatArray
    strut_stiffness: FloatArray
    strut_offsets: FloatArray
    platform_damping: float
    load: FloatArray


def settled(
    linkage: Linkage, structure: Structure, pose: FloatArray, joint_values: FloatArray, dt: float
) -> tuple[FloatArray, FloatArray]:
    """Return pose (4, 4) and joint values (s, k) after a time; struts that are off keep theirs.

    Parameters
    ----------
    linkage : Linkage
    structure : Structure
    pose : (4, 4) array
        Of the platform, base axes, metres.
    joint_values : (s, k) array
        Radians and metres from home.
    dt : float
        Seconds, positive.
    """
    stiff = structure.strut_stiffness
    attached = stiff[:, :1, 0] > 0.0
    joint_drag = structure.joint_damping / dt
    drag = structure.platform_damping / dt
    diagonal = structure.joint_stiffness + joint_drag
    unit = np.where(linkage.turning, 1.0, linkage.length)
    held = stiff.sum(axis=0) + drag * np.eye(6)
    moved = np.zeros(6)
    started = joint_values
    pose = pose.copy()
    places = np.arange(diagonal.shape[1])
    for _ in range(_MOST_ITERATIONS):
        placement = linkage.placement(joint_values)
        strain = linkage.gaps(placement, pose) - structure.strut_offsets
        pulled = np.swapaxes(placement.motions, 1, 2) @ stiff
        joints = pulled @ placement.motions
        joints[:, places, places] += diagonal
        slope = (
            (pulled @ strain[..., None])[..., 0]
            + structure.joint_stiffness * (joint_values - structure.joint_rest)
            + joint_drag * (joint_values - started)
        )
        right = np.concatenate([pulled, (attached * slope)[..., None]], axis=2)
        solved = np.linalg.solve(joints, right)
        carried = np.tensordot(pulled, solved, axes=([0, 1], [0, 1]))
        spring = (stiff @ strain[..., None]).sum(axis=0)[:, 0]
        force = spring - carried[:, 6] + structure.load - drag * moved
        step = np.linalg.solve(held - carried[:, :6], force)
        joint_step = (solved[..., :6] @ step) - solved[..., 6]
        size = max(
            float(np.abs(step).max()) / linkage.length, float(np.abs(joint_step / unit).max())
        )
        if size > _LONGEST_STEP:
            step *= _LONGEST_STEP / size
            joint_step *= _LONGEST_STEP / size
        joint_values = joint_values + joint_step
        pose[:3, :3] = _turned(pose[:3, :3], step[:3] / linkage.length)
        pose[:3, 3] += step[3:]
        moved += step
        if size < _SMALL_STEP:
            break
    return pose, joint_values


def strut_stiffnesses(linkage: Linkage, along: float, across: float) -> FloatArray:
    """Return what holds the struts' ends of ``linkage`` to the platform, (s, 6, 6), N/m, metric.

    The stiffness is ``along`` in the directions in which the joints of the strut move its end at
    home, and ``across`` in those that the joints bar, where flexures give way; N/m.
    """
    motions = linkage.placement(np.zeros(linkage.real.shape)).motions
    movable = motions @ np.linalg.pinv(motions, rcond=1e-9)
    return across * np.eye(6) + (along - across) * np.asarray(movable)


def attached_values(
    linkage: Linkage, strut: int, movable: FloatArray, pose: FloatArray, joint_values: FloatArray
) -> FloatArray:
    """Return joint values (s, k) with the end of one strut brought to the platform.

    Least squares by Gauss-Newton, with the shortest step each time. A gap that the joints cannot
    close is left open.

    Parameters
    ----------
    linkage : Linkage
    strut : int
        Which one.
    movable : (k,) array
        1 where a joint of it may move, 0 where it may not.
    pose : (4, 4) array
        Of the platform.
    joint_values : (s, k) array
        Where to start, radians and metres from home.
    """
    unit = movable * np.where(linkage.turning[strut], 1.0, linkage.length)
    joint_values = joint_values.copy()
    for _ in range(50):
        placement = linkage.placement(joint_values)
        gap = linkage.gaps(placement, pose)[strut]
        step, *_ = np.linalg.lstsq(placement.motions[strut] * unit, -gap, rcond=1e-9)
        size = float(np.abs(step).max())
        joint_values[strut] += unit * step * min(1.0, _LONGEST_STEP / max(size, 1e-300))
        if size < 1e-12:
            break
    return joint_values


def _turned(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    """Return ``rotation`` (3, 3) turned by the rotation vector (3,), kept orthonormal."""
    x, y, z = (0.5 * vector).tolist()
    # Cayley's form: exact to the third order of the angle, and a rotation for every vector.
    scale = 2.0 / (1.0 + x * x + y * y + z * z)
    hat = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned = rotation + scale * (hat + hat @ hat) @ rotation
    # One Newton step towards the nearest rotation keeps rounding from piling up.
    return np.asarray(1.5 * turned - 0.5 * turned @ turned.T @ turned)
