# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""URDF files, with a list of the closures that URDF has no word for, as bodies and connections."""

from __future__ import annotations

from math import inf
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.closure_files import Closures
from fault_tolerance.machines.linkages import CLOSED, Connection, Linkage, ball, usable_name
from fault_tolerance.machines.xml_files import AXIS_KINDS, XmlFile
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.parts import Actuator, Joint, JointKind
from fault_tolerance.mechanism.screws import exponential, rotation_vector


def linkage_from_urdf(path: Path, closures: Closures | None = None) -> Linkage:
    """Return what the URDF file ``path`` describes, with its ``closures``.

    Home is where all joints are zero, or the nearest place where its loops are closed.

    Driven are the joints that ``closures`` names, else those that have a transmission.
    MechanismError, with the element, for what cannot be read.
    """
    return _Robot(XmlFile(path, 'URDF', 'robot'), closures or Closures()).linkage()


class _Robot:
    """A robot while it is read: places are where the frames are at home."""

    def __init__(self, file: XmlFile, closures: Closures) -> None:
        self._file, self._closures = file, closures
        self._joints = file.root.findall('joint')
        self._hanging: dict[str, list[tuple[str, str]]] = {}
        for joint in self._joints:
            ends = str(joint.get('name')), self._end(joint, 'child')
            self._hanging.setdefault(self._end(joint, 'parent'), []).append(ends)
        self._values: dict[str, float] = {}
        self._frames: dict[str, FloatArray] = {}
        self._link_of: dict[str, str] = {}

    def linkage(self) -> Linkage:
        links = [one.get('name', '') for one in self._file.root.findall('link')]
        for joint in self._joints:
            for which in ('parent', 'child'):
                if self._end(joint, which) not in links:
                    reason = f'there is no link {self._end(joint, which)!r}'
                    raise self._file.error(f'joint {joint.get("name")}: {which}', reason)
        children = {self._end(one, 'child') for one in self._joints}
        roots = [name for name in links if name not in children]
        if len(roots) != 1:
            raise self._file.error('', f'has {len(roots)} links that hang on no joint, not one: '
                                  f'{", ".join(roots) or "a ring of joints"}')
        self._close(roots[0])
        transmitted = [str(joint.get('name')) for one in self._file.root.iter('transmission')
                       for joint in one.findall('joint')]
        names = [str(one.get('name')) for one in self._joints]
        driven = self._file.driven(
            names, self._closures, transmitted, 'give them a <transmission>')
        connections = [one for joint in self._joints if (one := self._connection(joint, driven))]
        connections += [self._closure(number) for number in range(len(self._closures.frames))]
        places = {name: self._frames[name][:3, 3] for name in links if name in self._frames}
        name = usable_name(self._file.root.get('name') or Path(self._file.source).stem)
        order = tuple(usable_name(one) for one in driven)
        return Linkage(self._file.source, name, roots[0], places, tuple(connections), order,
                       self._closures.extras)

    def _end(self, joint: ElementTree.Element, which: str) -> str:
        found = joint.find(which)
        if found is None or not found.get('link'):
            raise self._file.error(f'joint {joint.get("name")}', f'has no {which} link')
        return str(found.get('link'))

    def _close(self, root: str) -> None:
        """Place everything, with the joint values next to zero at which the loops are closed."""
        self._offsets = {str(one.get('name')): self._offset(one) for one in self._joints}
        moving = [one for one in self._joints if one.get('type') in AXIS_KINDS]
        screws = {str(one.get('name')): _screw(one.get('type', ''), self._axis(one))
                  for one in moving}
        self._place(root, {})
        self._require_frames()
        places = np.array([frame[:3, 3] for frame in self._frames.values()])
        self._size = float(np.linalg.norm(np.ptp(places, axis=0))) or 1.0

        def gaps(values: FloatArray) -> FloatArray:
            steps = zip(screws, values.tolist(), strict=True)
            self._values = {name: value for name, value in steps if value}
            self._place(root, {
                name: exponential(screws[name] * value) for name, value in self._values.items()
            })
            return np.concatenate([self._gap(*closure) for closure in self._closures.frames])

        if not self._closures.frames or np.abs(gaps(np.zeros(len(moving)))).max() < CLOSED * \
                self._size:
            return
        # Beside zero, where a stretched linkage would be singular.
        start = 0.01 * np.sin(np.arange(1.0, len(moving) + 1.0))
        found = least_squares(gaps, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        rest = np.abs(gaps(found.x))
        if rest.max() > 1e-9 * self._size:
            reason = (f'do not close near joint values of zero: {rest.max():.3g} m stay open; '
                      'move the frames of the joints so that they do')
            raise MechanismError(self._closures.source, 'closed_loop', reason)

    def _gap(self, first: str, second: str, kind: str) -> FloatArray:
        """Return how far two frames are apart, metres: of a point (3,), or with turns (6,)."""
        one, other = (self._frames[self._link_of[name]] for name in (first, second))
        apart = one[:3, 3] - other[:3, 3]
        if kind == '3d':
            return apart
        return np.concatenate([
            apart, self._size * rotation_vector(other[:3, :3].T @ one[:3, :3])])

    def _require_frames(self) -> None:
        for number, closure in enumerate(self._closures.frames):
            for name in closure[:2]:
                if name not in self._link_of:
                    reason = f'{name!r} is neither a link nor a joint of {self._file.source}'
                    raise MechanismError(self._closures.source, f'closed_loop[{number}]', reason)

    def _place(self, link: str, steps: dict[str, FloatArray]) -> None:
        """Give the root ``link`` and all that hang on it their places, where joints make steps."""
        waiting = [(link, np.eye(4))]
        while waiting:
            link, frame = waiting.pop()
            self._frames[link] = frame
            self._link_of[link] = link
            for name, child in self._hanging.get(link, ()):
                self._link_of.setdefault(name, child)
                ahead = frame @ self._offsets[name]
                waiting.append((child, ahead @ steps[name] if name in steps else ahead))

    def _offset(self, joint: ElementTree.Element) -> FloatArray:
        offset, origin = np.eye(4), joint.find('origin')
        if origin is not None:
            offset[:3, 3] = self._numbers(joint, origin, 'xyz', '0 0 0')
            turn = self._numbers(joint, origin, 'rpy', '0 0 0')
            if turn.any():
                offset[:3, :3] = Rotation.from_euler('xyz', turn).as_matrix()
        return offset

    def _numbers(
        self, joint: ElementTree.Element, part: ElementTree.Element, key: str, default: str
    ) -> FloatArray:
        where = f'joint {joint.get("name")}: {part.tag} {key}'
        return self._file.numbers(where, part.get(key, default), len(default.split()))

    def _connection(self, joint: ElementTree.Element, driven: list[str]) -> Connection | None:
        own, kind = str(joint.get('name')), joint.get('type', '')
        parent, child = self._end(joint, 'parent'), self._end(joint, 'child')
        if kind == 'floating':
            return None
        if kind == 'fixed':
            return Connection(own, parent, child)
        if kind not in AXIS_KINDS:
            reason = f'its type {kind!r} is not revolute, continuous, prismatic, fixed or floating'
            raise self._file.error(f'joint {own}', reason)
        if joint.find('mimic') is not None:
            raise self._file.error(f'joint {own}', 'mimics another: couplings are not struts')
        frame, axis = self._frames[child], self._axis(joint)
        name, way, drive = usable_name(own), AXIS_KINDS[kind], None
        try:
            if own in driven:
                drive = self._drive(joint, name, way)
            axes = (Joint(name, way, frame[:3, :3] @ axis, frame[:3, 3], drive),)
        except MechanismError as error:
            raise self._file.error(f'joint {own}: {error.key}', error.reason) from None
        return Connection(own, parent, child, axes)

    def _axis(self, joint: ElementTree.Element) -> FloatArray:
        part = joint.find('axis')
        if part is None:
            return np.array([1.0, 0.0, 0.0])
        return self._numbers(joint, part, 'xyz', '1 0 0')

    def _drive(self, joint: ElementTree.Element, name: str, kind: JointKind) -> Actuator:
        limit = joint.find('limit')
        stroke, rate, home = (-inf, inf), inf, self._values.get(str(joint.get('name')), 0.0)
        if limit is not None:
            rate = float(self._numbers(joint, limit, 'velocity', '0')[0]) or inf
            # Without them they are zero by the letter, and not known in fact.
            if joint.get('type') != 'continuous' and limit.get('lower') and limit.get('upper'):
                low, high = (self._numbers(joint, limit, key, '0') for key in ('lower', 'upper'))
                stroke = (float(low[0]) - home, float(high[0]) - home)
        return Actuator(
            name, joint=name, kind=kind, position=stroke, velocity=rate, home=home)

    def _closure(self, number: int) -> Connection:
        first, second, kind = self._closures.frames[number]
        name = f'closure_{number + 1}'
        ends = self._link_of[first], self._link_of[second]
        joints = ball(f'{name}_ball', self._frames[ends[0]][:3, 3]) if kind == '3d' else ()
        return Connection(name, *ends, joints, closure=True, ball=bool(joints))


def _screw(kind: str, axis: FloatArray) -> FloatArray:
    """Return the twist (6,) of a joint of a URDF about, or along, its axis through the origin."""
    unit = axis / (np.linalg.norm(axis) or 1.0)
    parts = (unit, np.zeros(3))
    return np.concatenate(parts if AXIS_KINDS[kind] == 'revolute' else parts[::-1])
