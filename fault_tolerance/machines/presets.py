# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Usual machines from a few numbers: hexapods and the like, mirrors, delta robots."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin, sqrt

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.assembly import assembled
from fault_tolerance.machines.leg_types import Leg
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator, Joint, Strut

_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class HexapodSize:
    """A hexapod's numbers, metres and radians; the angles are half of those between neighbours."""

    base_radius: float = 0.2
    platform_radius: float = 0.15
    height: float = 0.25
    base_angle: float = radians(15.0)
    platform_angle: float = radians(15.0)
    crank: float = 0.06

    def __post_init__(self) -> None:
        """Refuse lengths and angles that no hexapod has."""
        for key in ('base_radius', 'platform_radius', 'height', 'crank'):
            if not getattr(self, key) > 0.0:
                raise MechanismError('hexapod', key, f'{getattr(self, key):g} is not positive')
        for key in ('base_angle', 'platform_angle'):
            value = getattr(self, key)
            if not abs(value) <= pi / 3.0:
                reason = f'{value:g} rad is not within 60 degrees (--units m,deg for degrees)'
                raise MechanismError('hexapod', key, reason)


def hexapod_legs(kind: str, size: HexapodSize) -> list[Leg]:
    """Return legs of the type ``kind`` for a machine of ``size``.

    Six, in pairs, on the base around 0, 120 and 240 degrees; three, at these angles, for RPS and
    PRS. Slides go upwards. Cranks lie level, away from their neighbours, and lift as they turn.
    """
    three = kind in ('RPS', 'PRS')
    legs = []
    for number in range(3 if three else 6):
        side = 1 if number % 2 else -1
        middle = 2.0 * pi / 3.0 * (number if three else number // 2)
        foot = middle + (0.0 if three else side * size.base_angle)
        head = middle + (0.0 if three else side * (pi / 3.0 - size.platform_angle))
        base = size.base_radius * _out(foot)
        platform = size.platform_radius * _out(head) + size.height * _UP
        extra: dict[str, FloatArray] = {}
        if kind in ('PUS', 'PSS', 'PRS'):
            extra['slide'] = _UP
        if three:
            extra['hinge'] = np.cross(_UP, _out(foot))
        if kind == 'RSS':
            arm = side * np.cross(_UP, _out(foot))
            extra |= {'hinge': np.cross(arm, _UP), 'knee': base + size.crank * arm}
        legs.append(Leg(kind, base, platform, Actuator(f'leg_{number + 1}'), **extra))
    return legs


def delta(
    kind: str, base_radius: float, platform_radius: float, rod: float, arm: float = 0.0
) -> Mechanism:
    """Return a delta robot, 3-RUU on cranks or 3-PUU on upright slides, its platform below.

    The universal joints' axes are level and parallel at both ends of a rod, which thus keeps the
    platform level, as the usual parallelogram does.

    Parameters
    ----------
    kind : str
        RUU or PUU.
    base_radius, platform_radius : float
        Of the cranks' axes, or the slides, and of the platform's joints, metres.
    rod, arm : float
        Lengths of the rods and of the cranks (level at home; they lift as they turn), metres.

    Raises
    ------
    MechanismError
        If the rods do not reach.
    """
    name = f'delta_3{kind.lower()}'
    arm = arm if kind == 'RUU' else 0.0
    for key, length in (('base-radius', base_radius), ('platform-radius', platform_radius),
                        ('rod', rod), ('arm', arm if kind == 'RUU' else 1.0)):
        if not length > 0.0:
            raise MechanismError(name, key, f'{length:g} is not positive')
    inwards = base_radius + arm - platform_radius
    if abs(inwards) >= rod:
        reason = f'{rod:g} m do not span the {abs(inwards):.3g} m from knee to platform'
        raise MechanismError(name, 'rod', reason)
    drop = sqrt(rod**2 - inwards**2)
    struts = []
    for number in range(1, 4):
        out = _out(2.0 * pi / 3.0 * (number - 1))
        base, knee = base_radius * out, (base_radius + arm) * out
        platform = platform_radius * out - drop * _UP
        tangent, strut = np.cross(out, _UP), f'strut_{number}'
        # Across the rod, in the plane that the leg lies in.
        other = np.cross(platform - knee, tangent)
        if kind == 'RUU':
            drive = Actuator(f'arm_{number}', f'arm_{number}', strut, 'revolute')
            first = Joint(drive.name, 'revolute', tangent, base, drive)
        else:
            drive = Actuator(f'slide_{number}', f'slide_{number}', strut, 'prismatic')
            first = Joint(drive.name, 'prismatic', _UP, base, drive)
        struts.append(Strut(strut, (
            first,
            Joint(f'knee_{number}.1', 'revolute', tangent, knee),
            Joint(f'knee_{number}.2', 'revolute', other, knee),
            Joint(f'wrist_{number}.1', 'revolute', other, platform),
            Joint(f'wrist_{number}.2', 'revolute', tangent, platform),
        )))
    return assembled(name, struts, np.array([0.0, 0.0, -drop]), length=platform_radius)


def _out(angle: float) -> FloatArray:
    """Return the level direction at an angle from the x axis."""
    return np.array([cos(angle), sin(angle), 0.0])
