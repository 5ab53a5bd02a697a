# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism as SDF: its joints close the loops, so that every strut ends at the platform.

Links have no shapes and SDF's own weights: it is the kinematics that is written down.
"""

from __future__ import annotations

from math import isfinite
from xml.etree import ElementTree

import numpy as np

from fault_tolerance.machines.sdf_reading import EXTRAS
from fault_tolerance.machines.urdf_writing import numbers_text, require_struts
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism, check_names
from fault_tolerance.mechanism.parts import Joint, Strut
from fault_tolerance.simulation.mjcf import PLATFORM, ball_of


def sdf_text(mechanism: Mechanism) -> str:
    """Return ``mechanism`` as SDF.

    MechanismError if it is given by its Jacobian only, or has a name of a link that is made here.
    """
    require_struts(mechanism)
    ElementTree.register_namespace('ft', EXTRAS[1:].split('}')[0])
    root = ElementTree.Element('sdf', version='1.7')
    model = ElementTree.SubElement(root, 'model', name=mechanism.name)
    _add_link(model, PLATFORM, mechanism.origin)
    for strut in mechanism.struts:
        _add_strut(model, strut, mechanism)
    # SDF has one name space for links and joints.
    check_names(mechanism.name, [('SDF', one.get('name', '')) for one in model])
    ElementTree.SubElement(
        model, EXTRAS, platform=PLATFORM, drives=' '.join(mechanism.actuator_names),
        task=' '.join(mechanism.task.coordinates), major=' '.join(mechanism.task.major),
        characteristic_length=repr(mechanism.characteristic_length),
        compliance=repr(mechanism.compliance),
    )
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding='unicode') + '\n'


def _add_strut(model: ElementTree.Element, strut: Strut, mechanism: Mechanism) -> None:
    balls = ball_of(strut, mechanism.characteristic_length)
    joints = strut.joints[: len(strut.joints) - len(balls)]
    parent = 'world'
    for place, joint in enumerate(joints):
        last = place == len(joints) - 1 and not balls
        child = PLATFORM if last else f'{joint.name}_link'
        if not last:
            _add_link(model, child, joint.point)
        element = _add_joint(model, joint.actuator.name if joint.actuator else joint.name,
                             joint.kind, parent, child)
        if last:
            _add_pose(element, joint.point - mechanism.origin)
        _add_axis(element, joint)
        parent = child
    if balls:
        element = _add_joint(model, f'{strut.name}_end', 'ball', parent, PLATFORM)
        _add_pose(element, balls[0].point - mechanism.origin)


def _add_link(model: ElementTree.Element, name: str, place: FloatArray) -> None:
    _add_pose(ElementTree.SubElement(model, 'link', name=name), place)


def _add_joint(
    model: ElementTree.Element, name: str, kind: str, parent: str, child: str
) -> ElementTree.Element:
    element = ElementTree.SubElement(model, 'joint', name=name, type=kind)
    ElementTree.SubElement(element, 'parent').text = parent
    ElementTree.SubElement(element, 'child').text = child
    return element


def _add_pose(element: ElementTree.Element, place: FloatArray) -> None:
    ElementTree.SubElement(element, 'pose').text = numbers_text([*place, *np.zeros(3)])


def _add_axis(element: ElementTree.Element, joint: Joint) -> None:
    axis = ElementTree.SubElement(element, 'axis')
    ElementTree.SubElement(axis, 'xyz').text = numbers_text(joint.axis)
    limit, drive = ElementTree.SubElement(axis, 'limit'), joint.actuator
    low, high = drive.position if drive else (-np.inf, np.inf)
    limits = {'lower': low, 'upper': high, 'velocity': drive.velocity if drive else np.inf}
    for key, value in limits.items():
        if isfinite(value):
            ElementTree.SubElement(limit, key).text = numbers_text([value])
