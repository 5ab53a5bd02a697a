# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The parts of a machine: actuators, joints and struts, at home, in base axes, metres and radians.

Joint values are zero at home.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite, isnan, nan
from typing import Literal

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray, frozen_array
from fault_tolerance.tolerances import SHORTEST_AXIS

JointKind = Literal['revolute', 'prismatic']
EncoderSide = Literal['load', 'motor']
WhenOff = Literal['', 'free', 'stuck']


@dataclass(frozen=True)
class Actuator:
    """A driven joint axis and how its drive names and counts it."""

    name: str
    """Its name in reports, measures and commands."""
    joint: str = ''
    strut: str = ''
    """The joint it drives and the strut that joint is in; empty where the mechanism is given by
    its Jacobian only."""
    kind: JointKind = 'prismatic'
    """Whether its values are radians or metres."""
    position: tuple[float, float] = (-inf, inf)
    """Lowest and highest joint value, measured from home."""
    velocity: float = inf
    """Largest speed."""
    joint_state_name: str = ''
    """Its name in joint states, `name` where not given."""
    home: float = 0.0
    """What the encoder reads at home."""
    sign: int = 1
    """+1, or -1 where the encoder counts the other way."""
    brake: bool = False
    """Whether it can be locked on command."""
    encoder: EncoderSide = 'load'
    """What its encoder reads: the joint, or the drive before whatever gives way between them."""
    stiffness: float = nan
    """Of its hold on the joint, N/m or N m/rad; NaN where it is not known."""
    when_off: WhenOff = ''
    """What a drive without power is: driven by the others, or held; empty where nobody knows."""
    period: float = inf
    """After which its encoder reads the same again, rad or m; infinite where it counts on."""

    def __repr__(self) -> str:
        return f'Actuator({self.name!r}, {self.kind})'

    def __post_init__(self) -> None:
        """Check the numbers."""
        low, high = self.position
        if isnan(low) or isnan(high) or not low < high:
            raise MechanismError(self.name, 'position', f'[{low}, {high}] is not an interval')
        if not low <= 0.0 <= high:
            reason = f'[{low}, {high}] leaves out home (0)'
            if low <= self.home <= high:
                counted = f'[{low - self.home:g}, {high - self.home:g}]'
                reason += f'; limits count from home: if these are readings, write {counted}'
            raise MechanismError(self.name, 'position', reason)
        if isnan(self.velocity) or not self.velocity > 0.0:
            raise MechanismError(self.name, 'velocity', f'{self.velocity} is not positive')
        if not isfinite(self.home):
            raise MechanismError(self.name, 'home', f'{self.home} is not finite')
        if self.encoder not in ('load', 'motor'):
            raise MechanismError(self.name, 'encoder', f'{self.encoder!r} is not load or motor')
        if self.when_off not in ('', 'free', 'stuck'):
            raise MechanismError(self.name, 'when_off', f'{self.when_off!r} is not free or stuck')
        if not (isnan(self.stiffness) or 0.0 < self.stiffness < inf):
            raise MechanismError(self.name, 'stiffness', f'{self.stiffness} is not positive')
        if isnan(self.period) or not self.period > 0.0:
            raise MechanismError(self.name, 'period', f'{self.period} is not positive')
        if self.sign not in (-1, 1):
            raise MechanismError(self.name, 'sign', f'{self.sign} is neither 1 nor -1')
        if not self.joint_state_name:
            object.__setattr__(self, 'joint_state_name', self.name)


@dataclass(frozen=True, eq=False)
class Joint:
    """One axis of a strut."""

    name: str
    kind: JointKind
    axis: FloatArray
    """(3,): direction at home, base axes, unit length."""
    point: FloatArray
    """(3,): A point on the axis at home, metres, base axes (any point for a prismatic joint)."""
    actuator: Actuator | None = None

    def __repr__(self) -> str:
        return f'Joint({self.name!r}, {self.kind}{", driven" if self.actuator else ""})'

    def __post_init__(self) -> None:
        """Check the arrays, and make the axis a unit vector."""
        axis = frozen_array(self.axis, (3,), f'axis of {self.name}')
        largest = float(np.abs(axis).max())
        if largest < SHORTEST_AXIS:
            raise MechanismError(self.name, 'axis', 'is zero')
        # The axis is divided twice: the length of one of 1e200 is not a finite number.
        direction = axis / largest
        direction = direction / np.linalg.norm(direction)
        object.__setattr__(self, 'axis', frozen_array(direction, (3,), 'axis'))
        object.__setattr__(self, 'point', frozen_array(self.point, (3,), f'point of {self.name}'))

    @cached_property
    def screw(self) -> FloatArray:
        """The joint's twist per unit rate at home, (6,), v taken at the base origin."""
        if self.kind == 'prismatic':
            screw = np.concatenate([np.zeros(3), self.axis])
        else:
            screw = np.concatenate([self.axis, np.cross(self.point, self.axis)])
        return frozen_array(screw, (6,), 'screw')


@dataclass(frozen=True, eq=False)
class Strut:
    """A serial chain from base to platform."""

    name: str
    joints: tuple[Joint, ...]
    """Base to platform."""
    release: bool = False
    """Whether the strut can be disconnected on command."""

    def __repr__(self) -> str:
        return f'Strut({self.name!r}, {len(self.joints)} joints)'

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """The drives in it, base to platform."""
        return tuple(joint.actuator for joint in self.joints if joint.actuator is not None)
