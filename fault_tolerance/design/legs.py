# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Struts that carry one force between two points, and their inverse kinematics in closed form.

UPS, SPS, SPU (a sliding drive between two ball-like joints) and PUS, PSS, RUS, RSS (a driven base
joint and a rod of fixed length). Their passive joints let the platform move as it likes, so a pose
gives the drive's value without closing a loop, and ``q' = F . v_b / (F . v_1)``: F along the line
of force, v_b the velocity of the point on the platform, v_1 what the drive moves per unit rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Joint, Strut
from fault_tolerance.tolerances import RANK_TOLERANCE

LEG, SLIDE, CRANK = range(3)
"""The drive changes the distance of the two points, or moves the lower one, straight or around."""


@dataclass(frozen=True, eq=False)
class Legs:
    """The s struts of a mechanism, each with one drive; points at home, metres, base axes."""

    kind: IntArray
    """(s,): `LEG`, `SLIDE` or `CRANK`."""
    actuator: IntArray
    """(s,): place of the drive in the mechanism's order."""
    axis: FloatArray
    """(s, 3): of the drive at home, a unit vector."""
    pivot: FloatArray
    """(s, 3): a point that stays: on a crank's axis, or else the lower one at home."""
    lower: FloatArray
    upper: FloatArray
    """(s, 3): the two points between which the force acts, the upper one on the platform."""
    origin: FloatArray
    """(3,): of the platform at home."""

    def __repr__(self) -> str:
        return f'Legs({len(self.kind)})'

    def solved(
        self, rotations: FloatArray, origins: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return drive values (B, s) and rows (B, s, 6), ``q' = row . [w; v]``, at B poses.

        The poses are ``rotations`` (B, 3, 3) and ``origins`` (B, 3) of the platform in base axes;
        NaN where a strut does not reach. v is at the platform's origin; m and rad.
        """
        arms = (self.upper - self.origin) @ np.swapaxes(rotations, 1, 2)
        reach = arms + origins[:, None] - self.pivot
        values, force = np.empty(reach.shape[:2]), reach.copy()
        slope = np.empty_like(values)
        with np.errstate(invalid='ignore', divide='ignore'):
            for kind, solve in ((LEG, self._leg), (SLIDE, self._slide), (CRANK, self._crank)):
                mine = self.kind == kind
                if mine.any():
                    found = solve(np.flatnonzero(mine), reach[:, mine])
                    values[:, mine], slope[:, mine], force[:, mine] = found
            force /= slope[..., None]
        return values, np.concatenate([np.cross(arms, force), force], axis=2)

    def _leg(self, i: IntArray, g: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return values, ``F . v_1`` and F: ``|e + q d| = |g|`` with e the strut at home."""
        e = self.upper[i] - self.lower[i]
        along = (e * self.axis[i]).sum(1)
        beside = (e * e).sum(1) - along**2
        slope = np.sign(along) * np.sqrt((g * g).sum(2) - beside)
        return slope - along, slope, g

    def _slide(self, i: IntArray, g: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return values, ``F . v_1`` and F: ``|g - q d|`` is the length of the rod."""
        e, d = self.upper[i] - self.lower[i], self.axis[i]
        along = (g * d).sum(2)
        square = along**2 - (g * g).sum(2) + (e * e).sum(1)
        slope = np.sign((e * d).sum(1)) * np.sqrt(square)
        values = along - slope
        return values, slope, g - values[..., None] * d

    def _crank(self, i: IntArray, g: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return values, ``F . v_1`` and F: ``x cos q + y sin q = k``."""
        e, d, arm = self.upper[i] - self.lower[i], self.axis[i], self.lower[i] - self.pivot[i]
        up = (arm * d).sum(1)[:, None] * d
        out, across = arm - up, np.cross(d, arm)
        x, y = (g * out).sum(2), (g * across).sum(2)
        k = ((g * g).sum(2) + (arm * arm).sum(1) - (e * e).sum(1)) / 2.0 - (g * up).sum(2)
        home = ((self.upper[i] - self.pivot[i]) * across).sum(1)
        slope = np.sign(home) * np.sqrt(x * x + y * y - k * k)
        values = np.arctan2(y, x) - np.arctan2(slope, k)
        values = (values + np.pi) % (2.0 * np.pi) - np.pi
        turned = np.cos(values)[..., None] * out + np.sin(values)[..., None] * across + up
        return values, slope, g - turned


@lru_cache(maxsize=64)
def legs_of(mechanism: Mechanism) -> Legs | None:
    """Return the struts of ``mechanism`` as `Legs`; None if one of them is of another kind."""
    found = [_leg_of(strut, mechanism.characteristic_length) for strut in mechanism.struts]
    parts = [one for one in found if one is not None]
    if not parts or len(parts) < len(found):
        return None
    kind, driven, pivot, lower, upper = zip(*parts, strict=True)
    places = [mechanism.actuator_index(strut.actuators[0].name) for strut in mechanism.struts]
    axes, below, first, second = (
        frozen(np.array(each)) for each in ([one.axis for one in driven], pivot, lower, upper)
    )
    kinds, drives = frozen(np.array(kind)), frozen(np.array(places))
    return Legs(kinds, drives, axes, below, first, second, mechanism.origin)


_Part = tuple[int, Joint, FloatArray, FloatArray, FloatArray]


def _leg_of(strut: Strut, length: float) -> _Part | None:
    """Return kind, driven joint, pivot, lower and upper point of ``strut``; None if other."""
    driven = [place for place, joint in enumerate(strut.joints) if joint.actuator is not None]
    if len(driven) != 1:
        return None
    place, joint = driven[0], strut.joints[driven[0]]
    below, above = strut.joints[:place], strut.joints[place + 1 :]
    sliding = joint.kind == 'prismatic'
    splits = [(LEG, below, above)] if below and sliding else []
    if not below:
        kind = SLIDE if sliding else CRANK
        splits = [(kind, above[:count], above[count:]) for count in (2, 3)]
    for kind, first, second in splits:
        points = _meeting(first, length), _meeting(second, length)
        if points[0] is None or points[1] is None or len(first) + len(second) < 5:
            continue
        e, pivot = points[1] - points[0], joint.point if kind == CRANK else points[0]
        moved = np.cross(joint.axis, points[0] - pivot) if kind == CRANK else joint.axis
        # A drive that does not change the distance has no closed form here, nor any force.
        if abs(e @ moved) > RANK_TOLERANCE * float(np.linalg.norm(e) * np.linalg.norm(moved)):
            return kind, joint, pivot, points[0], points[1]
    return None


def _meeting(joints: tuple[Joint, ...], length: float) -> FloatArray | None:
    """Return the point (3,) where the axes of two or three revolutes meet; None without."""
    if len(joints) not in (2, 3) or any(joint.kind != 'revolute' for joint in joints):
        return None
    axes = np.array([joint.axis for joint in joints])
    if np.linalg.svd(axes, compute_uv=False)[-1] <= RANK_TOLERANCE:
        return None
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    points = np.array([joint.point for joint in joints])
    point = np.linalg.solve(across.sum(0), np.einsum('jab,jb->a', across, points))
    off = np.einsum('jab,jb->ja', across, points - point)
    return point if np.abs(off).max() <= RANK_TOLERANCE * length else None
