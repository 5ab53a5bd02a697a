# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The machine: struts, actuators and task, and how they fit together.

Everything is given at home, in base axes, metres and radians. A strut is a serial chain of
single-axis joints from the base to the platform; spherical and universal joints are expanded
into revolutes before they come here. Joint values are zero at home.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import hypot, inf, isfinite, isnan, nan, pi

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray, frozen_array
from fault_tolerance.mechanism.failure_modes import MISBEHAVIOURS, mode_words
from fault_tolerance.mechanism.parts import Actuator, EncoderSide, Joint, Strut
from fault_tolerance.mechanism.task import Task
from fault_tolerance.mechanism.working_point import WorkingPoint
from fault_tolerance.tolerances import FARTHEST


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A parallel (or serial) manipulator at home.

    Attributes
    ----------
    name : str
    task : Task
    struts : tuple of Strut
        Empty where the mechanism is given by its Jacobian only.
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
    stiffness : float
        Of every drive that does not say otherwise, N/m, and N/m times the square of the
        characteristic length for those that turn; NaN: not known.
    groups : mapping of str to tuple of str
        Actuators and struts that fail together by a common cause, an amplifier that carries two of
        them for example, by the name of the group.
    park : mapping of str to float
        Task coordinates, rad and m from home, where the platform may stand that cannot do its task
        any more; empty: where it is.
    flexure_stiffness : float
        Of the directions that the joints of a strut bar, N/m, and N/m times the square of the
        characteristic length about an axis; NaN: not known, and taken for rigid.
    """

    name: str
    task: Task
    struts: tuple[Strut, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    origin: FloatArray = field(default_factory=lambda: np.zeros(3))
    characteristic_length: float = 1.0
    compliance: float = 0.0
    working_point: WorkingPoint | None = None
    stiffness: float = nan
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    park: Mapping[str, float] = field(default_factory=dict)
    flexure_stiffness: float = nan

    def __repr__(self) -> str:
        struts, actuators = len(self.struts), len(self.actuators)
        return f'Mechanism({self.name!r}, {struts} struts, {actuators} actuators)'

    def __post_init__(self) -> None:
        """Check that the parts fit together."""
        object.__setattr__(self, 'origin', frozen_array(self.origin, (3,), 'platform.origin'))
        if not (isfinite(self.characteristic_length) and self.characteristic_length > 0.0):
            reason = f'{self.characteristic_length} is not a positive length'
            raise MechanismError(self.name, 'characteristic_length', reason)
        if not (isfinite(self.compliance) and 0.0 <= self.compliance < 1.0):
            reason = f'{self.compliance} is not in [0, 1)'
            raise MechanismError(self.name, 'compliance', reason)
        for key in ('stiffness', 'flexure_stiffness'):
            value = getattr(self, key)
            if not (isnan(value) or 0.0 < value < inf):
                raise MechanismError(self.name, key, f'{value} is not positive')
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
        self._check_groups()
        self._check_park()

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
        return frozen_array(limits, (None, 2), 'limits', finite=False)

    @cached_property
    def velocity_limits(self) -> FloatArray:
        """Largest speeds, (N,)."""
        limits = [actuator.velocity for actuator in self.actuators]
        return frozen_array(limits, (None,), 'limits', finite=False)

    @cached_property
    def rate_scale(self) -> FloatArray:
        """What turns joint rates into metres per second, (N,): lengths for turning drives."""
        length = self.characteristic_length
        scale = [length if one.kind == 'revolute' else 1.0 for one in self.actuators]
        return frozen_array(scale, (None,), 'scale')

    @cached_property
    def drive_stiffness(self) -> FloatArray:
        """Stiffness of the drives' hold, (N,), N/m or N m/rad; NaN where it is not known."""
        given = np.array([actuator.stiffness for actuator in self.actuators])
        shared = self.stiffness * self.rate_scale**2
        return frozen_array(np.where(np.isnan(given), shared, given), (None,), 'k', finite=False)

    @cached_property
    def has_uniform_rate_scale(self) -> bool:
        """Whether all drives turn, or all slide: one factor turns rates into m/s."""
        return len(set(self.rate_scale.tolist())) == 1

    def with_encoders(self, side: EncoderSide) -> Mechanism:
        """Return the same mechanism with the encoders of all actuators on one ``side``."""
        return self.with_actuators(replace(one, encoder=side) for one in self.actuators)

    def with_actuators(self, actuators: Iterable[Actuator]) -> Mechanism:
        """Return the same mechanism with other ``actuators`` in the place of those so named."""
        changed = {one.name: one for one in actuators}

        def joint(one: Joint) -> Joint:
            return one if one.actuator is None else replace(
                one, actuator=changed[one.actuator.name]
            )

        struts = tuple(
            replace(one, joints=tuple(map(joint, one.joints))) for one in self.struts
        )
        return replace(self, struts=struts, actuators=tuple(changed.values()))

    def actuator_index(self, name: str) -> int:
        """Return the place of the actuator ``name``; ValueError if there is none."""
        return self.actuator_names.index(name)

    def actuators_of(self, strut: str) -> tuple[str, ...]:
        """Return the names of the actuators in ``strut``, in the mechanism's order."""
        return tuple(actuator.name for actuator in self.actuators if actuator.strut == strut)

    def strut_of(self, actuator: str) -> str:
        """Return the name of the strut ``actuator`` is in; empty if given by its Jacobian."""
        return self.actuators[self.actuator_index(actuator)].strut

    def values_from_readings(self, readings: FloatArray) -> FloatArray:
        """Return joint values (N,) from the encoders' ``readings`` (N,)."""
        return self._signs * (np.asarray(readings) - self._homes)

    def readings_from_values(self, values: FloatArray) -> FloatArray:
        """Return what the encoders read (N,) at the joint ``values`` (N,)."""
        return self._signs * np.asarray(values) + self._homes

    def rates_from_readings(self, rates: FloatArray) -> FloatArray:
        """Return joint rates (N,) from encoder ``rates`` (N,); its own inverse."""
        return self._signs * np.asarray(rates)

    @cached_property
    def _signs(self) -> FloatArray:
        return frozen_array([actuator.sign for actuator in self.actuators], (None,), 'sign')

    @cached_property
    def _homes(self) -> FloatArray:
        return frozen_array([actuator.home for actuator in self.actuators], (None,), 'home')

    def _check_names(self) -> None:
        names = [('struts', strut.name) for strut in self.struts]
        for strut in self.struts:
            if not strut.joints:
                raise MechanismError(self.name, f'struts.{strut.name}', 'has no joint')
            names += [(f'struts.{strut.name}.joints', joint.name) for joint in strut.joints]
        for name in (*(name for _, name in names), *self.actuator_names):
            _require_usable(self.name, name)
        # A joint and the actuator that drives it may share a name: they are one thing.
        names += [('actuators', one.name) for one in self.actuators if one.name != one.joint]
        check_names(self.name, names)
        check_names(self.name, [('joint_state_name', name) for name in self.joint_state_names])

    def _check_actuators(self) -> None:
        found = {actuator.name for strut in self.struts for actuator in strut.actuators}
        listed = set(self.actuator_names)
        for name in sorted(listed - found):
            raise MechanismError(self.name, 'actuators', f'{name!r} is not an actuated joint')
        for name in sorted(found - listed):
            raise MechanismError(self.name, 'actuators', f'{name!r} is missing')

    def _check_groups(self) -> None:
        parts = (*self.actuator_names, *self.strut_names)
        for name, members in self.groups.items():
            _require_usable(self.name, name)
            if name in parts:
                raise MechanismError(self.name, f'groups.{name}', 'is an actuator or a strut')
            if not members:
                raise MechanismError(self.name, f'groups.{name}', 'is empty')
            for one in members:
                if one not in parts:
                    reason = f'{one!r} is not an actuator or a strut'
                    raise MechanismError(self.name, f'groups.{name}', reason)

    def _check_park(self) -> None:
        if self.park and self.working_point is not None:
            raise MechanismError(self.name, 'park', 'a mechanism without struts has no pose')
        for name, value in self.park.items():
            if name not in self.task.coordinates:
                valid = ', '.join(self.task.coordinates)
                reason = f'{name!r} is not a task coordinate; valid: {valid}'
                raise MechanismError(self.name, 'park', reason)
            if not abs(value) <= FARTHEST:
                reason = f'{value} is not within {FARTHEST:g} from home'
                raise MechanismError(self.name, f'park.{name}', reason)
        angle = hypot(*(value for name, value in self.park.items() if name.startswith('w')))
        if angle > pi:
            reason = f'turns by {angle:.4g} rad, more than half round'
            raise MechanismError(self.name, 'park', reason)

    def _check_working_point(self, point: WorkingPoint) -> None:
        for key, rows, expected, what in (
            ('jacobian', len(point.jacobian), len(self.task.coordinates), 'task coordinates'),
            ('mapping', len(point.mapping), len(self.actuators), 'actuators'),
        ):
            if rows != expected:
                reason = f'has {rows} rows, but there are {expected} {what}'
                raise MechanismError(self.name, key, reason)


_SEPARATORS = '/:=,;'
_RESERVED = ('all', 'silent', *mode_words(), *MISBEHAVIOURS)


def _require_usable(source: str, name: str) -> None:
    """Refuse names that reports, the command line or fault commands would misread."""
    if any(mark in _SEPARATORS or mark.isspace() for mark in name):
        reason = f'the name {name!r} must not contain a blank or any of {_SEPARATORS}'
        raise MechanismError(source, 'name', reason)
    if name.lower() in _RESERVED:
        raise MechanismError(source, 'name', f'the name {name!r} is a word for faults')


def check_names(source: str, names: Iterable[tuple[str, str]]) -> None:
    """Raise `MechanismError` of ``source`` if one of ``names``, (key, name), is empty or taken."""
    seen: set[str] = set()
    for key, name in names:
        if not name:
            raise MechanismError(source, key, 'an empty name')
        if name in seen:
            raise MechanismError(source, key, f'the name {name!r} stands for two things')
        seen.add(name)
