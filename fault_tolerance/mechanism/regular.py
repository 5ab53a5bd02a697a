# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The short way to what the struts say, where the joints of each strut are independent.

Nearly every strut has at most six joints whose screws are independent. Then its screws, made
square by fixed directions C that fill the gap, have one inverse,

    [S C]^-1 = [S'; n]        S' S = I,   n S = 0,

and all there is to know of the strut is read from it: the rows n are its structure, and with V
freed of its part along n the rows S' give the rate of every joint, driven or not. One stacked
inversion serves all struts, in place of two or three singular value decompositions each
(`fault_tolerance.mechanism.constraints`, which stays the definition). Where the inverse is large
the struts are near a singularity of their own: the definition decides there.

Screws are carried along the chains by 6 x 6 adjoints, as products of exponentials; these start
at the platform's origin, so all twists come out taken there, scaled.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import cast

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.screws import moved_to, rotation_vector, skew
from fault_tolerance.tolerances import RANK_TOLERANCE, WELL_CONDITIONED

# The inverse may be this large (Frobenius norm, on unit columns) before the definition decides.
_LARGEST_INVERSE = 1e3
# Independent at home means: the smallest singular value of unit columns is above this.
_INDEPENDENT = 5e-3
# A tenth of what the definition asks for, so that both come to the same decision.
_CONDITION = 0.1 / WELL_CONDITIONED
# The trace of a rotation by less than 1e-5, and by less than 1e-2 radians.
_NO_ROTATION, _SMALL_ROTATION = 3.0 - 1e-10, 3.0 - 1e-4


@dataclass(frozen=True, eq=False)
class Placement:
    """Where pose and joint values put the struts.

    Attributes
    ----------
    pose : (4, 4) array
    joint_values : (s, k) array
    adjoints : (k + 1, s, 6, 6) array
        What carries twists from home to before joint j, scaled, v at the platform's origin.
    openings : (s, 6) array
        From each strut's tip to the platform, scaled: metres.
    """

    pose: FloatArray
    joint_values: FloatArray
    adjoints: FloatArray
    openings: FloatArray


@dataclass(frozen=True, eq=False)
class StrutInverses:
    """What the inverted struts say.

    Attributes
    ----------
    joints : (s, k, 6) array
        Rows that give the rates of all joints for a scaled twist, at right angles to the
        structure of the strut: what that bars counts for nothing.
    structure : (g, 6) array
        ``0 = structure @ V``; orthonormal within each strut, in the order of the struts.
    actuator_rows : (N, 6) array
        ``q'_a = actuator_rows @ V``, at right angles to the structure of the strut.
    """

    joints: FloatArray
    structure: FloatArray
    actuator_rows: FloatArray

    def joint_rates(self, twists: FloatArray) -> FloatArray:
        """Return the rates (s, k) with which the joints follow scaled ``twists`` (s, 6).

        One twist for each strut, of which it follows all that its structure does not bar.
        """
        rates: FloatArray = np.matmul(self.joints, twists[..., None])[..., 0]
        return rates


class RegularStruts:
    """The constants of a mechanism all of whose struts are regular; made by `regular_struts`.

    Parameters
    ----------
    screws : (s, k, 6) array
        Joint twists at home, unit screws, v at the base origin; zero where padded.
    real : (s, k) bool array
        False where padded.
    places : tuple of two (N,) int arrays
        Strut and joint of each actuator.
    length : float
        The characteristic length.
    origin : (3,) array
        The platform's origin at home.
    filling : (s, 6, 6) array
        The columns C, after as many zero ones as the strut has joints.

    Attributes
    ----------
    gaps : (s,) int array
        How many columns of C each strut has, its structural rows.
    structure_strut : (g,) int array
        The strut each structural row belongs to.
    places : tuple of two (N,) int arrays
    drive_sizes : (N,) array
        Lengths of the actuated joints' scaled screws at home: metres per unit of the joint.
    sizes : (s, k) array
        Lengths of all joints' scaled screws at home, 1 where padded.
    filling : (s, 6, 6) array
    limits : (3,) array
        How large an inverse may be before the definition decides, squared; what times it, and
        times the square of the columns unless the third is not 0, may be no more than 1.
    """

    def __init__(
        self,
        screws: FloatArray,
        real: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
        places: tuple[IntArray, IntArray],
        length: float,
        origin: FloatArray,
        filling: FloatArray,
    ) -> None:
        count, joints = real.shape
        self.places = places
        self.gaps: IntArray = 6 - real.sum(axis=1)
        self.structure_strut: IntArray = np.repeat(np.arange(count), self.gaps)
        self.sizes: FloatArray = _sizes(screws, real, length, origin)
        self.filling = filling
        self._length = length
        self._start = np.diag([length] * 3 + [1.0] * 3)
        sizes = self.sizes
        self.drive_sizes: FloatArray = sizes[places]
        self._screws = np.swapaxes(screws / sizes[..., None], 0, 1)[..., None].copy()
        self._reciprocal = np.where(real, 1.0 / sizes, 0.0)[..., None]
        self._powers = _adjoint_powers(np.swapaxes(screws, 0, 1), origin)
        self._ones = np.ones((joints, count, 1, 4))
        self._opening = _opening_map(length)
        # Which rows of the inverse are structure.
        slots = [6 - gap + row for gap in self.gaps.tolist() for row in range(gap)]
        self._normals = self.structure_strut, np.array(slots, dtype=np.intp)
        self._widest = int(self.gaps.max())
        self._uniform = bool((self.gaps == self._widest).all())
        turning = np.abs(screws[places][:, :3]).max(axis=1) > 0.0
        rate_scale = np.where(turning, length, 1.0)
        self._slides = not turning.any()
        self._spread = float((rate_scale / self.drive_sizes).max()) ** 2
        self._reach = float((self.drive_sizes / rate_scale).max()) ** 2
        self.limits = np.array([
            _LARGEST_INVERSE**2, self._spread * self._reach / _CONDITION**2, float(self._slides),
        ])

    def with_filling(self, structure: FloatArray, struts: IntArray) -> RegularStruts | None:
        """Return the same with ``structure`` (g, 6) of ``struts`` (g,) as columns C, if it fits.

        For a configuration far from where the present C was made.
        """
        if not np.array_equal(struts, self.structure_strut):
            return None
        other = copy(self)
        other.filling = np.zeros_like(self.filling)
        owner, slot = self._normals
        other.filling[owner, :, slot] = structure
        return other

    def placed(self, pose: FloatArray, joint_values: FloatArray) -> Placement:
        """Return where ``pose`` (4, 4) and ``joint_values`` (s, k) put the struts."""
        values = joint_values.T
        factors = self._ones.copy()
        terms = factors[:, :, 0]
        terms[..., 1] = values
        half = np.sin(0.5 * values)
        half *= half
        np.multiply(half, 2.0, out=terms[..., 2])
        np.subtract(values, np.sin(values), out=terms[..., 3])
        joints, count = values.shape
        steps = np.matmul(factors, self._powers).reshape(joints, count, 6, 6)
        adjoints = np.empty((joints + 1, count, 6, 6))
        x, y, z = pose[:3, 3].tolist()
        start = self._start.copy()
        start[3, 1], start[3, 2], start[4, 2] = z, -y, x
        start[4, 0], start[5, 0], start[5, 1] = -z, y, -x
        adjoints[0] = start
        for joint in range(joints):
            np.matmul(adjoints[joint], steps[joint], out=adjoints[joint + 1])
        return Placement(pose, joint_values, adjoints, self._openings(pose, adjoints[joints]))

    def inverted(self, placement: Placement) -> StrutInverses | None:
        """Return what the struts say at ``placement``; None where they are nearly singular."""
        columns = np.matmul(placement.adjoints[:-1], self._screws)[..., 0]
        matrices = self.filling.copy()
        filled = matrices[:, :, : len(columns)]
        np.add(filled, columns.transpose(1, 2, 0), out=filled)
        try:
            inverses = cast(FloatArray, np.linalg.inv(matrices))
        except np.linalg.LinAlgError:
            return None
        if not self._well_conditioned(matrices, inverses):
            return None
        structure, by_strut = self._structure(inverses)
        joints = inverses[:, : len(columns)] * self._reciprocal
        if self._widest:
            along = np.matmul(joints, by_strut.transpose(0, 2, 1))
            joints -= np.matmul(along, by_strut)
        return StrutInverses(joints, structure, joints[self.places])

    def _openings(self, pose: FloatArray, tips: FloatArray) -> FloatArray:
        """Return the scaled openings (s, 6) from the adjoints of the tips (s, 6, 6)."""
        # [R_pose; X R] R^t with the rotation R of the tip and X, the cross product by the way
        # from the platform's origin to the tip.
        left = tips[:, :, :3].copy()
        left[:, :3] = pose[:3, :3]
        products = np.matmul(left, tips[:, 3:, 3:].transpose(0, 2, 1))
        found = products.reshape(-1, 18).dot(self._opening)
        openings: FloatArray = found[:, :6]
        least = float(found[:, 6].min())
        if least > _NO_ROTATION:
            return openings
        if least > _SMALL_ROTATION:
            # The angle from its sine, by the series of the arc sine.
            squared = (3.0 - found[:, 6:]) * (0.25 * (1.0 + found[:, 6:]))
            openings[:, :3] *= 1.0 + squared * (1.0 / 6.0 + squared * 0.075)
        else:
            openings[:, :3] = self._length * rotation_vector(products[:, :3])
        return openings

    def _structure(self, inverses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the structural rows (g, 6), orthonormal within struts, and strut by strut."""
        count = len(inverses)
        if self._widest == 0:
            return np.zeros((0, 6)), np.zeros((count, 0, 6))
        if self._uniform and self._widest == 1:
            rows = inverses[:, 5:]
            rows = rows / np.sqrt(np.matmul(rows, rows.transpose(0, 2, 1)))
            return rows[:, 0], rows
        owner, slot = self._normals
        by_strut = np.zeros((count, self._widest, 6))
        for gap in np.unique(self.gaps[self.gaps > 0]).tolist():
            members = np.flatnonzero(self.gaps == gap)
            rows = inverses[members, 6 - gap :]
            basis = np.linalg.qr(np.swapaxes(rows, 1, 2))[0]
            by_strut[members, :gap] = np.swapaxes(basis, 1, 2)
        return by_strut[owner, slot - 6 + self.gaps[owner]], by_strut

    def _well_conditioned(self, matrices: FloatArray, inverses: FloatArray) -> bool:
        """Return whether struts and drives are certainly far from singular.

        Sums over all struts first, which are cheap and nearly always small enough; then the
        largest strut, as there may be many. NaN fails every comparison.
        """
        flat = inverses.ravel()
        inverse = float(flat.dot(flat))
        reach = self._reach
        if not self._slides:
            flat = matrices.ravel()
            reach *= float(flat.dot(flat))
        if inverse <= _LARGEST_INVERSE**2 and self._spread * reach * inverse <= _CONDITION**2:
            return True
        inverse = float(np.einsum('sij,sij->s', inverses, inverses).max())
        reach = self._reach
        if not self._slides:
            reach *= float(np.einsum('sij,sij->s', matrices, matrices).max())
        return bool(
            inverse <= _LARGEST_INVERSE**2 and self._spread * reach * inverse <= _CONDITION**2
        )


def regular_struts(
    screws: FloatArray,
    real: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
    places: tuple[IntArray, IntArray],
    length: float,
    origin: FloatArray,
) -> RegularStruts | None:
    """Return the struts prepared for the short way; None if some are not regular at home.

    Parameters are those of `RegularStruts`.
    """
    if real.shape[1] > 6:
        return None
    sizes = _sizes(screws, real, length, origin)
    if sizes[real].max() * RANK_TOLERANCE > 1e-3 * sizes[real].min():
        return None  # the definition, which compares joints with each other, may see less
    filling = np.zeros((len(real), 6, 6))
    moved = _at_origin(screws, length, origin) / sizes[..., None]
    for strut, joints in enumerate(real.sum(axis=1).tolist()):
        left, sigma, _ = np.linalg.svd(moved[strut, :joints].T)
        if sigma[-1] < _INDEPENDENT:
            return None
        filling[strut, :, joints:] = left[:, joints:]
    return RegularStruts(screws, real, places, length, origin, filling)


def _at_origin(screws: FloatArray, length: float, origin: FloatArray) -> FloatArray:
    """Return the screws, scaled, with v at ``origin``."""
    moved = moved_to(screws, origin)
    moved[..., :3] *= length
    return moved


def _sizes(
    screws: FloatArray,
    real: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
    length: float,
    origin: FloatArray,
) -> FloatArray:
    """Return the lengths (s, k) of the scaled screws at home, 1 where padded."""
    return np.where(real, np.linalg.norm(_at_origin(screws, length, origin), axis=-1), 1.0)


def _adjoint_powers(screws: FloatArray, origin: FloatArray) -> FloatArray:
    """Return the coefficients (k, s, 4, 36) of the joints' adjoints; the last takes home along.

    ``Ad exp(q S) = 1 + q s + (1 - cos q) s^2 + (q - sin q) s^3`` with s the matrix of the Lie
    bracket with S, for unit screws, revolute or prismatic.
    """
    bracket = np.zeros((*screws.shape[:-1], 6, 6))
    bracket[..., :3, :3] = bracket[..., 3:, 3:] = skew(screws[..., :3])
    bracket[..., 3:, :3] = skew(screws[..., 3:])
    squared = bracket @ bracket
    one = np.broadcast_to(np.eye(6), bracket.shape)
    powers = np.stack([one, bracket, squared, squared @ bracket], axis=2)
    home = np.eye(6)
    home[3:, :3] = skew(origin)
    powers[-1] = powers[-1] @ home
    return powers.reshape(*powers.shape[:3], 36)


def _opening_map(length: float) -> FloatArray:
    """Return the linear map (18, 7) from two 3 x 3 matrices to a scaled opening, and a trace.

    The antisymmetric part of the first, times the characteristic length, and of the second,
    with the sign turned; then the trace of the first.
    """
    result = np.zeros((18, 7))
    for axis in range(3):
        after, last = (axis + 1) % 3, (axis + 2) % 3
        result[3 * last + after, axis] = 0.5 * length
        result[3 * after + last, axis] = -0.5 * length
        result[9 + 3 * last + after, 3 + axis] = -0.5
        result[9 + 3 * after + last, 3 + axis] = 0.5
        result[4 * axis, 6] = 1.0
    return result
