# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Mechanism files: YAML to `Mechanism`, every mistake named by file, key and reason."""

from __future__ import annotations

from math import inf
from pathlib import Path

import numpy as np

from fault_tolerance.errors import ArrayError, MechanismError
from fault_tolerance.mechanism.description import (
    Actuator,
    Joint,
    JointKind,
    Mechanism,
    Strut,
    check_names,
)
from fault_tolerance.mechanism.reading import Section, parsed
from fault_tolerance.mechanism.task import Task
from fault_tolerance.mechanism.working_point import WorkingPoint

_LARGEST_FILE = 16 * 1024 * 1024


def mechanism_from_file(path: str | Path) -> Mechanism:
    """Return the mechanism that the file ``path`` describes.

    Raises
    ------
    MechanismError
        If the file cannot be read or understood: one line with file, key and reason.
    """
    source = str(path)
    try:
        if Path(path).stat().st_size > _LARGEST_FILE:
            raise MechanismError(source, '', 'is too large to be a mechanism file')
        text = Path(path).read_text(encoding='utf-8')
    except OSError as error:
        reason = f'cannot be read ({error.strerror or error})'
        raise MechanismError(source, '', reason) from None
    except UnicodeDecodeError:
        raise MechanismError(source, '', 'is not UTF-8 text') from None
    return mechanism_from_text(text, source)


def mechanism_from_text(text: str, source: str = 'mechanism') -> Mechanism:
    """Return the mechanism that ``text`` (YAML) describes; ``source`` names it in errors."""
    top = parsed(text, source)
    name = top.text('mechanism')
    task = _task(top)
    origin = [0.0, 0.0, 0.0]
    by_numbers = top.has('jacobian') or top.has('mapping')
    if top.has('platform') or not by_numbers:
        platform = top.section('platform')
        origin = platform.numbers('origin', 3)
        platform.close()
    length = top.number('characteristic_length', 1.0)
    compliance = top.number('compliance', 0.0)
    struts: tuple[Strut, ...] = ()
    point = None
    if by_numbers:
        if top.has('struts'):
            raise top.error('struts', 'give either struts, or jacobian and mapping')
        actuators = _listed_actuators(top)
        point = _working_point(top)
    else:
        struts = tuple(_strut(section) for section in top.sections('struts'))
        if not struts:
            raise top.error('struts', 'is empty')
        _check_names(top, struts)
        actuators = _ordered(top, struts)
    top.close()
    try:
        return Mechanism(
            name, task, struts, actuators, np.array(origin), length, compliance, point
        )
    except ArrayError as error:
        raise MechanismError(source, error.name, error.reason) from None
    except MechanismError as error:
        raise MechanismError(source, error.key, error.reason) from None


def _task(top: Section) -> Task:
    section = top.section('task')
    coordinates = section.names('coordinates')
    major = section.names('major') if section.has('major') else ()
    if section.has('major') and not major:
        raise section.error('major', 'is empty')
    section.close()
    try:
        return Task(coordinates, major)
    except MechanismError as error:
        raise section.error(error.key, error.reason) from None


def _strut(section: Section) -> Strut:
    name = section.text('name')
    release = section.flag('release')
    joints = tuple(
        joint for part in section.sections('joints') for joint in _joints(part, name)
    )
    section.close()
    if not joints:
        raise section.error('joints', 'is empty')
    return Strut(name, joints, release)


def _check_names(top: Section, struts: tuple[Strut, ...]) -> None:
    """Refuse a name that stands for two things, joints of several axes (before expansion) too."""
    names = []
    for strut in top.sections('struts'):
        name = strut.text('name')
        names.append(('struts', name))
        for joint in strut.sections('joints'):
            names.append((f'struts.{name}.joints', joint.text('name')))
    for part in struts:
        for actuator in part.actuators:
            if actuator.name not in (actuator.joint, actuator.joint.rpartition('.')[0]):
                names.append((f'struts.{part.name}.joints.{actuator.joint}', actuator.name))
    check_names(top.source, names)


def _joints(section: Section, strut: str) -> list[Joint]:
    """Return the single axes that one joint of the file stands for."""
    name = section.text('name')
    kind = section.text('type')
    if kind in ('revolute', 'prismatic'):
        single: JointKind = 'revolute' if kind == 'revolute' else 'prismatic'
        axes = {'': section.numbers('axis', 3)}
    elif kind == 'universal':
        single = 'revolute'
        pair = section.items('axes')
        if len(pair) != 2:
            raise section.error('axes', f'has {len(pair)} axes, expected two')
        axes = {
            label: section.as_numbers(f'axes[{index}]', axis, 3)
            for index, (label, axis) in enumerate(zip('12', pair, strict=True))
        }
        first, second = axes.values()
        if np.linalg.norm(np.cross(first, second)) < 1e-9:
            raise section.error('axes', 'the two axes are parallel or zero')
    elif kind == 'spherical':
        single = 'revolute'
        axes = {'x': [1.0, 0.0, 0.0], 'y': [0.0, 1.0, 0.0], 'z': [0.0, 0.0, 1.0]}
    else:
        reason = f'{kind!r} is not one of revolute, prismatic, universal, spherical'
        raise section.error('type', reason)
    if kind == 'prismatic' and not section.has('point'):
        point = [0.0, 0.0, 0.0]
    else:
        point = section.numbers('point', 3)
    drives = _drives(section, name, tuple(axes))
    joints = []
    for label, axis in axes.items():
        joint_name = f'{name}.{label}' if label else name
        drive = drives.get(label)
        actuator = None
        if drive is not None:
            actuator = _actuator(section, label, drive, (joint_name, strut, single))
        try:
            joints.append(Joint(joint_name, single, np.array(axis), np.array(point), actuator))
        except ArrayError as error:
            key = 'point' if error.name.startswith('point') else 'axis'
            raise section.error(key, error.reason) from None
        except MechanismError as error:
            raise section.error(error.key, error.reason) from None
    _refuse_idle_keys(section, bool(drives))
    section.close()
    return joints


def _drives(section: Section, name: str, labels: tuple[str, ...]) -> dict[str, str]:
    """Return the actuators' names by axis label."""
    if not section.has('actuated'):
        section.flag('actuated')
        return {}
    if labels == ('',):
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


_ACTUATOR_KEYS = ('position', 'velocity', 'joint_state_name', 'home', 'sign', 'brake')


def _refuse_idle_keys(section: Section, driven: bool) -> None:
    for key in _ACTUATOR_KEYS:
        if section.has(key) and not driven:
            raise section.error(key, 'is for actuated joints only')


def _actuator(
    section: Section, label: str, name: str, place: tuple[str, str, JointKind]
) -> Actuator:
    """Return an actuator; where a joint drives several axes, each key may be given per axis."""
    source = section
    options: dict[str, object] = {}
    for key in _ACTUATOR_KEYS:
        if not section.has(key):
            continue
        value = section.get(key)
        part: Section = source
        where: object = key
        if label and isinstance(value, dict):
            part = section.section(key)
            where = int(label) if label.isdigit() and part.has(int(label)) else label
            if not part.has(where):
                continue
        if key == 'position':
            options[key] = tuple(part.numbers(where, 2))
        elif key == 'joint_state_name':
            options[key] = part.text(where)
        elif key == 'brake':
            options[key] = part.flag(where)
        else:
            options[key] = part.number(where)
    sign = options.get('sign')
    if isinstance(sign, float) and sign in (1.0, -1.0):
        options['sign'] = int(sign)
    joint, strut, kind = place
    try:
        return Actuator(name, joint, strut, kind, **options)  # type: ignore[arg-type]
    except MechanismError as error:
        raise section.error(error.key, error.reason) from None


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
    """Return the actuators of a mechanism given by numbers: names, or mappings with limits."""
    actuators = []
    for index, entry in enumerate(top.items('actuators')):
        if isinstance(entry, str):
            actuators.append(Actuator(entry))
            continue
        section = Section(top.source, top.where(f'actuators[{index}]'), entry)
        kind: JointKind = 'prismatic'
        if section.has('type'):
            word = section.text('type')
            if word not in ('revolute', 'prismatic'):
                raise section.error('type', f'{word!r} is not one of revolute, prismatic')
            kind = 'revolute' if word == 'revolute' else 'prismatic'
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
    try:
        return WorkingPoint(np.array(jacobian), np.array(mapping))
    except MechanismError as error:
        raise top.error(error.key, error.reason) from None
    except ArrayError as error:
        raise top.error(error.name, error.reason) from None
