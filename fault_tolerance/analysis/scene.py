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
from fault_tolerance.mechanism.description import Joint, Strut
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
    """A joint as it was written: revolute R, prismatic P, universal U or spherical S.

    Attributes
    ----------
    name, letter : str
    place : (3,) array
        Where it is now, metres, base axes.
    axes : tuple of Axis
    """

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
    """Everything there is to see of a mechanism.

    Attributes
    ----------
    name : str
    struts : tuple of DrawnStrut
    pose : (4, 4) array
        The platform frame in base axes.
    corners : (s, 3) array
        Where on the platform the struts are, or were before they were lost.
    size : float
        Diagonal of the box around it, metres.
    normal : (3,) array or None
        The direction from which to look at a planar mechanism.
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

    Raises
    ------
    MechanismError
        If it is given by numbers.
    """
    mechanism = configuration.mechanism
    if not mechanism.struts:
        raise MechanismError(mechanism.name, '', 'is given by numbers: there is nothing to draw')
    pose = configuration.pose
    moved = [
        _moved(strut, configuration.joint_values[place])
        for place, strut in enumerate(mechanism.struts)
    ]
    fixed = [
        place
        for joints in moved
        for joint, place, _ in joints
        if joint.kind == 'revolute'
    ]
    points = np.array([*fixed, pose[:3, 3]])
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    size = size if size > 0.0 else mechanism.characteristic_length
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
    size = float(np.linalg.norm(np.ptp(scene.places, axis=0)))
    return replace(scene, size=size or 1.0, normal=_common_normal(scene))


def joint_groups(strut: Strut) -> list[tuple[str, tuple[Joint, ...]]]:
    """Return the joints of ``strut`` as they were written: universal and spherical ones whole."""
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
    strut: Strut,
    moved: list[tuple[Joint, FloatArray, FloatArray]],
    platform: FloatArray,
    size: float,
) -> tuple[DrawnJoint, ...]:
    where = {joint.name: (place, axis) for joint, place, axis in moved}
    groups = joint_groups(strut)
    places = _placed(
        [
            (joint_letter(joints), *where[joints[0].name])
            for _, joints in groups
        ],
        platform,
        size,
    )
    return tuple(
        DrawnJoint(
            name,
            joint_letter(joints),
            place,
            tuple(
                Axis(where[joint.name][1], joint.actuator.name if joint.actuator else '')
                for joint in joints
            ),
        )
        for (name, joints), place in zip(groups, places, strict=True)
    )


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
        elif after is not None:
            steps = [other_axis for _, _, other_axis in joints[index:after]]
            places.append(joints[after][1] - stub * np.sum(steps, axis=0))
        else:
            steps = [other_axis for _, _, other_axis in joints[index:]]
            places.append(platform - stub * np.sum(steps, axis=0))
    return places


def _common_normal(scene: Scene) -> FloatArray | None:
    """Return the normal of the plane in which everything moves, if there is one."""
    turning = [
        axis.direction
        for strut in scene.struts
        for joint in strut.joints
        if joint.letter != 'P'
        for axis in joint.axes
    ]
    if not turning:
        return None
    normal = turning[0]
    sliding = [
        joint.axes[0].direction
        for strut in scene.struts
        for joint in strut.joints
        if joint.letter == 'P'
    ]
    parallel = all(np.linalg.norm(np.cross(axis, normal)) < _SAME_PLACE for axis in turning)
    across = all(abs(float(axis @ normal)) < _SAME_PLACE for axis in sliding)
    heights = scene.places @ normal
    if not (parallel and across and np.ptp(heights) < _SAME_PLACE * scene.size):
        return None
    return normal if normal.sum() > 0.0 else -normal
