# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism as the text of a mechanism file, with comments for whoever edits it."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, isnan

import numpy as np

from fault_tolerance.analysis.scene import joint_groups
from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator, Joint, Strut

_NOTES = {
    'platform': 'Origin of the platform frame at home: the point that vx, vy and vz are meant of.',
    'task': 'What the platform is commanded in, and what of it must be kept (major).',
    'characteristic_length': 'A rotation counts as this many metres a radian.',
    'compliance': 'Constraints weaker than this are absorbed by flexures; 0: rigid.',
    'actuators': 'The order in which rates are commanded.',
    'groups': 'What fails together.',
    'park': 'Where it may stand when it cannot go on.',
    'struts': 'Joints from the base to the platform; drives: stroke from home, largest speed.',
}


def mechanism_text(mechanism: Mechanism, remarks: Sequence[str] = ()) -> str:
    """Return the mechanism file of ``mechanism``, which has struts.

    Below ``remarks``, a line each. Read again, it is the same mechanism, to 15 digits.
    MechanismError if it has none.
    """
    if not mechanism.struts:
        reason = 'a mechanism given by its Jacobian only has no joints to write down'
        raise MechanismError(mechanism.name, 'struts', reason)
    lines = [f'# {line}' for line in remarks]
    lines.append('# Metres, radians, base axes; joint values are 0 at home (docs/adapting.md).')
    lines.append(f'mechanism: {_name(mechanism.name)}')

    def block(key: str, value: str) -> None:
        lines.extend([f'# {_NOTES[key]}', f'{key}: {value}'.rstrip()])

    scale = mechanism.characteristic_length
    block('platform', f'{{origin: {_vector(mechanism.origin, scale)}}}')
    task = mechanism.task
    major = f', major: {_names(task.major)}' if task.major != task.coordinates else ''
    block('task', f'{{coordinates: {_names(task.coordinates)}{major}}}')
    block('characteristic_length', _number(scale))
    if mechanism.compliance:
        block('compliance', _number(mechanism.compliance))
    for key in ('stiffness', 'flexure_stiffness'):
        if not isnan(getattr(mechanism, key)):
            lines.append(f'{key}: {_number(getattr(mechanism, key))}')
    found = tuple(one.name for strut in mechanism.struts for one in strut.actuators)
    if mechanism.actuator_names != found:
        block('actuators', _names(mechanism.actuator_names))
    if mechanism.groups:
        groups = (f'{_name(name)}: {_names(parts)}' for name, parts in mechanism.groups.items())
        block('groups', f'{{{", ".join(groups)}}}')
    if mechanism.park:
        park = (f'{name}: {_number(value)}' for name, value in mechanism.park.items())
        block('park', f'{{{", ".join(park)}}}')
    block('struts', '')
    for strut in mechanism.struts:
        lines += _strut(strut, scale)
    return '\n'.join(lines) + '\n'


def _strut(strut: Strut, scale: float) -> list[str]:
    lines = [f'  - name: {_name(strut.name)}']
    if strut.release:
        lines.append('    release: true')
    lines.append('    joints:')
    for name, joints in joint_groups(strut):
        labels = [joint.name.rpartition('.')[2] for joint in joints]
        together = all(np.array_equal(joint.point, joints[0].point) for joint in joints)
        driven = any(joint.actuator is not None for joint in joints)
        entries: list[dict[str, str]]
        if labels == ['1', '2'] and together and not driven:
            axes = ', '.join(_vector(joint.axis) for joint in joints)
            entries = [{'name': _name(name), 'type': 'universal', 'axes': f'[{axes}]',
                        'point': _vector(joints[0].point, scale)}]
        elif labels == list('xyz') and together and not driven and np.array_equal(
            [joint.axis for joint in joints], np.eye(3)
        ):
            entries = [{'name': _name(name), 'type': 'spherical',
                        'point': _vector(joints[0].point, scale)}]
        else:
            entries = [_single(joint, scale) for joint in joints]
        for entry in entries:
            content = ', '.join(f'{key}: {value}' for key, value in entry.items())
            lines.append(f'      - {{{content}}}')
    return lines


def _single(joint: Joint, scale: float) -> dict[str, str]:
    entry = {'name': _name(joint.name), 'type': joint.kind, 'axis': _vector(joint.axis)}
    if joint.kind == 'revolute':
        entry['point'] = _vector(joint.point, scale)
    return entry if joint.actuator is None else entry | _drive(joint, joint.actuator)


def _drive(joint: Joint, drive: Actuator) -> dict[str, str]:
    entry = {'actuated': 'true'}
    if drive.name != joint.name:
        # Only axes of universal and spherical joints have drives of other names: such a joint is
        # written axis by axis, each known by its drive.
        entry['name'] = _name(drive.name)
    if isfinite(drive.position[0]) or isfinite(drive.position[1]):
        entry['position'] = f'[{_limit(drive.position[0])}, {_limit(drive.position[1])}]'
    if isfinite(drive.velocity):
        entry['velocity'] = _number(drive.velocity)
    if drive.joint_state_name != drive.name:
        entry['joint_state_name'] = _name(drive.joint_state_name)
    if drive.home or drive.sign < 0:
        entry |= {'home': _number(drive.home), 'sign': str(drive.sign)}
    if isfinite(drive.period):
        entry['period'] = _number(drive.period)
    if drive.brake:
        entry['brake'] = 'true'
    if drive.when_off:
        entry['when_off'] = drive.when_off
    if drive.encoder != 'load':
        entry['encoder'] = drive.encoder
    if not isnan(drive.stiffness):
        entry['stiffness'] = _number(drive.stiffness)
    return entry


def _name(text: str) -> str:
    """Return a name as YAML: bare where nothing could misread it."""
    plain = text.replace('_', 'a').replace('-', 'a').replace('.', 'a')
    bare = plain.isalnum() and plain.isascii() and text[0].isalpha()
    words = {'true', 'false', 'null', 'yes', 'no', 'on', 'off', 'y', 'n', 'inf', 'nan'}
    if bare and text.lower() not in words:
        return text
    quoted = text.replace("'", "''")
    return f"'{quoted}'"


def _names(names: Sequence[str]) -> str:
    return f'[{", ".join(map(_name, names))}]'


def _limit(value: float) -> str:
    return _number(value) if isfinite(value) else f'{"-" if value < 0 else ""}.inf'


def _vector(vector: Sequence[float] | np.ndarray, scale: float = 1.0) -> str:
    """Return numbers in brackets; what is nothing beside ``scale`` is written as 0."""
    kept = (value if abs(value) > 1e-15 * scale else 0.0 for value in vector)
    return f'[{", ".join(map(_number, kept))}]'


def _number(value: float) -> str:
    # With a point, or YAML 1.1 would read 1e-05 as text.
    digits = f'{value:.15g}'
    mantissa, mark, exponent = digits.partition('e')
    return f'{mantissa}{"" if "." in mantissa or not mark else ".0"}{mark}{exponent}'
