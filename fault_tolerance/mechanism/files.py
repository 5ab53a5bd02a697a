# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Mechanism files: YAML to `Mechanism`, every mistake named by file, key and reason."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path

import numpy as np

from fault_tolerance.mechanism.description import Mechanism, check_names
from fault_tolerance.mechanism.parts import Actuator, Joint, JointKind, Strut
from fault_tolerance.mechanism.reading import Section, file_text, parsed
from fault_tolerance.mechanism.task import Task
from fault_tolerance.mechanism.working_point import WorkingPoint
from fault_tolerance.tolerances import SHORTEST_AXIS

_ZERO = [0.0, 0.0, 0.0]


def mechanism_from_file(path: str | Path) -> Mechanism:
    """Return the mechanism that the file ``path`` describes.

    Raises
    ------
    MechanismError
        If the file cannot be read or understood: one line with file, key and reason.
    """
    return mechanism_from_text(file_text(path, 'a mechanism file'), str(path))


def mechanism_from_text(text: str, source: str = 'mechanism') -> Mechanism:
    """Return the mechanism that ``text`` describes.

    Parameters
    ----------
    text : str
        YAML, as in a mechanism file.
    source : str
        What errors call it.

    Raises
    ------
    MechanismError
        If it cannot be understood: one line with source, key and reason.
    """
    return _mechanism(parsed(text, source))


def mechanism_from_document(document: object, source: str = 'mechanism') -> Mechanism:
    """Return the mechanism that ``document``, what YAML makes of a file, describes.

    MechanismError, which calls it ``source``, if it cannot be understood.
    """
    return _mechanism(Section(source, '', document))


def _mechanism(top: Section) -> Mechanism:
    name = top.text('mechanism')
    task = _task(top)
    origin = _ZERO
    by_numbers = top.has('jacobian') or top.has('mapping')
    if top.has('platform') or not by_numbers:
        platform = top.section('platform')
        origin = platform.numbers('origin', 3)
        platform.close()
    length = top.number('characteristic_length', 1.0)
    compliance = top.number('compliance', 0.0)
    stiffness = top.number('stiffness', nan)
    flexure_stiffness = top.number('flexure_stiffness', nan)
    struts: tuple[Strut, ...] = ()
    point = None
    if by_numbers:
        if top.has('struts'):
            raise top.error('struts', 'give either struts, or jacobian and mapping')
        actuators, point = _listed_actuators(top), _working_point(top)
    else:
        struts = tuple(_strut(section) for section in top.sections('struts'))
        if not struts:
            raise top.error('struts', 'is empty')
        _check_names(top, struts)
        actuators = _ordered(top, struts)
    groups, park = _groups(top), _park(top)
    top.close()
    with top.located():
        return Mechanism(
            name, task, struts, actuators, np.array(origin), length, compliance, point, stiffness,
            groups, park, flexure_stiffness,
        )


def _groups(top: Section) -> dict[str, tuple[str, ...]]:
    """Return the members of every group by its name."""
    if not top.has('groups'):
        return {}
    section = top.section('groups')
    return {str(name): section.names(name) for name in section.keys()}


def _park(top: Section) -> dict[str, float]:
    """Return the coordinates of the park pose by name."""
    if not top.has('park'):
        return {}
    section = top.section('park')
    return {str(name): section.number(name) for name in section.keys()}


def _task(top: Section) -> Task:
    section = top.section('task')
    coordinates = section.names('coordinates')
    major = section.names('major') if section.has('major') else ()
    if section.has('major') and not major:
        raise section.error('major', 'is empty')
    section.close()
    with section.located():
        return Task(coordinates, major)


def _strut(section: Section) -> Strut:
    name = section.text('name')
    release = section.flag('release')
    joints = tuple(one for part in section.sections('joints') for one in _joints(part, name))
    section.close()
    if not joints:
        raise section.error('joints', 'is empty')
    return Strut(name, joints, release)


def _check_names(top: Section, struts: tuple[Strut, ...]) -> None:
    """Refuse a name that stands for two things: here joints of several axes still have theirs."""
    names = []
    for section in top.sections('struts'):
        key = f'struts.{section.text("name")}.joints'
        names.append(('struts', section.text('name')))
        names += [(key, joint.text('name')) for joint in section.sections('joints')]
    for part in struts:
        for actuator in part.actuators:
            if actuator.name not in (actuator.joint, actuator.joint.rpartition('.')[0]):
                names.append((f'struts.{part.name}.joints.{actuator.joint}', actuator.name))
    check_names(top.source, names)


def _joints(section: Section, strut: str) -> list[Joint]:
    """Return the single axes that one joint of the file stands for."""
    name = section.text('name')
    kind = section.text('type')
    single: JointKind = 'prismatic' if kind == 'prismatic' else 'revolute'
    if kind in ('revolute', 'prismatic'):
        axes = {'': section.numbers('axis', 3)}
    elif kind == 'universal':
        pair = section.items('axes')
        if len(pair) != 2:
            raise section.error('axes', f'has {len(pair)} axes, expected two')
        axes = {
            label: section.as_numbers(f'axes[{index}]', axis, 3)
            for index, (label, axis) in enumerate(zip('12', pair, strict=True))
        }
        if np.linalg.norm(np.cross(axes['1'], axes['2'])) < SHORTEST_AXIS:
            raise section.error('axes', 'the two axes are parallel or zero')
    elif kind == 'spherical':
        axes = {'x': [1.0, 0.0, 0.0], 'y': [0.0, 1.0, 0.0], 'z': [0.0, 0.0, 1.0]}
    else:
        reason = f'{kind!r} is not one of revolute, prismatic, universal, spherical'
        raise section.error('type', reason)
    needs_point = kind != 'prismatic' or section.has('point')
    point = section.numbers('point', 3) if needs_point else _ZERO
    drives = _drives(section, name, tuple(axes))
    joints = []
    for label, axis in axes.items():
        joint_name = f'{name}.{label}' if label else name
        drive = drives.get(label)
        actuator = None
        if drive is not None:
            actuator = _actuator(section, label, drive, (joint_name, strut, single))
        with section.located():
            joints.append(Joint(joint_name, single, np.array(axis), np.array(point), actuator))
    for key in _ACTUATOR_KEYS:
        if section.has(key) and not drives:
            raise section.error(key, 'is for actuated joints only')
    section.close()
    return joints


def _drives(section: Section, name: str, labels: tuple[str, ...]) -> dict[str, str]:
    """Return the actuators' names by axis label."""
    if labels == ('',) or not section.has('actuated'):
        return {'': name} if section.flag('actuated') else {}
    if section.get('actuated') is False:
        return {}
    axes = section.section('actuated')
    drives = {}
    for key in axes.keys():
        # YAML reads the axes 1 and 2 of a universal joint as integers, and a bare y as itself.
        label = str(key)
        if label not in labels:
            raise axes.error(key, f'is not an axis; valid: {", ".join(labels)}')
        drives[label] = axes.text(key)
    return drives


_ACTUATOR_KEYS = (
    'position', 'velocity', 'joint_state_name', 'home', 'sign', 'brake', 'encoder', 'stiffness',
    'period', 'when_off',
)


def _actuator(
    section: Section, label: str, name: str, place: tuple[str, str, JointKind]
) -> Actuator:
    """Return an actuator; where a joint drives several axes, each key may be given per axis."""
    options: dict[str, object] = {}
    for key in filter(section.has, _ACTUATOR_KEYS):
        value, part = section.get(key), section
        where: object = key
        if label and isinstance(value, dict):
            part = section.section(key)
            where = int(label) if label.isdigit() and part.has(int(label)) else label
            if not part.has(where):
                continue
        if key == 'position':
            options[key] = tuple(part.numbers(where, 2))
        elif key in ('joint_state_name', 'encoder', 'when_off'):
            options[key] = part.text(where)
        elif key == 'brake':
            options[key] = part.flag(where)
        else:
            options[key] = part.number(where)
    sign = options.get('sign')
    if isinstance(sign, float) and sign in (1.0, -1.0):
        options['sign'] = int(sign)
    with section.located():
        return Actuator(name, *place, **options)  # type: ignore[arg-type]


def _ordered(top: Section, struts: tuple[Strut, ...]) -> tuple[Actuator, ...]:
    """Return the actuators in the order of the file, or as `actuators` fixes it."""
    found = [actuator for strut in struts for actuator in strut.actuators]
    if not found:
        raise top.error('struts', 'no joint is actuated')
    if not top.has('actuators'):
        return tuple(found)
    names = top.names('actuators')
    if len(set(names)) != len(names):
        raise top.error('actuators', 'names an actuator twice')
    by_name = {actuator.name: actuator for actuator in found}
    for name in names:
        if name not in by_name:
            raise top.error('actuators', f'{name!r} is not an actuated joint')
    for name in by_name:
        if name not in names:
            raise top.error('actuators', f'the actuator {name!r} is missing')
    return tuple(by_name[name] for name in names)


def _listed_actuators(top: Section) -> tuple[Actuator, ...]:
    """Return the actuators given beside a Jacobian: names, or mappings with limits."""
    actuators = []
    for index, entry in enumerate(top.items('actuators')):
        if isinstance(entry, str):
            actuators.append(Actuator(entry))
            continue
        section = Section(top.source, top.where(f'actuators[{index}]'), entry)
        word = section.text('type') if section.has('type') else 'prismatic'
        if word not in ('revolute', 'prismatic'):
            raise section.error('type', f'{word!r} is not one of revolute, prismatic')
        kind: JointKind = 'revolute' if word == 'revolute' else 'prismatic'
        actuators.append(_actuator(section, '', section.text('name'), ('', '', kind)))
        section.close()
    if not actuators:
        raise top.error('actuators', 'is empty')
    return tuple(actuators)


def _working_point(top: Section) -> WorkingPoint:
    jacobian, mapping = top.matrix('jacobian'), top.matrix('mapping')
    for key, rows in (('jacobian', jacobian), ('mapping', mapping)):
        if any(abs(number) == inf for row in rows for number in row):
            raise top.error(key, 'holds a number that is not finite')
    with top.located():
        return WorkingPoint(np.array(jacobian), np.array(mapping))
