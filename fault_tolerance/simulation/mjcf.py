# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Any mechanism as a MuJoCo model: the text of an MJCF file, written without the library.

The platform is a free body. A strut is a chain of bodies, one a joint, all with the axes of the
base at home; its loop is closed by an equality constraint between its last body and the platform.
Where a strut ends in a passive spherical joint, that joint is the constraint (``connect``:
a common point); any other end is welded. Every actuator has a position and a velocity servo on
its joint, and a joint constraint, off at first, that locks it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, pi
from xml.etree import ElementTree

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Joint, Strut
from fault_tolerance.simulation.plant_settings import PlantSettings

PLATFORM = 'platform'
TIMESTEP = 2.5e-4
"""Seconds; the drives below swing with 0.63 rad a step."""

CONSTRAINT_TIME = 2.0 * TIMESTEP
"""Time constant of the constraints, seconds: the shortest that MuJoCo lets a time step have."""

# Impedance from the first touch on; the width over which it would grow does not matter then.
_END_STOP = (0.99, 0.99, 1e-3)

RATE_SERVO = '{}/rate'
"""Name of an actuator's velocity servo; its position servo and its lock have the actuator's."""


@dataclass(frozen=True)
class Masses:
    """Weights of the parts, by rules that suit a mirror of 20 mm and a hexapod alike.

    Mechanism files know nothing of masses. Everything here scales with the characteristic
    length Lc: the platform is a plate of radius Lc, a strut a rod, cut into as many pieces as it
    has joints.

    Attributes
    ----------
    plate : float
        Of the platform, kg/m^2. 20 is 7.4 mm of aluminium: 25 g at a radius of 20 mm.
    rod : float
        Of a strut, per length and Lc^2, kg/m^3. 21 is aluminium with a radius of 0.05 Lc.
    drive_frequency : float
        Of a drive alone on its servo's stiffness, Hz; sets the inertia of its moving parts as
        seen at the joint. 400 Hz at 1e6 N/m are 0.16 kg.
    drive_damping : float
        Of the same, as a ratio.
    joint_inertia : float
        Of turning joints, as a part of the platform's inertia.
    gravity : tuple of float
        Base axes, m/s^2.
    """

    plate: float = 20.0
    rod: float = 21.0
    drive_frequency: float = 400.0
    drive_damping: float = 0.7
    joint_inertia: float = 0.02
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)


def mjcf_text(
    mechanism: Mechanism,
    settings: PlantSettings | None = None,
    masses: Masses | None = None,
) -> str:
    """Return the MJCF document of ``mechanism`` at home.

    ``settings`` give stiffness and damping, ``masses`` the weights. Raises `MechanismError` if the
    mechanism is given by its Jacobian only.
    """
    if not mechanism.struts:
        reason = 'a mechanism given by its Jacobian only cannot be simulated'
        raise MechanismError(mechanism.name, 'struts', reason)
    return _Document(mechanism, settings or PlantSettings(), masses or Masses()).text()


def ball_of(strut: Strut, length: float) -> tuple[Joint, ...]:
    """Return the last three joints of ``strut`` if they are a spherical joint without a drive.

    Else return an empty tuple. ``length`` is the characteristic length of the mechanism, metres.
    """
    last = strut.joints[-3:]
    if len(last) < 3 or any(j.kind != 'revolute' or j.actuator is not None for j in last):
        return ()
    apart = max(float(np.abs(joint.point - last[0].point).max()) for joint in last)
    volume = abs(float(np.linalg.det(np.array([joint.axis for joint in last]))))
    return last if apart <= 1e-9 * length and volume > 0.1 else ()


class _Document:
    """The document while it is written."""

    def __init__(self, mechanism: Mechanism, settings: PlantSettings, masses: Masses) -> None:
        self._mechanism = mechanism
        self._settings = settings
        self._masses = masses
        self._length = mechanism.characteristic_length
        self._plate = masses.plate * pi * self._length**2
        self._root = ElementTree.Element('mujoco', model=mechanism.name)
        self._add(self._root, 'compiler', angle='radian', autolimits='true')
        option = self._add(
            self._root, 'option', timestep=TIMESTEP, integrator='implicitfast',
            gravity=masses.gravity, tolerance=1e-12,
        )
        # No contacts; a diverging state is reported, not reset.
        self._add(option, 'flag', contact='disable', autoreset='disable')
        self._world = self._add(self._root, 'worldbody')
        self._equality = self._add(self._root, 'equality')
        self._actuators = self._add(self._root, 'actuator')

    def text(self) -> str:
        platform = self._add(self._world, 'body', name=PLATFORM, pos=self._mechanism.origin)
        self._add(platform, 'freejoint', name=PLATFORM)
        across = 0.25 * self._plate * self._length**2
        inertia = (across, across, 2.0 * across)
        self._add(platform, 'inertial', pos=np.zeros(3), mass=self._plate, diaginertia=inertia)
        for strut in self._mechanism.struts:
            self._add_strut(strut)
        self._add_custom()
        for actuator in self._mechanism.actuators:
            self._add_servos(actuator.name, actuator.joint, actuator.kind == 'revolute')
        ElementTree.indent(self._root)
        return ElementTree.tostring(self._root, encoding='unicode') + '\n'

    def _add_custom(self) -> None:
        """Write down what MuJoCo has no use for, but whoever reads the file as a mechanism."""
        custom, mechanism = self._add(self._root, 'custom'), self._mechanism
        for name in ('characteristic_length', 'compliance'):
            self._add(custom, 'numeric', name=name, data=getattr(mechanism, name))
        words = {'task': mechanism.task.coordinates, 'major': mechanism.task.major}
        for name, names in (*words.items(), ('platform', (PLATFORM,))):
            self._add(custom, 'text', name=name, data=' '.join(names))

    def _add_strut(self, strut: Strut) -> None:
        origin = self._mechanism.origin
        ball = ball_of(strut, self._length)
        joints = strut.joints[: len(strut.joints) - len(ball)]
        end = ball[0].point if ball else origin
        places = _places(joints, end)
        span = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
        # A strut of zero length has mass too.
        span = max(span, 0.1 * self._length)
        mass = self._masses.rod * self._length**2 * span / max(len(joints), 1)
        body, at = self._world, np.zeros(3)
        for joint, place, following in zip(joints, places[:-1], places[1:], strict=True):
            body = self._add(body, 'body', name=joint.name, pos=place - at)
            self._add_joint(body, joint)
            piece = following - place
            reach = float(piece @ piece) / 12.0 + (0.05 * self._length) ** 2
            inertia = (mass * reach,) * 3
            self._add(body, 'inertial', pos=0.5 * piece, mass=mass, diaginertia=inertia)
            at = place
        # Without a second body: the world.
        bodies = {'body1': PLATFORM} | ({'body2': joints[-1].name} if joints else {})
        kind, anchor = ('connect', end - origin) if ball else ('weld', origin - at)
        self._add(self._equality, kind, name=strut.name, anchor=anchor, **bodies)

    def _add_joint(self, body: ElementTree.Element, joint: Joint) -> None:
        turning = joint.kind == 'revolute'
        lever = self._length if turning else 1.0
        attributes: dict[str, object] = {}
        if joint.actuator is None:
            attributes['damping'] = self._settings.joint_damping * lever**2
            if turning:
                attributes['armature'] = self._masses.joint_inertia * self._plate * lever**2
        else:
            swing = 2.0 * pi * self._masses.drive_frequency
            attributes['armature'] = self._stiffness(turning) / swing**2
            low, high = joint.actuator.position
            if isfinite(low) and isfinite(high):
                attributes['range'] = (low, high)
                attributes['solreflimit'] = (CONSTRAINT_TIME, 1.0)
                attributes['solimplimit'] = _END_STOP
        kind = 'hinge' if turning else 'slide'
        self._add(body, 'joint', name=joint.name, type=kind, axis=joint.axis, **attributes)

    def _add_servos(self, name: str, joint: str, turning: bool) -> None:
        stiffness = self._stiffness(turning)
        swing = 2.0 * pi * self._masses.drive_frequency
        damping = 2.0 * self._masses.drive_damping * stiffness / swing
        self._add(self._actuators, 'position', name=name, joint=joint, kp=stiffness)
        rate = RATE_SERVO.format(name)
        self._add(self._actuators, 'velocity', name=rate, joint=joint, kv=damping)
        self._add(
            self._equality, 'joint', name=name, joint1=joint, polycoef=(0.0,) * 5, active='false'
        )

    def _stiffness(self, turning: bool) -> float:
        return self._settings.actuator_stiffness * (self._length**2 if turning else 1.0)

    @staticmethod
    def _add(parent: ElementTree.Element, tag: str, **attributes: object) -> ElementTree.Element:
        texts = {name: _text(value) for name, value in attributes.items()}
        return ElementTree.SubElement(parent, tag, texts)


def _places(joints: tuple[Joint, ...], end: FloatArray) -> list[FloatArray]:
    """Return where the body of each joint begins, and where the last one ends, (3,) each.

    A slide is put half-way between its neighbours.
    """
    places: list[FloatArray] = []
    for number, joint in enumerate(joints):
        if joint.kind == 'revolute':
            places.append(joint.point)
            continue
        turning = [one.point for one in joints[number + 1 :] if one.kind == 'revolute']
        following = turning[0] if turning else end
        places.append(0.5 * (places[-1] + following) if places else following)
    return [*places, end]


def _text(value: object) -> str:
    if isinstance(value, str):
        return value
    return ' '.join(repr(float(number)) for number in np.atleast_1d(np.asarray(value)))
