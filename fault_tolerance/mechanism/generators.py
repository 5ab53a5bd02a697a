# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Mechanisms made by rule, where a file would be long."""

from __future__ import annotations

from math import cos, inf, pi, sin

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator, Joint, Strut
from fault_tolerance.mechanism.task import Task


def evenly_spaced_mirror(
    count: int,
    *,
    radius: float = 1.0,
    length: float = 1.0,
    first_angle: float = 0.0,
    stroke: float = inf,
    velocity: float = inf,
    compliance: float = 0.05,
) -> Mechanism:
    """Return a fast steering mirror on ``count`` upright struts, evenly spaced on a circle.

    Each strut has a hinge at the base with a tangential axis, a prismatic actuator
    ``theta_1 ...`` and a spherical joint at the platform. At home p = 1/sqrt(3) for every
    actuator and t = sqrt((N - 3) / N), whatever the radius and the length.

    Parameters
    ----------
    count : int
        Number N of struts, at least 3.
    radius, length : float
        Of the circle and of the struts, metres.
    first_angle : float
        Where on the circle strut_1 stands, radians from the x axis.
    stroke, velocity : float
        Limits of the actuators, metres (both ways from home) and metres per second.
    compliance : float
        See `Mechanism`.

    Raises
    ------
    MechanismError
        For fewer than three struts.
    """
    if count < 3:
        raise MechanismError('mirror', 'count', f'{count} struts do not hold a mirror (3 do)')
    struts = []
    for number in range(1, count + 1):
        angle = first_angle + 2.0 * pi * (number - 1) / count
        foot = radius * np.array([cos(angle), sin(angle), 0.0])
        head = foot + np.array([0.0, 0.0, length])
        strut, name = f'strut_{number}', f'theta_{number}'
        drive = Actuator(name, name, strut, 'prismatic', (-stroke, stroke), velocity)
        tangent = np.array([-sin(angle), cos(angle), 0.0])
        axes = zip('xyz', np.eye(3), strict=True)
        joints = (
            Joint(f'hinge_{number}', 'revolute', tangent, foot),
            Joint(drive.name, 'prismatic', np.array([0.0, 0.0, 1.0]), foot, drive),
            *(Joint(f'ball_{number}.{label}', 'revolute', axis, head) for label, axis in axes),
        )
        struts.append(Strut(strut, joints))
    return Mechanism(
        f'mirror_of_{count}_struts',
        Task(('wx', 'wy', 'vz'), ('wx', 'wy')),
        tuple(struts),
        origin=np.array([0.0, 0.0, length]),
        characteristic_length=radius,
        compliance=compliance,
    )
