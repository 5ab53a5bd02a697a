# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Legs of the usual types, from the points and axes that data sheets give.

A type is spelt by its joints from the base to the platform: R revolute, P prismatic, U universal,
S spherical. The prismatic joint is driven; where there is none, the revolute one (a crank).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.parts import Actuator, Joint, JointKind, Strut

LEG_TYPES = ('UPS', 'SPS', 'PUS', 'PSS', 'RSS', 'RPS', 'PRS')

NEEDS = {
    'UPS': (), 'SPS': (), 'PUS': ('slide',), 'PSS': ('slide',), 'RSS': ('hinge', 'knee'),
    'RPS': ('hinge',), 'PRS': ('slide', 'hinge'),
}
"""What each type needs beside its points at the base and at the platform: the direction its slide
goes in where that is not along the leg, the axis of its hinge, and the end of its crank."""

_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Leg:
    """One leg at home, base axes, metres and radians.

    Attributes
    ----------
    kind : str
        One of `LEG_TYPES`.
    base, platform : (3,) array
        Centres of its first joint (a slide stands there at home) and of its last one.
    drive : Actuator
        Name, limits and readings of its drive; what it drives is filled in by `strut_of`.
    slide, hinge : (3,) array, optional
        Direction of a slide, positive that way, and of a hinge's axis, right-handed.
    knee : (3,) array, optional
        Centre of the joint at the end of a crank.
    """

    kind: str
    base: FloatArray
    platform: FloatArray
    drive: Actuator
    slide: FloatArray | None = None
    hinge: FloatArray | None = None
    knee: FloatArray | None = None

    @property
    def rod(self) -> FloatArray:
        """From the joint before the last to the last one, (3,)."""
        return self.platform - (self.base if self.knee is None else self.knee)

    @property
    def turns(self) -> bool:
        """Whether its drive turns."""
        return 'P' not in self.kind

    @property
    def points(self) -> list[FloatArray]:
        """Its points, (3,) each."""
        return [self.base, self.platform, *([] if self.knee is None else [self.knee])]


def strut_of(leg: Leg, number: int) -> Strut:
    """Return ``leg`` as the strut of that ``number``.

    MechanismError if its points or axes do not make a leg.
    """
    _require_shape(leg)
    joints: list[Joint] = []
    driven = leg.kind.index('R' if leg.turns else 'P')
    for place, letter in enumerate(leg.kind):
        last = place == len(leg.kind) - 1
        point = leg.base if leg.knee is None or place == 0 else leg.knee
        if last:
            point = leg.platform
        if letter == 'P':
            axes = {leg.drive.name: leg.rod if leg.slide is None else leg.slide}
        elif letter == 'R':
            name = leg.drive.name if place == driven else f'hinge_{number}'
            axes = {name: np.asarray(leg.hinge)}
        elif letter == 'U':
            axes = {f'universal_{number}.{label}': axis
                    for label, axis in zip('12', across(leg.rod), strict=True)}
        else:
            name = 'ball' if last else 'knee' if leg.turns else 'foot'
            axes = {f'{name}_{number}.{label}': axis
                    for label, axis in zip('xyz', np.eye(3), strict=True)}
        kind: JointKind = 'prismatic' if letter == 'P' else 'revolute'
        for name, axis in axes.items():
            joints.append(Joint(name, kind, axis, point))
            if place == driven:
                drive = replace(leg.drive, joint=name, strut=f'strut_{number}', kind=kind)
                joints[-1] = replace(joints[-1], actuator=drive)
    return Strut(f'strut_{number}', tuple(joints))


def across(rod: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the axes (3,) of a universal joint whose ``rod`` (3,) spins about neither.

    The first one is level where the rod does not stand upright.
    """
    level = np.cross(rod, [0.0, 0.0, 1.0])
    if np.linalg.norm(level) < _SAME * np.linalg.norm(rod):
        level = np.array([1.0, 0.0, 0.0])
    other = np.cross(rod, level)
    return level / np.linalg.norm(level), other / np.linalg.norm(other)


def _require_shape(leg: Leg) -> None:
    """Refuse legs of no length, and axes along which nothing could move."""
    name = leg.drive.name
    for key in NEEDS[leg.kind]:
        if getattr(leg, key) is None:
            raise MechanismError(name, key, f'is missing for a leg of type {leg.kind}')
    size = max(float(np.abs(point).max()) for point in leg.points)
    if np.linalg.norm(leg.rod) <= _SAME * size:
        ends = 'base and platform' if leg.knee is None else 'knee and platform'
        raise MechanismError(name, '', f'{ends} points are the same')
    for key in ('slide', 'hinge'):
        axis = getattr(leg, key)
        if axis is not None and not np.linalg.norm(axis):
            raise MechanismError(name, key, 'is a direction of no length')
    if leg.hinge is not None and leg.slide is None:
        arm = leg.rod if leg.knee is None else leg.knee - leg.base
        if np.linalg.norm(np.cross(leg.hinge, arm)) <= _SAME * np.linalg.norm(arm):
            what = 'leg' if leg.knee is None else 'crank, or the crank has no length'
            raise MechanismError(name, 'hinge', f'its axis is along the {what}')
