# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The machine: actuators, joints, struts, and the mechanism they make.

Everything is given at home, in base axes, metres and radians. A strut is a serial chain of
single-axis joints from the base to the platform; spherical and universal joints are expanded
into revolutes before they come here. Joint values are zero at home.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, isfinite, isnan
from typing import Literal

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray, frozen_array
from fault_tolerance.mechanism.failure_modes import mode_words
from fault_tolerance.mechanism.task import Task
from fault_tolerance.mechanism.working_point import WorkingPoint

JointKind = Literal['revolute', 'prismatic']


@dataclass(frozen=True)
class Actuator:
    """A driven joint axis and how its drive names and counts it.

    Attributes
    ----------
    name : str
        Its name in reports, measures and commands.
    joint, strut : str
        The joint it drives and the strut that joint is in; empty where the mechanism is given
        by numbers only.
    kind : {'revolute', 'prismatic'}
        Radians or metres.
    position : tuple of float
        Lowest and highest joint value, measured from home.
    velocity : float
        Largest speed.
    joint_state_name : str
        Its name in joint states, `name` where not given.
    home : float
        What the encoder reads at home.
    sign : int
        +1, or -1 where the encoder counts the other way.
    brake : bool
        Whether it can be locked on command.
    """

    name: str
    joint: str = ''
    strut: str = ''
    kind: JointKind = 'prismatic'
    position: tuple[float, float] = (-inf, inf)
    velocity: float = inf
    joint_state_name: str = ''
    home: float = 0.0
    sign: int = 1
    brake: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        low, high = self.position
        if isnan(low) or isnan(high) or not low < high:
            raise MechanismError(self.name, 'position', f'[{low}, {high}] is not an interval')
        if not low <= 0.0 <= high:
            raise MechanismError(self.name, 'position', f'[{low}, {high}] leaves out home (0)')
        if isnan(self.velocity) or not self.velocity > 0.0:
            raise MechanismError(self.name, 'velocity', f'{self.velocity} is not positive')
        if not isfinite(self.home):
            raise MechanismError(self.name, 'home', f'{self.home} is not finite')
        if self.sign not in (-1, 1):
            raise MechanismError(self.name, 'sign', f'{self.sign} is neither 1 nor -1')
        if not self.joint_state_name:
            object.__setattr__(self, 'joint_state_name', self.name)


@dataclass(frozen=True, eq=False)
class Joint:
    """One axis of a strut.

    Attributes
    ----------
    name : str
    kind : {'revolute', 'prismatic'}
    axis : (3,) array
        Direction at home, base axes, unit length.
    point : (3,) array
        A point on the axis at home, metres, base axes (any point for a prismatic joint).
    actuator : Actuator or None
        The drive, if there is one.
    """

    name: str
    kind: JointKind
    axis: FloatArray
    point: FloatArray
    actuator: Actuator | None = None

    def __post_init__(self) -> None:
        """Normalise and freeze the arrays."""
        axis = frozen_array(self.axis, (3,), f'axis of {self.name}')
        largest = float(np.abs(axis).max())
        if largest < 1e-9:
            raise MechanismError(self.name, 'axis', 'is zero')
        # In two steps: the length of an axis of 1e200 is not a finite number.
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
    """A serial chain from base to platform.

    Attributes
    ----------
    name : str
    joints : tuple of Joint
        Base to platform.
    release : bool
        Whether the strut can be disconnected on command.
    """

    name: str
    joints: tuple[Joint, ...]
    release: bool = False

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """The drives in it, base to platform."""
        return tuple(joint.actuator for joint in self.joints if joint.actuator is not None)


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A parallel (or serial) manipulator at home.

    Attributes
    ----------
    name : str
    task : Task
    struts : tuple of Strut
        Empty where the mechanism is given by numbers only.
    actuators : tuple of Actuator
        All N of them, in the order in which vectors of actuators are written everywhere.
    origin : (3,) array
        Origin of the platform frame at home, metres, base axes.
    characteristic_length : float
        Metres; makes rotations and translations comparable in decisions about rank.
    compliance : float
        Structural constraints whose singular value (in that metric) is not above it count as
        absorbed by the flexures: docs/theory.md, section 6. 0: rigid.
    working_point : WorkingPoint or None
        Set where there are no struts.
    """

    name: str
    task: Task
    struts: tuple[Strut, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    origin: FloatArray = field(default_factory=lambda: np.zeros(3))
    characteristic_length: float = 1.0
    compliance: float = 0.0
    working_point: WorkingPoint | None = None

    def __post_init__(self) -> None:
        """Check that the parts fit together."""
        object.__setattr__(self, 'origin', frozen_array(self.origin, (3,), 'platform.origin'))
        if not (isfinite(self.characteristic_length) and self.characteristic_length > 0.0):
            reason = f'{self.characteristic_length} is not a positive length'
            raise MechanismError(self.name, 'characteristic_length', reason)
        if not (isfinite(self.compliance) and 0.0 <= self.compliance < 1.0):
            reason = f'{self.compliance} is not in [0, 1)'
            raise MechanismError(self.name, 'compliance', reason)
        if not self.actuators:
            found = tuple(actuator for strut in self.struts for actuator in strut.actuators)
            object.__setattr__(self, 'actuators', found)
        if not self.actuators:
            raise MechanismError(self.name, 'struts', 'no joint is actuated')
        self._check_names()
        if (self.working_point is None) is not bool(self.struts):
            reason = 'give either struts, or jacobian and mapping'
            raise MechanismError(self.name, 'struts', reason)
        if self.working_point is None:
            self._check_actuators()
        else:
            self._check_working_point(self.working_point)

    @cached_property
    def actuator_names(self) -> tuple[str, ...]:
        """Names of the N actuators, in order."""
        return tuple(actuator.name for actuator in self.actuators)

    @cached_property
    def strut_names(self) -> tuple[str, ...]:
        """Names of the struts, in order."""
        return tuple(strut.name for strut in self.struts)

    @cached_property
    def joint_state_names(self) -> tuple[str, ...]:
        """Names of the actuators in joint states, in order."""
        return tuple(actuator.joint_state_name for actuator in self.actuators)

    @cached_property
    def position_limits(self) -> FloatArray:
        """Lowest and highest joint values, (N, 2)."""
        limits = [actuator.position for actuator in self.actuators]
        return frozen_array(limits, (len(self.actuators), 2), 'limits', finite=False)

    @cached_property
    def velocity_limits(self) -> FloatArray:
        """Largest speeds, (N,)."""
        limits = [actuator.velocity for actuator in self.actuators]
        return frozen_array(limits, (len(self.actuators),), 'limits', finite=False)

    @cached_property
    def rate_scale(self) -> FloatArray:
        """What turns joint rates into metres per second, (N,): lengths for turning drives."""
        length = self.characteristic_length
        scale = [length if one.kind == 'revolute' else 1.0 for one in self.actuators]
        return frozen_array(scale, (len(scale),), 'scale')

    @cached_property
    def rates_alike(self) -> bool:
        """Whether one number turns all joint rates into metres per second."""
        return len(set(self.rate_scale.tolist())) == 1

    def actuator_index(self, name: str) -> int:
        """Return the place of the actuator ``name``; ValueError if there is none."""
        return self.actuator_names.index(name)

    def actuators_of(self, strut: str) -> tuple[str, ...]:
        """Return the names of the actuators in ``strut``, in the mechanism's order."""
        return tuple(actuator.name for actuator in self.actuators if actuator.strut == strut)

    def strut_of(self, actuator: str) -> str:
        """Return the name of the strut ``actuator`` is in; empty if given by numbers."""
        return self.actuators[self.actuator_index(actuator)].strut

    def values_from_readings(self, readings: FloatArray) -> FloatArray:
        """Return joint values (N,) from what the encoders read (N,)."""
        return self._signs * (np.asarray(readings) - self._homes)

    def readings_from_values(self, values: FloatArray) -> FloatArray:
        """Return what the encoders read (N,) at the joint values (N,)."""
        return self._signs * np.asarray(values) + self._homes

    def rates_from_readings(self, rates: FloatArray) -> FloatArray:
        """Return joint rates (N,) from encoder rates (N,); its own inverse."""
        return self._signs * np.asarray(rates)

    @cached_property
    def _signs(self) -> FloatArray:
        signs = [actuator.sign for actuator in self.actuators]
        return frozen_array(signs, (len(signs),), 'sign')

    @cached_property
    def _homes(self) -> FloatArray:
        homes = [actuator.home for actuator in self.actuators]
        return frozen_array(homes, (len(homes),), 'home')

    def _check_names(self) -> None:
        names: list[tuple[str, str]] = [('struts', strut.name) for strut in self.struts]
        for strut in self.struts:
            if not strut.joints:
                raise MechanismError(self.name, f'struts.{strut.name}', 'has no joint')
            for joint in strut.joints:
                names.append((f'struts.{strut.name}.joints', joint.name))
        for _, name in names:
            _require_usable(self.name, name)
        for actuator in self.actuators:
            _require_usable(self.name, actuator.name)
        # A joint and the actuator that drives it may share a name: they are one thing.
        names += [
            ('actuators', actuator.name)
            for actuator in self.actuators
            if actuator.name != actuator.joint
        ]
        check_names(self.name, names)
        states = [('joint_state_name', actuator.joint_state_name) for actuator in self.actuators]
        check_names(self.name, states)

    def _check_actuators(self) -> None:
        found = {actuator.name for strut in self.struts for actuator in strut.actuators}
        listed = set(self.actuator_names)
        for name in sorted(listed - found):
            raise MechanismError(self.name, 'actuators', f'{name!r} is not an actuated joint')
        for name in sorted(found - listed):
            raise MechanismError(self.name, 'actuators', f'{name!r} is missing')

    def _check_working_point(self, point: WorkingPoint) -> None:
        wanted = {
            'jacobian': (point.jacobian.shape[0], len(self.task.coordinates), 'task coordinates'),
            'mapping': (point.mapping.shape[0], len(self.actuators), 'actuators'),
        }
        for key, (rows, expected, what) in wanted.items():
            if rows != expected:
                reason = f'has {rows} rows, but there are {expected} {what}'
                raise MechanismError(self.name, key, reason)


_SEPARATORS = '/:=,;'
_RESERVED = ('all', 'silent', *mode_words())


def _require_usable(source: str, name: str) -> None:
    """Refuse names that reports, the command line or fault commands would read otherwise."""
    if any(mark in name for mark in _SEPARATORS) or len(name.split()) > 1:
        reason = f'the name {name!r} must not contain a blank or any of {_SEPARATORS}'
        raise MechanismError(source, 'name', reason)
    if name.lower() in _RESERVED:
        raise MechanismError(source, 'name', f'the name {name!r} is a word for faults')


def check_names(source: str, names: Iterable[tuple[str, str]]) -> None:
    """Raise `MechanismError` if a name in the pairs (key, name) is empty or stands twice."""
    seen: set[str] = set()
    for key, name in names:
        if not name:
            raise MechanismError(source, key, 'an empty name')
        if name in seen:
            raise MechanismError(source, key, f'the name {name!r} stands for two things')
        seen.add(name)
