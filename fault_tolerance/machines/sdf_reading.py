# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""SDF files as bodies and connections: their joints close loops by themselves."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, isnan
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.closure_files import Closures
from fault_tolerance.machines.linkages import Connection, Extras, Linkage, ball, usable_name
from fault_tolerance.machines.xml_files import AXIS_KINDS, XmlFile
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.parts import Actuator, Joint

EXTRAS = '{fault_tolerance}mechanism'
"""The element with what SDF has no word for."""

_TWO_AXES = ('universal', 'revolute2')
_OTHERS = ('fixed', 'ball', *_TWO_AXES)
_UNLIMITED = 1e15
"""SDF writes 1e16 where there is no limit."""


def linkage_from_sdf(path: Path, closures: Closures | None = None) -> Linkage:
    """Return what the one model with joints in the SDF file ``path`` describes, in its own axes.

    Home is the configuration it is written in, where all joints are zero by definition. Driven
    are the joints that ``closures`` names, else those that a controller plugin names, or that the
    file has been exported with. MechanismError, with the element, for what cannot be read.
    """
    file = XmlFile(path, 'SDF', 'sdf')
    closures = closures or Closures()
    if closures.frames:
        raise MechanismError(closures.source, 'closed_loop', 'SDF has its own loops')
    models = [one for one in file.root.iter('model') if one.find('joint') is not None]
    if len(models) != 1:
        names = ', '.join(one.get('name', '') for one in models)
        raise file.error('', f'has {len(models)} models with joints, not one: {names}')
    for tag in ('model', 'include'):
        inner = models[0].find(tag)
        if inner is not None:
            name = (inner.get('name') or inner.findtext('uri') or '').strip()
            raise file.error(f'{tag} {name}', 'is a model in a model, which is not read')
    return _Model(file, models[0], closures).linkage()


class _Model:
    """A model while it is read."""

    def __init__(self, file: XmlFile, model: Element, closures: Closures) -> None:
        self._file, self._model, self._closures = file, model, closures
        self._joints = {one.get('name', ''): one for one in model.findall('joint')}
        self._links = [one.get('name', '') for one in model.findall('link')]
        parts = [*model.findall('link'), *model.findall('joint'), *model.findall('frame')]
        self._parts = {one.get('name', ''): one for one in parts}
        if len(self._parts) < len(parts):
            names = [one.get('name', '') for one in parts]
            doubled = next(name for name in names if names.count(name) > 1)
            raise file.error(doubled, 'two links, joints or frames have this name')
        if not self._links:
            raise file.error(f'model {model.get("name")}', 'has no links')
        self._frames = {'__model__': np.eye(4)}
        # Before version 1.5 axes were given in the model's frame.
        version = file.numbers('version', file.root.get('version', '1.5').replace('.', ' '), 2, 3)
        self._axes_of_model = version[1] < 5

    def linkage(self) -> Linkage:
        own = self._model.find(EXTRAS)
        named = own.get('drives', '').split() if own is not None else list(self._controlled())
        driven = self._file.driven(
            list(self._joints), self._closures, named, 'give them a controller plugin')
        held: set[str] = set()
        connections = []
        for name, joint in self._joints.items():
            ends = self._ends(name, joint)
            axes = self._axes(name, joint, name in driven)
            connections.append(Connection(
                usable_name(name), *ends, axes, closure=ends[1] in held,
                ball=joint.get('type') == 'ball'))
            held.add(ends[1])
        free = [name for name in self._links if name not in held]
        if any('world' in (one.first, one.second) for one in connections):
            free = ['world']
        if len(free) != 1:
            reason = (f'has {len(free)} links that are child of no joint, not one '
                      f'({", ".join(free[:6])}): which is the base? (a joint to the world)')
            raise self._file.error('', reason)
        places = {name: self._frame(name)[:3, 3] for name in self._links}
        places['world'] = np.zeros(3)
        name = usable_name(self._model.get('name') or Path(self._file.source).stem)
        order = tuple(usable_name(one) for one in driven)
        extras = self._closures.extras if own is None else self._extras(own)
        return Linkage(
            self._file.source, name, free[0], places, tuple(connections), order, extras)

    def _controlled(self) -> Iterator[str]:
        """Yield the joints that plugins with a controller in their name act on."""
        for plugin in self._model.iter('plugin'):
            if 'controller' in f'{plugin.get("name")} {plugin.get("filename")}'.lower():
                for one in plugin.iter('joint_name'):
                    yield (one.text or '').strip()

    def _extras(self, own: Element) -> Extras:
        def number(key: str) -> float:
            return float(self._file.numbers(f'{own.tag} {key}', own.get(key, ''), 1)[0])

        task, major = (tuple(own.get(key, '').split()) for key in ('task', 'major'))
        length = number('characteristic_length')
        return Extras(task, major, length, number('compliance'), own.get('platform', ''))

    def _ends(self, name: str, joint: Element) -> tuple[str, str]:
        """Return the links of a joint, parent and child, or the world."""
        found = []
        for which in ('parent', 'child'):
            end = (joint.findtext(which) or '').strip()
            seen = set()
            while end != 'world' and end not in self._links:
                if end not in self._parts or end in seen or end == name:
                    raise self._file.error(f'joint {name}: {which}', f'there is no link {end!r}')
                seen.add(end)
                part = self._parts[end]
                on = part.get('attached_to') if part.tag == 'frame' else part.findtext('child')
                end = (on or self._links[0]).strip()
            found.append(end)
        return found[0], found[1]

    def _frame(self, name: str, asked: tuple[str, ...] = ()) -> FloatArray:
        """Return the pose (4, 4) of a link, joint or frame in the model."""
        if name not in self._frames:
            part = self._parts.get(name)
            if part is None or name in asked:
                reason = 'is no link, joint or frame of it' if part is None else \
                    'is placed relative to itself'
                raise self._file.error(asked[-1] if asked else name, f'{name!r} {reason}')
            own = {'joint': (part.findtext('child') or '').strip(),
                   'frame': part.get('attached_to', '')}.get(part.tag, '')
            pose = part.find('pose')
            on = (pose.get('relative_to', '') if pose is not None else '') or own or '__model__'
            self._frames[name] = self._frame(on, (*asked, name)) @ self._pose(name, pose)
        return self._frames[name]

    def _pose(self, name: str, pose: Element | None) -> FloatArray:
        found = np.eye(4)
        if pose is None or not (pose.text or '').strip():
            return found
        quaternion = pose.get('rotation_format') == 'quat_xyzw'
        numbers = self._file.numbers(f'{name}: pose', pose.text or '', 7 if quaternion else 6)
        found[:3, 3], turn = numbers[:3], numbers[3:]
        if turn.any():
            rotation = Rotation.from_quat(turn) if quaternion else Rotation.from_euler(
                'xyz', turn, degrees=pose.get('degrees') == 'true')
            found[:3, :3] = rotation.as_matrix()
        return found

    def _axes(self, own: str, joint: Element, driven: bool) -> tuple[Joint, ...]:
        """Return the axes of a joint, parent to child."""
        kind, where, name = joint.get('type', ''), f'joint {own}', usable_name(own)
        if kind not in (*AXIS_KINDS, *_OTHERS):
            known = ', '.join((*AXIS_KINDS, *_OTHERS))
            raise self._file.error(where, f'its type {kind!r} is none of {known}')
        if driven and kind not in AXIS_KINDS:
            raise self._file.error(where, f'is driven and {kind}: only single axes are driven')
        if kind == 'fixed':
            return ()
        point = self._frame(own)[:3, 3]
        if kind == 'ball':
            return ball(name, point)
        way = AXIS_KINDS.get(kind, 'revolute')
        tags = {'axis': f'{name}.1', 'axis2': f'{name}.2'} if kind in _TWO_AXES else {'axis': name}
        axes = []
        for tag, label in tags.items():
            part = joint.find(tag)
            if part is not None and part.find('mimic') is not None:
                raise self._file.error(where, 'mimics another: couplings are not struts')
            direction = self._direction(own, part, tag)
            try:
                drive = Actuator(name, joint=name, kind=way, position=self._limits(where, part),
                                 velocity=self._limit(where, part, 'velocity', inf) or inf
                                 ) if driven else None
                axes.append(Joint(label, way, direction, point, drive))
            except MechanismError as error:
                raise self._file.error(f'{where}: {error.key}', error.reason) from None
        return tuple(axes)

    def _direction(self, own: str, axis: Element | None, tag: str) -> FloatArray:
        """Return the direction (3,) of an axis in the model."""
        xyz = axis.find('xyz') if axis is not None else None
        text = (xyz.text if xyz is not None else '') or '0 0 1'
        direction = self._file.numbers(f'joint {own}: {tag}: xyz', text, 3)
        on = xyz.get('expressed_in', '') if xyz is not None else ''
        if not on:
            of_model = axis is not None and axis.findtext('use_parent_model_frame', '').strip()
            on = '__model__' if self._axes_of_model or of_model in ('1', 'true') else own
        turned: FloatArray = self._frame(on, (own,))[:3, :3] @ direction
        return turned

    def _limits(self, where: str, axis: Element | None) -> tuple[float, float]:
        return self._limit(where, axis, 'lower', -inf), self._limit(where, axis, 'upper', inf)

    def _limit(self, where: str, axis: Element | None, key: str, default: float) -> float:
        text = axis.findtext(f'limit/{key}', '').strip() if axis is not None else ''
        try:
            number = float(text or default)
        except ValueError:
            number = np.nan
        if isnan(number):
            raise self._file.error(f'{where}: limit: {key}', f'{text!r} is not a number')
        return number if abs(number) < _UNLIMITED else float(np.copysign(inf, number))
