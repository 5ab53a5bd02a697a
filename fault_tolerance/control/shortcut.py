# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The shortest way from joint values to a command, where nothing is out of the ordinary.

The compiled path does in one call what a command needs, provided that it is made as the one
before was: with the same failures, the same freedoms, far from singularities and limits. It makes
sure of that itself, and declines otherwise. What else there is to know of the new configuration
is made of its results when it is asked for (`Taken.followed`); nothing but the order of things
differs from the long way (`fault_tolerance.control.situation.Situation.assess`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any, NamedTuple

import numpy as np

from fault_tolerance.compiled.activation import Active
from fault_tolerance.control.assessment import Assessment, Fit, Prospect
from fault_tolerance.control.command import LEAVING, CommandLaw
from fault_tolerance.control.limits import LimitedRate, constant_limits
from fault_tolerance.control.resolved_rate import ResolvedRate, TaskInverse
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.transition import Begun
from fault_tolerance.kinematics.differential import failed_parts, kinematics_from
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure, sound_verdict
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.configuration import configuration_from
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.following import closed_from, constant_part, way_on
from fault_tolerance.mechanism.steps import Closed, Steps
from fault_tolerance.mechanism.tracking import FARTHEST, LAST_STEP

_NUMBER = np.dtype(np.float64)
# What a command gives, in the order in which it is written: the command itself, what
# `fault_tolerance.compiled.resolving` and `following` return, and three numbers.
_COMMANDED = 'rates', 'twist', 'major_part', 'secondary_part', 'major', 'secondary'
_RESOLVED = (
    'jacobian', 'mapping', 'twist_jacobian', 'rate_map', 'left', 'transmissions', 'right',
)
_FOLLOWED = (
    'pose', 'joint_values', 'reached', 'openings', 'joints', 'structure', 'drives',
    'structure_left', 'structure_sigma', 'structure_right', 'twists', 'free', 'turned', 'gains',
    'mixed', 'closing', 'fit',
)
# What the next configuration starts from, in the order of `fault_tolerance.compiled.commanding`.
_WAY_ON = (
    'pose', 'joint_values', 'openings', 'joints', 'structure', 'closing', 'drives', 'fit',
)


@dataclass(frozen=True, eq=False)
class Followed:
    """What came of a command by the shortcut, once it is out.

    Attributes
    ----------
    prospect : Prospect
    inverse : TaskInverse
    limited : LimitedRate
        What the command was made of.
    looseness : float, optional
        See `CommandLaw`.
    exact : bool
        Whether the prospect is of the present joint values.
    begun : Begun, optional
        How a transition began with it.
    """

    prospect: Prospect
    inverse: TaskInverse
    limited: LimitedRate
    looseness: float | None = None
    exact: bool = True
    begun: Begun | None = None


@dataclass(frozen=True, eq=False)
class _Place:
    """The arrays that one command gives, as parts of a single one."""

    parts: dict[str, tuple[tuple[int, ...], int]]
    size: int

    @classmethod
    def of(cls, shapes: tuple[tuple[int, ...], ...]) -> _Place:
        """Return room for arrays of these shapes, one after the other."""
        parts, end = {}, 0
        names = (*_COMMANDED, *_RESOLVED, *_FOLLOWED, 'sizes')
        for name, shape in zip(names, shapes, strict=True):
            parts[name] = shape, _NUMBER.itemsize * end
            end += prod(shape)
        return cls(parts, end)

    def arrays(self, values: FloatArray) -> dict[str, FloatArray]:
        """Return the parts of ``values``."""
        return {
            name: np.ndarray(shape, _NUMBER, values, offset)
            for name, (shape, offset) in self.parts.items()
        }

    def one(self, values: FloatArray, name: str) -> FloatArray:
        """Return one part of ``values``."""
        shape, offset = self.parts[name]
        return np.ndarray(shape, _NUMBER, values, offset)


@dataclass(frozen=True, eq=False)
class _Constants:
    """What stays while the failures and the way to take do."""

    key: tuple[Any, ...]
    arguments: tuple[Any, ...]
    place: _Place
    mechanism: Mechanism
    failures: FailureSet
    base: Closed
    filling: FloatArray
    threshold: float
    unit: float


class _Ready(NamedTuple):
    """Everything but the inputs of the next command."""

    constants: _Constants
    arguments: tuple[Any, ...]


class Taken:
    """A command by the shortcut, and what else there is to know when it is asked for.

    Parameters
    ----------
    constants : _Constants
    values : (N,) array
        The joint values it was made for.
    velocity : (l,) array
        What was asked for.
    steps, driven : int
        See `fault_tolerance.compiled.commanding.command`.
    out : array
        What that has written.

    Attributes
    ----------
    rates : (N,) array
    twist : (6,) array
    """

    def __init__(
        self,
        constants: _Constants,
        values: FloatArray,
        velocity: FloatArray,
        steps: int,
        driven: int,
        out: FloatArray,
    ) -> None:
        self._constants = constants
        self._values = values
        self._velocity = velocity
        self._steps = steps
        self._driven = driven
        self._out = out
        count = len(values)
        self.rates: FloatArray = out[:count]
        self.twist: FloatArray = out[count : count + 6]

    @property
    def failures(self) -> FailureSet:
        """The failures present."""
        return self._constants.failures

    @property
    def actuator_values(self) -> FloatArray:
        """Joint values of the actuators that close the loops, (N,)."""
        return self.part('reached')

    def part(self, name: str) -> FloatArray:
        """Return one of the arrays found: ``pose``, ``drives``, ``jacobian``, ``mapping``, ..."""
        return self._constants.place.one(self._out, name)

    @property
    def residual(self) -> FloatArray:
        """What was asked for less what is achieved, (l,)."""
        return frozen(self._velocity - self.twist.take(self._constants.mechanism.task.rows))

    @property
    def way_on(self) -> _Ready:
        """What the next command needs."""
        constants = self._constants
        return _Ready(constants, (*constants.arguments, *map(self.part, _WAY_ON)))

    def assessed(self) -> Assessment:
        """Return what the long way would have found."""
        assessment = self.followed.prospect.assessment
        assert assessment is not None
        return assessment

    @cached_property
    def followed(self) -> Followed:
        """All that was found on the way."""
        constants, values = self._constants, self._values
        mechanism, failures = constants.mechanism, constants.failures
        found = constants.place.arrays(self._out)
        outside, along, looseness = found['sizes'].tolist()
        before = constants.base
        closed = closed_from(
            before.state, before.attachment, before.kept, self._steps,
            [found[name] for name in _FOLLOWED], (outside, along),
        )
        configuration = configuration_from(mechanism, closed, values, complete=True)
        rows = strut_rows(configuration)
        kinematics = kinematics_from(
            rows,
            failed_parts(mechanism, failures),
            closed.kept,
            tuple(found[name] for name in _RESOLVED),
        )
        post = PostFailure(rows, failures, kinematics)
        if not failures:
            # Otherwise the shortcut would not have been taken.
            post.__dict__['verdict'] = sound_verdict(kinematics.mobility)
        fit = Fit((values.tobytes(), failures.lost), configuration, rows)
        assessment = Assessment(configuration, post, constants.threshold)
        transmission = float(found['transmissions'][-1]) / constants.unit
        inverse = TaskInverse(
            kinematics, found['major'], found['secondary'], self._driven, transmission
        )
        resolved = ResolvedRate(
            kinematics, self._velocity, found['major_part'], found['secondary_part'],
            self._driven, transmission,
        )
        resolved.__dict__.update(rates=self.rates, twist=self.twist)
        return Followed(
            Prospect(fit, assessment), inverse, LimitedRate(resolved, 1.0, 1.0, ()), looseness
        )


class Shortcut:
    """Computes commands the shortest way, where there is one.

    Parameters
    ----------
    mechanism : Mechanism
    settings : Settings
    law : CommandLaw
    yielding : float
        What the flexures absorb while loops are closed.
    """

    def __init__(
        self, mechanism: Mechanism, settings: Settings, law: CommandLaw, yielding: float
    ) -> None:
        self._mechanism = mechanism
        self._settings = settings
        self._law = law
        self._yielding = yielding
        self._constants: _Constants | None = None
        self._ready: _Ready | None = None

    def prepare(self, assessment: Assessment) -> None:
        """Make ready for the next command, after one at ``assessment`` that moved."""
        self._ready = None
        post, closed = assessment.post, assessment.configuration.closed
        if Active.kernels is None or closed is None or not self._mechanism.rates_alike:
            return
        if (
            not closed.attachment.complete
            or post.rows.compliance != self._mechanism.compliance
            or not post.present.stable
        ):
            return
        steps = closed.state.steps.get((closed.attachment.lost, closed.kept))
        if steps is None:
            return
        constants = self._constants_at(post, closed, steps)
        self._ready = _Ready(constants, (*constants.arguments, *way_on(closed.state, steps)))

    def go_on(self, taken: Taken) -> None:
        """Make ready for the next command, after one by the shortcut."""
        self._ready = taken.way_on

    def forget(self) -> None:
        """Take the long way next: something is out of the ordinary."""
        self._ready = None

    def command(
        self, values: FloatArray, velocity: FloatArray, failures: FailureSet
    ) -> Taken | None:
        """Return the command for joint values (N,) and a task velocity (l,).

        None where the long way is to be taken.
        """
        ready, kernels = self._ready, Active.kernels
        self._ready = None
        if ready is None or kernels is None or failures != ready.constants.failures:
            return None
        out = np.empty(ready.constants.place.size)
        steps, driven = kernels.command(*ready.arguments, values, velocity, out)
        if not steps:
            return None
        return Taken(ready.constants, values, velocity, steps, driven, frozen(out))

    def _constants_at(self, post: PostFailure, closed: Closed, steps: Steps) -> _Constants:
        """Return the constant arguments and the room for the results."""
        mobility, regular = post.present.mobility, closed.state.regular
        assert regular is not None
        key = post.failures, id(regular), closed.kept, mobility
        known = self._constants
        if known is not None and known.key == key and known.filling is regular.filling:
            return known
        mechanism, law, settings = self._mechanism, self._law, self._settings
        task, rows, length = mechanism.task, post.rows, mechanism.characteristic_length
        part = constant_part(closed.state.chains, closed.attachment)
        failed = failed_parts(mechanism, post.failures)
        least = max(settings.slow_below, LEAVING * settings.hold_below)
        arguments = (
            *part.of_struts(regular, settings.misfit_limit * length),
            *part.of_attachment,
            self._yielding, LAST_STEP * length, FARTHEST * length, mechanism.compliance,
            rows.twist_scale, rows.task_rows, task.major_rows, task.secondary_rows,
            *law.resolver.constants,
            *constant_limits(mechanism), settings.stroke_gain,
            failed.stuck, failed.driving, failed.all_drive,
            law.yardstick, law.tight, least,
            closed.kept, mobility,
        )
        drives, task_size = len(mechanism.actuators), len(task.coordinates)
        struts, joints = closed.state.joint_values.shape
        structure = closed.state.constraints.structure_of(closed.attachment)
        gaps, kept, major = len(steps.struts), closed.kept, len(task.major_rows)
        width, rank = 6 - kept, len(structure.sigma)
        gains = min(drives, width)
        place = _Place.of((
            (drives,), (6,), (mobility,), (mobility,),
            (mobility, task_size), (mobility, task_size),
            (task_size, mobility), (drives, mobility), (6, mobility), (drives, mobility),
            (major, min(major, mobility)), (min(major, mobility),), (mobility, mobility),
            (4, 4), (struts, joints), (drives,), (struts, 6), (struts, joints, 6), (gaps, 6),
            (drives, 6),
            (gaps, rank), (rank,), (6, 6),
            (6, width), (drives, width), (drives, gains), (gains,), (width, width),
            (6, gaps), (6, drives), (3,),
        ))
        self._constants = _Constants(
            key, arguments, place, mechanism, post.failures, closed, regular.filling,
            settings.tolerance_threshold, float(rows.rate_scale[0]),
        )
        return self._constants
