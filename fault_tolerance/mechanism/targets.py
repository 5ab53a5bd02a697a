# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What loop closure is to meet besides closed loops: actuator values, or a platform pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite, pi
from typing import NamedTuple, Protocol

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.evaluation import State
from fault_tolerance.mechanism.screws import difference, rotation_vector_rates
from fault_tolerance.mechanism.task import COORDINATES
from fault_tolerance.tolerances import FARTHEST


class Level(NamedTuple):
    """One level of a lexicographic least-squares problem, ``matrix @ x = wanted``."""

    matrix: FloatArray
    """(r, c)"""
    wanted: FloatArray
    """(r,)"""
    size: float
    """What its singular values are compared with in decisions on rank."""


@dataclass(frozen=True, eq=False)
class Step:
    """A Gauss-Newton step as far as the structure determines it, and the freedom it leaves."""

    state: State
    held: BoolArray
    """(N,): the actuators in struts that hold the platform."""
    twist: FloatArray
    """(6,): scaled platform twist that closes the loops."""
    rates: FloatArray
    """(N,): actuator rates that go with it."""
    twists: FloatArray
    along: FloatArray
    """(6, c) and (N, c): scaled platform twists and actuator rates of the motions left free."""


class Target(Protocol):
    """What a Gauss-Newton step is to meet, in order of priority."""

    def levels(self, step: Step) -> tuple[Level, ...]:
        """Return the levels that the free motions of ``step`` have to meet."""

    def at(self, share: float) -> Target:
        """Return the target at a ``share`` of the way from home."""


@dataclass(frozen=True, eq=False)
class ActuatorTarget:
    """Actuator values to be met, and what the other actuators do."""

    values: FloatArray
    """(N,): joint values from home, NaN where there is none."""
    nearest_home: bool
    """Whether the other actuators go as near to home as they can, or else stay where they are."""

    def levels(self, step: Step) -> tuple[Level, ...]:
        """Return the levels of ``step``: the values given, then those left out."""
        read = np.isfinite(self.values) & step.held
        first = _actuator_level(step, read, self.values)
        if not self.nearest_home:
            return (first,)
        return first, _actuator_level(step, step.held & ~read, np.zeros(len(read)))

    def at(self, share: float) -> ActuatorTarget:
        """Return the target at a ``share`` of the way from home."""
        return replace(self, values=share * self.values)


@dataclass(frozen=True, eq=False)
class PoseTarget:
    """Coordinates of the platform's displacement from home to be met.

    Coordinates left out are as near to home as the loops allow, then the actuator values.
    """

    home: FloatArray
    """(4, 4): the pose at home."""
    scale: FloatArray
    """(6,): turns displacements into metres."""
    values: FloatArray
    """(6,): rotation vector and displacement of the platform's origin, base axes."""
    given: tuple[int, ...]
    left_out: tuple[int, ...]
    """Rows of the displacement: those given, and the other ones of the task."""

    def levels(self, step: Step) -> tuple[Level, ...]:
        """Return the levels of ``step``: coordinates given, those left out, actuator values."""
        displacement = difference(step.state.pose, self.home)
        rates = np.eye(6)
        rates[:3, :3] = rotation_vector_rates(displacement[:3])
        rates = self.scale[:, None] * rates / self.scale
        rest = self.scale * (self.values - displacement) - rates @ step.twist
        coordinates = rates @ step.twists
        given, left_out = list(self.given), list(self.left_out)
        return (
            # Motions are unit vectors: 1 is their size.
            Level(coordinates[given], rest[given], 1.0),
            Level(coordinates[left_out], rest[left_out], 1.0),
            _actuator_level(step, step.held, np.zeros(len(step.held))),
        )

    def at(self, share: float) -> PoseTarget:
        """Return the target at a ``share`` of the way from home."""
        return replace(self, values=share * self.values)

    def misfit(self, pose: FloatArray) -> float:
        """Return the largest error of a coordinate given at ``pose`` (4, 4), in metres."""
        error = self.scale * (self.values - difference(pose, self.home))
        return float(np.abs(error[list(self.given)]).max(initial=0.0))


def actuator_target(mechanism: Mechanism, given: Mapping[str, float]) -> ActuatorTarget:
    """Return the target that actuators of ``mechanism`` are at ``given``, the others near home.

    MechanismError for a name that is no actuator, or a value that no joint can have.
    """
    values = np.full(len(mechanism.actuators), np.nan)
    for name, value in given.items():
        if name not in mechanism.actuator_names:
            valid = ', '.join(mechanism.actuator_names)
            reason = f'{name!r} is not an actuator; valid: {valid}'
            raise MechanismError(mechanism.name, 'at', reason)
        _require_usual(mechanism, f'at.{name}', value)
        values[mechanism.actuator_index(name)] = value
    return ActuatorTarget(values, nearest_home=True)


def pose_target(mechanism: Mechanism, given: Mapping[str, float]) -> PoseTarget:
    """Return the target that task coordinates of ``mechanism`` are at ``given``.

    MechanismError for a name that is no task coordinate, or a displacement that cannot be.
    """
    values, names = np.zeros(len(COORDINATES)), mechanism.task.coordinates
    for name, value in given.items():
        if name not in names:
            reason = f'{name!r} is not a task coordinate; valid: {", ".join(names)}'
            raise MechanismError(mechanism.name, 'pose', reason)
        _require_usual(mechanism, f'pose.{name}', value)
        values[COORDINATES.index(name)] = value
    angle = float(np.linalg.norm(values[:3]))
    if angle > pi:
        reason = f'a rotation by {angle:.4g} rad; a rotation vector is at most pi long'
        raise MechanismError(mechanism.name, 'pose', reason)
    rows = tuple(COORDINATES.index(name) for name in names if name in given)
    others = tuple(COORDINATES.index(name) for name in names if name not in given)
    chains = chains_of(mechanism)
    return PoseTarget(chains.home, chains.scale, values, rows, others)


def _require_usual(mechanism: Mechanism, key: str, value: float) -> None:
    if not isfinite(value):
        raise MechanismError(mechanism.name, key, f'{value} is not finite')
    if abs(value) > FARTHEST:
        reason = f'{value} is farther than any joint goes ({FARTHEST:g})'
        raise MechanismError(mechanism.name, key, reason)


def _actuator_level(step: Step, chosen: BoolArray, values: FloatArray) -> Level:
    """Return the level on which the ``chosen`` (N,) actuators are at ``values`` (N,)."""
    matrix, rest = step.along[chosen], values - step.state.actuator_values - step.rates
    return Level(matrix, rest[chosen], float(np.linalg.norm(matrix)))
