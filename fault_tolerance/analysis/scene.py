# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism as points and directions, ready to be drawn by anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import Configuration
from fault_tolerance.mechanism.parts import Joint, Strut
from fault_tolerance.mechanism.screws import exponential

# A prismatic joint at an end of a chain has no place of its own: it is drawn so far from its
# neighbour, in sizes of the whole mechanism.
_STUB = 0.2
_SAME_PLACE = 1e-6


@dataclass(frozen=True, eq=False)
class Axis:
    """One axis of a joint: its direction now (3,), and the actuator that drives it, or ''."""

    direction: FloatArray
    actuator: str


@dataclass(frozen=True, eq=False)
class DrawnJoint:
    """A joint as it was written: its ``letter`` is R, P, U or S, its ``place`` (3,) metres now."""

    name: str
    letter: str
    place: FloatArray
    axes: tuple[Axis, ...]


@dataclass(frozen=True, eq=False)
class DrawnStrut:
    """A strut and its joints, base to platform."""

    name: str
    joints: tuple[DrawnJoint, ...]


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything there is to see of a mechanism, in base axes and metres.

    ``pose`` (4, 4) is the platform frame, ``corners`` (s, 3) where on the platform the struts are,
    or were before they were lost, ``size`` the diagonal of the box around everything. ``normal``
    (3,) is the direction from which to look at a planar mechanism.
    """

    name: str
    struts: tuple[DrawnStrut, ...]
    pose: FloatArray
    corners: FloatArray
    size: float
    normal: FloatArray | None

    @property
    def places(self) -> FloatArray:
        """The places of all joints and of the platform's origin, (k, 3)."""
        places = [joint.place for strut in self.struts for joint in strut.joints]
        return np.array([*places, self.pose[:3, 3]])


def scene_of(configuration: Configuration) -> Scene:
    """Return what there is to see of a mechanism at ``configuration``.

    MechanismError if it is given by its Jacobian.
    """
    mechanism = configuration.mechanism
    if not mechanism.struts:
        reason = 'is given by its Jacobian: there is nothing to draw'
        raise MechanismError(mechanism.name, '', reason)
    pose = configuration.pose
    moved = list(map(_moved, mechanism.struts, configuration.joint_values))
    fixed = [
        place for joints in moved for joint, place, _ in joints if joint.kind == 'revolute'
    ]
    size = _diagonal(np.array([*fixed, pose[:3, 3]])) or mechanism.characteristic_length
    struts = tuple(
        DrawnStrut(strut.name, _drawn(strut, joints, pose[:3, 3], size))
        for strut, joints in zip(mechanism.struts, moved, strict=True)
    )
    tips = [
        _drawn(strut, _moved(strut, np.zeros(len(strut.joints))), mechanism.origin, size)[-1].place
        for strut in mechanism.struts
    ]
    corners = pose[:3, 3] + (np.array(tips) - mechanism.origin) @ pose[:3, :3].T
    scene = Scene(mechanism.name, struts, pose, corners, size, None)
    return replace(scene, size=_diagonal(scene.places) or 1.0, normal=_common_normal(scene))


def _diagonal(points: FloatArray) -> float:
    """Return the diagonal of the box around ``points`` (k, 3)."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def joint_groups(strut: Strut) -> list[tuple[str, tuple[Joint, ...]]]:
    """Return name and axes of the joints of ``strut``, base to platform.

    Universal and spherical joints are whole, as they were written.
    """
    groups: list[tuple[str, tuple[Joint, ...]]] = []
    for prefix, members in groupby(strut.joints, key=lambda joint: joint.name.rpartition('.')[0]):
        joints = tuple(members)
        if prefix and len(joints) > 1:
            groups.append((prefix, joints))
        else:
            groups += [(joint.name, (joint,)) for joint in joints]
    return groups


def joint_letter(joints: Sequence[Joint]) -> str:
    """Return R, P, U or S for the axes ``joints`` of one joint."""
    if len(joints) == 1:
        return joints[0].kind[0].upper()
    return 'U' if len(joints) == 2 else 'S'


def _moved(strut: Strut, values: FloatArray) -> list[tuple[Joint, FloatArray, FloatArray]]:
    """Return the joints with the places and directions of their axes now."""
    before = np.eye(4)
    moved = []
    for joint, value in zip(strut.joints, values, strict=False):
        place = before[:3, :3] @ joint.point + before[:3, 3]
        moved.append((joint, place, before[:3, :3] @ joint.axis))
        before = before @ exponential(joint.screw * value)
    return moved


def _drawn(
    strut: Strut, moved: list[tuple[Joint, FloatArray, FloatArray]], platform: FloatArray,
    size: float,
) -> tuple[DrawnJoint, ...]:
    where = {joint.name: (place, axis) for joint, place, axis in moved}
    groups = joint_groups(strut)
    written = [(joint_letter(joints), *where[joints[0].name]) for _, joints in groups]
    drawn = []
    for (name, joints), place in zip(groups, _placed(written, platform, size), strict=True):
        axes = tuple(
            Axis(where[joint.name][1], joint.actuator.name if joint.actuator else '')
            for joint in joints
        )
        drawn.append(DrawnJoint(name, joint_letter(joints), place, axes))
    return tuple(drawn)


def _placed(
    joints: list[tuple[str, FloatArray, FloatArray]], platform: FloatArray, size: float
) -> list[FloatArray]:
    """Return where to draw the joints (letter, place, axis): sliders between their neighbours."""
    fixed = [index for index, (letter, _, _) in enumerate(joints) if letter != 'P']
    stub = _STUB * size
    places: list[FloatArray] = []
    for index, (letter, place, axis) in enumerate(joints):
        if letter != 'P':
            places.append(place)
            continue
        before = max((other for other in fixed if other < index), default=None)
        after = min((other for other in fixed if other > index), default=None)
        if before is not None and after is not None:
            share = (index - before) / (after - before)
            places.append((1.0 - share) * joints[before][1] + share * joints[after][1])
        elif before is not None:
            places.append(places[-1] + stub * axis)
        else:
            end = platform if after is None else joints[after][1]
            steps = [other_axis for _, _, other_axis in joints[index:after]]
            places.append(end - stub * np.sum(steps, axis=0))
    return places


def _common_normal(scene: Scene) -> FloatArray | None:
    """Return the normal of the plane in which everything moves, if there is one."""
    joints = [joint for strut in scene.struts for joint in strut.joints]
    turning = [axis.direction for one in joints if one.letter != 'P' for axis in one.axes]
    sliding = [one.axes[0].direction for one in joints if one.letter == 'P']
    if not turning:
        return None
    normal = turning[0]
    parallel = all(np.linalg.norm(np.cross(axis, normal)) < _SAME_PLACE for axis in turning)
    across = all(abs(float(axis @ normal)) < _SAME_PLACE for axis in sliding)
    heights = scene.places @ normal
    if not (parallel and across and np.ptp(heights) < _SAME_PLACE * scene.size):
        return None
    return normal if normal.sum() > 0.0 else -normal
