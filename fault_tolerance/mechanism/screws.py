# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Screw theory, batched: exponentials, adjoints and pose differences.

A twist is ``[w; v]``: angular velocity, then the linear velocity of the body point that passes
through the reference point. Poses are 4 x 4 homogeneous matrices. Every function takes leading
batch axes. Formulas: Murray, Li and Sastry, *A Mathematical Introduction to Robotic
Manipulation* (1994), chapter 2.
"""

from __future__ import annotations

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.tolerances import NO_ANGLE, SERIES_ANGLE

BASE_ORIGIN = np.zeros(3)
_NEXT, _AFTER = [1, 2, 0], [2, 0, 1]


def skew(vectors: FloatArray) -> FloatArray:
    """Return the cross-product matrices (..., 3, 3) of ``vectors`` (..., 3)."""
    result = np.zeros((*vectors.shape, 3))
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    result[..., 0, 1], result[..., 0, 2] = -z, y
    result[..., 1, 0], result[..., 1, 2] = z, -x
    result[..., 2, 0], result[..., 2, 1] = -y, x
    return result


def exponential(twists: FloatArray) -> FloatArray:
    """Return the displacements (..., 4, 4) that unit time along ``twists`` (..., 6) makes.

    Rotation by Rodrigues' formula; translation ``V v`` with the left Jacobian V of the rotation.
    """
    w = twists[..., :3]
    squared = np.einsum('...i,...i->...', w, w)
    angle = np.sqrt(squared)
    small = angle < SERIES_ANGLE
    safe = np.where(small, 1.0, angle)
    sine = np.where(small, 1.0 - squared / 6.0 + squared**2 / 120.0, np.sin(safe) / safe)
    # 1 - cos is computed as a square: the difference would lose digits.
    half = np.sin(0.5 * safe) / safe
    cosine = np.where(small, 0.5 - squared / 24.0 + squared**2 / 720.0, 2.0 * half * half)
    series = 1.0 / 6.0 - squared / 120.0 + squared**2 / 5040.0
    cubic = np.where(small, series, (safe - np.sin(safe)) / safe**3)
    hat = skew(w)
    hat_squared = hat @ hat
    result = np.zeros((*twists.shape[:-1], 4, 4))
    eye = np.eye(3)
    sine, cosine, cubic = (each[..., None, None] for each in (sine, cosine, cubic))
    result[..., :3, :3] = eye + sine * hat + cosine * hat_squared
    left = eye + cosine * hat + cubic * hat_squared
    result[..., :3, 3] = np.einsum('...ij,...j->...i', left, twists[..., 3:])
    result[..., 3, 3] = 1.0
    return result


def powers(screws: FloatArray) -> FloatArray:
    """Return the first three powers (3, ..., 4, 4) of the matrices of unit screws (..., 6)."""
    matrix = np.zeros((*screws.shape[:-1], 4, 4))
    matrix[..., :3, :3] = skew(screws[..., :3])
    matrix[..., :3, 3] = screws[..., 3:]
    squared = matrix @ matrix
    return np.stack([matrix, squared, squared @ matrix])


def joint_displacements(screw_powers: FloatArray, values: FloatArray) -> FloatArray:
    """Return the displacements (..., 4, 4) of joints with ``screw_powers`` by ``values`` (...).

    ``exp(q S) = I + q S + (1 - cos q) S^2 + (q - sin q) S^3`` for unit screws of both kinds.
    """
    factors = np.stack([values, 2.0 * np.sin(0.5 * values) ** 2, values - np.sin(values)])
    return np.asarray(np.eye(4) + (factors[..., None, None] * screw_powers).sum(axis=0))


def transformed(
    poses: FloatArray, twists: FloatArray, point: FloatArray = BASE_ORIGIN
) -> FloatArray:
    """Return ``twists`` (..., 6) carried along by ``poses`` (..., 4, 4): the adjoint of the pose.

    Velocities of ``twists`` are taken at the base origin, those of the result at ``point`` (3,).
    """
    pair = np.swapaxes(twists.reshape(*twists.shape[:-1], 2, 3), -1, -2)
    turned = poses[..., :3, :3] @ pair
    w = turned[..., 0]
    return np.concatenate([w, turned[..., 1] + cross(poses[..., :3, 3] - point, w)], axis=-1)


def cross(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the cross products of ``left`` and ``right`` (..., 3), faster than numpy for few."""
    return np.asarray(
        left[..., _NEXT] * right[..., _AFTER] - left[..., _AFTER] * right[..., _NEXT]
    )


def rotation_vector(rotations: FloatArray) -> FloatArray:
    """Return the rotation vectors (..., 3) of ``rotations`` (..., 3, 3), angles up to pi."""
    r = rotations
    trace = r[..., 0, 0] + r[..., 1, 1] + r[..., 2, 2]
    if trace.min(initial=3.0) < 1.0:
        return _rotation_vector_by_quaternion(r, trace)
    # Up to a right angle the antisymmetric part determines the rotation.
    axis = 0.5 * (r[..., _AFTER, _NEXT] - r[..., _NEXT, _AFTER])
    sine = np.sqrt(np.einsum('...i,...i->...', axis, axis))
    small = sine < NO_ANGLE
    angle = np.arctan2(sine, 0.5 * (trace - 1.0))
    factor = np.where(small, 1.0, angle / np.where(small, 1.0, sine))
    return np.asarray(factor[..., None] * axis)


def _rotation_vector_by_quaternion(r: FloatArray, trace: FloatArray) -> FloatArray:
    """Go through the unit quaternion of largest component: well conditioned at every angle."""
    diagonal = np.stack([r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]], axis=-1)
    # Rows of 4 q q^T: each is the quaternion (w, x, y, z) times four times one component.
    outer = np.empty((*r.shape[:-2], 4, 4))
    outer[..., 0, 0] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        outer[..., 0, i + 1] = outer[..., i + 1, 0] = r[..., k, j] - r[..., j, k]
        outer[..., i + 1, i + 1] = 1.0 + 2.0 * diagonal[..., i] - trace
        outer[..., i + 1, j + 1] = outer[..., j + 1, i + 1] = r[..., i, j] + r[..., j, i]
    largest = np.argmax(np.einsum('...ii->...i', outer), axis=-1)
    quaternion = np.take_along_axis(outer, largest[..., None, None], axis=-2)[..., 0, :]
    quaternion = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    quaternion = np.where(quaternion[..., :1] < 0.0, -quaternion, quaternion)
    sine = np.linalg.norm(quaternion[..., 1:], axis=-1)
    half = np.arctan2(sine, quaternion[..., 0])
    factor = np.where(sine < NO_ANGLE, 2.0, 2.0 * half / np.where(sine < NO_ANGLE, 1.0, sine))
    return np.asarray(factor[..., None] * quaternion[..., 1:])


def rotation_vector_rates(vector: FloatArray) -> FloatArray:
    """Return what turns an angular velocity into the rate of a rotation vector, (3, 3).

    The inverse of the left Jacobian at the rotation ``vector`` (3,), shorter than 2 pi.
    """
    angle, hat = float(np.linalg.norm(vector)), skew(vector)
    if angle < SERIES_ANGLE:
        factor = 1.0 / 12.0 + angle**2 / 720.0
    else:
        factor = (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    return np.asarray(np.eye(3) - 0.5 * hat + factor * hat @ hat)


def difference(target: FloatArray, poses: FloatArray) -> FloatArray:
    """Return the displacements (..., 6) from ``poses`` to ``target``, both (..., 4, 4).

    ``[w; v]`` in base axes: the rotation vector of ``R_target R^T`` and the distance of the two
    origins. To first order the twist, at the moving origin, that brings one onto the other.
    """
    rotation = target[..., :3, :3] @ np.swapaxes(poses[..., :3, :3], -1, -2)
    translation = np.broadcast_to(target[..., :3, 3] - poses[..., :3, 3], (*rotation.shape[:-1],))
    return np.concatenate([rotation_vector(rotation), translation], axis=-1)


def displaced(pose: FloatArray, displacement: FloatArray) -> FloatArray:
    """Return ``pose`` (..., 4, 4) moved by ``displacement`` (..., 6): inverse of `difference`.

    The rotation is made orthonormal again: rounding errors must not add up in warm starts.
    """
    result = np.array(pose)
    rotation = np.zeros_like(displacement)
    rotation[..., :3] = displacement[..., :3]
    turned = exponential(rotation)[..., :3, :3] @ pose[..., :3, :3]
    # One Newton step towards the nearest orthonormal matrix.
    gram = np.swapaxes(turned, -1, -2) @ turned
    result[..., :3, :3] = turned @ (1.5 * np.eye(3) - 0.5 * gram)
    result[..., :3, 3] += displacement[..., 3:]
    return result
