# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism as URDF, and the closures that URDF has no word for.

The first strut carries the platform; the loops of the others are cut at their ends. Links have no
shapes and no weights: it is the kinematics that is written down.
"""

from __future__ import annotations

from math import isfinite
from xml.etree import ElementTree

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Joint
from fault_tolerance.simulation.mjcf import PLATFORM, ball_of

_BASE = 'base'
_NO_LIMIT = 1000.0
"""Metres, m/s: URDF has no slides and no speeds without limits."""


def urdf_texts(mechanism: Mechanism) -> tuple[str, str]:
    """Return the URDF of ``mechanism`` and the YAML text of its closures.

    MechanismError if it is given by its Jacobian only.
    """
    require_struts(mechanism)
    root = ElementTree.Element('robot', name=mechanism.name)
    ElementTree.SubElement(root, 'link', name=_BASE)
    closures = []
    for place, strut in enumerate(mechanism.struts):
        ball = ball_of(strut, mechanism.characteristic_length) if place else ()
        joints = strut.joints[: len(strut.joints) - len(ball)]
        link, at = _BASE, np.zeros(3)
        for joint in joints:
            link, at = _add_joint(root, joint, link, at)
        if not place:
            _add_fixed(root, PLATFORM, link, mechanism.origin - at)
            continue
        end = ball[0].point if ball else mechanism.origin
        _add_fixed(root, f'{strut.name}_end', link, end - at)
        _add_fixed(root, f'{strut.name}_closure', PLATFORM, end - mechanism.origin)
        closures.append((f'{strut.name}_end', f'{strut.name}_closure', '3d' if ball else '6d'))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding='unicode') + '\n', _closures(mechanism, closures)


def require_struts(mechanism: Mechanism) -> None:
    """Raise MechanismError if ``mechanism`` is given by its Jacobian only."""
    if not mechanism.struts:
        reason = 'a mechanism given by its Jacobian only has no joints to write down'
        raise MechanismError(mechanism.name, 'struts', reason)


def _add_joint(
    root: ElementTree.Element, joint: Joint, link: str, at: FloatArray
) -> tuple[str, FloatArray]:
    """Add a joint and its link, whose frame is at a point of the axis; return both."""
    turning = joint.kind == 'revolute'
    place = joint.point if turning else at
    drive = joint.actuator
    limits = drive.position if drive else (-np.inf, np.inf)
    bounded = isfinite(limits[0]) and isfinite(limits[1])
    name = drive.name if drive else joint.name
    kind = joint.kind if bounded or not turning else 'continuous'
    element = _connect(root, name, kind, link, f'{name}_link', place - at)
    ElementTree.SubElement(element, 'axis', xyz=numbers_text(joint.axis))
    low, high = limits if bounded else (-_NO_LIMIT, _NO_LIMIT)
    speed = drive.velocity if drive and isfinite(drive.velocity) else _NO_LIMIT
    limit = {'effort': numbers_text([_NO_LIMIT]), 'velocity': numbers_text([speed])}
    if kind != 'continuous':
        limit |= {'lower': numbers_text([low]), 'upper': numbers_text([high])}
    ElementTree.SubElement(element, 'limit', limit)
    return f'{name}_link', place


def _add_fixed(root: ElementTree.Element, name: str, link: str, offset: FloatArray) -> None:
    _connect(root, f'{name}_fixed', 'fixed', link, name, offset)


def _connect(
    root: ElementTree.Element, name: str, kind: str, parent: str, child: str, offset: FloatArray
) -> ElementTree.Element:
    ElementTree.SubElement(root, 'link', name=child)
    element = ElementTree.SubElement(root, 'joint', name=name, type=kind)
    ElementTree.SubElement(element, 'origin', xyz=numbers_text(offset), rpy='0 0 0')
    ElementTree.SubElement(element, 'parent', link=parent)
    ElementTree.SubElement(element, 'child', link=child)
    return element


def _closures(mechanism: Mechanism, closures: list[tuple[str, str, str]]) -> str:
    task = mechanism.task
    pairs = ', '.join(f'[{_quoted(first)}, {_quoted(second)}]' for first, second, _ in closures)
    return f"""# Closures of the loops of {mechanism.name}, which its URDF cannot hold.
closed_loop: [{pairs}]
type: [{', '.join(f"'{kind}'" for *_, kind in closures)}]
# The driven joints.
name_mot: [{', '.join(map(_quoted, mechanism.actuator_names))}]
# What else a mechanism file of fault_tolerance says.
task: {{coordinates: [{', '.join(task.coordinates)}], major: [{', '.join(task.major)}]}}
characteristic_length: {mechanism.characteristic_length!r}
compliance: {mechanism.compliance!r}
platform: {PLATFORM}
"""


def _quoted(name: str) -> str:
    doubled = name.replace("'", "''")
    return f"'{doubled}'"


def numbers_text(numbers: FloatArray | list[float]) -> str:
    """Return ``numbers`` as XML has them, with all their digits."""
    return ' '.join(repr(float(number) + 0.0) for number in numbers)
