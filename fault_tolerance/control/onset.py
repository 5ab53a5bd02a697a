# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The first command after a failure that had been anticipated, the shortest way.

All that does not depend on the motion at that moment is made ready with the entry of the table;
the compiled path does the rest in one call, or declines. What there is to know of the new
kinematics is put in its place after the command has gone out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fault_tolerance.compiled.activation import Active
from fault_tolerance.control.assessment import Assessment
from fault_tolerance.control.command import LEAVING, CommandLaw
from fault_tolerance.control.limits import LimitedRate, constant_limits
from fault_tolerance.control.recovery import Decision, State
from fault_tolerance.control.resolved_rate import (
    SINGULAR_BELOW,
    ResolvedRate,
    TaskInverse,
    twist_map,
)
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.transition import Begun, Jump, Sent
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.description import Mechanism


class Room(NamedTuple):
    """Where the compiled path writes one command, and views of it that are given out.

    Attributes
    ----------
    out : array
    rates, twist : (N,), (6,) array
        Not to be written to.
    """

    out: FloatArray
    rates: FloatArray
    twist: FloatArray

    @classmethod
    def of(cls, size: int, drives: int) -> Room:
        """Return room for ``size`` numbers."""
        out = np.zeros(size)
        return cls(out, frozen(out[:drives]), frozen(out[drives : drives + 6]))


@dataclass(frozen=True, eq=False)
class Readied:
    """What the first command with some failures needs, but for the motion at that moment.

    Attributes
    ----------
    inverse : TaskInverse
    decision : Decision
        On the state that begins with it.
    prepared : array
        See `fault_tolerance.compiled.beginning.begin`.
    mobility : int
        Number n of reduced rates.
    size : int
        How many numbers that function writes.
    rooms : list of Room
        Room for one command: to make an array takes as long as to work out what is in it.
    """

    inverse: TaskInverse
    decision: Decision
    prepared: FloatArray
    mobility: int
    size: int
    rooms: list[Room]


class Onset:
    """Computes first commands.

    Parameters
    ----------
    mechanism : Mechanism
    settings : Settings
    law : CommandLaw
    """

    def __init__(self, mechanism: Mechanism, settings: Settings, law: CommandLaw) -> None:
        self._law = law
        self._least = max(settings.slow_below, LEAVING * settings.hold_below)
        self._most_misfit = settings.misfit_limit * mechanism.characteristic_length
        speeds, ends = constant_limits(mechanism)
        self._limits = np.concatenate([speeds, ends.ravel()])
        self._stroke_gain = settings.stroke_gain

    def readied(self, assessment: Assessment, inverse: TaskInverse) -> Readied | None:
        """Return what can be made ready; None where the long way is to be taken."""
        unit, kinematics = self._law.unit, inverse.kinematics
        if Active.kernels is None or unit is None or not kinematics.stable:
            return None
        if not min(self._law.margins(inverse)) >= self._least:
            return None
        if not assessment.configuration.largest_misfit <= self._most_misfit:
            return None
        constants = np.array([unit, self._stroke_gain])
        parts = (constants, self._limits, *self._matrices(inverse, unit))
        prepared = np.concatenate([part.ravel() for part in parts])
        decision = Decision(State.DEGRADED, assessment.post.verdict.reason)
        drives, mobility = kinematics.mapping.shape
        size = 3 * (drives + 6) + 2 * len(kinematics.major) + 4 * mobility + 2
        return Readied(inverse, decision, prepared, mobility, size, [Room.of(size, drives)])

    def _matrices(self, inverse: TaskInverse, unit: float) -> tuple[FloatArray, ...]:
        """Return the matrices that a command is made by.

        See `fault_tolerance.compiled.beginning.begin`, and
        `fault_tolerance.control.transition.Transition` for the definitions.
        """
        kinematics = inverse.kinematics
        mapping = kinematics.mapping
        weights = self._law.resolver.constants[0][kinematics.task.major_rows]
        weighted = weights[:, None] * kinematics.major
        left, sigma, right = kinematics.decomposed_major(weights)
        driven = int((sigma / unit > SINGULAR_BELOW).sum())
        right = right[:driven]
        # From the nearest to the last command, the major task moving as it moved.
        correcting = (right.T / sigma[:driven]).dot(left[:, :driven].T)
        return (
            inverse.major,
            inverse.secondary,
            mapping.T - correcting.dot(weighted).dot(mapping.T),
            correcting,
            right.T.dot(right),
            kinematics.rate_map,
            twist_map(kinematics),
            weighted,
        )

    def command(
        self,
        readied: Readied,
        values: FloatArray,
        velocity: FloatArray,
        sent: Sent,
        allowed: float,
    ) -> FirstCommand | None:
        """Return the first command; None where the long way is to be taken.

        Parameters
        ----------
        readied : Readied
        values : (N,) array
            Joint values, NaN in lost struts.
        velocity : (l,) array
        sent : Sent
            The command before.
        allowed : float
            By how much the drives' speed may differ from its, m/s.
        """
        kernels = Active.kernels
        if kernels is None:
            return None
        rooms = readied.rooms
        room = rooms.pop() if rooms else Room.of(readied.size, len(values))
        kind = kernels.begin(
            readied.prepared, readied.mobility, values, velocity, sent.rates, sent.major,
            allowed, room.out,
        )
        return FirstCommand(room, readied, velocity, kind == 2) if kind else None


class FirstCommand(NamedTuple):
    """A first command.

    Attributes
    ----------
    room : Room
        The rates of all actuators, the platform's twist, and what else the compiled path has
        written.
    readied : Readied
        What it was made of.
    velocity : (l,) array
        What was asked for.
    under_way : bool
        Whether more are to follow until it is what it is to be.
    """

    room: Room
    readied: Readied
    velocity: FloatArray
    under_way: bool

    def limited(self) -> LimitedRate:
        """Return what the command is made of."""
        inverse, mobility = self.readied.inverse, self.readied.mobility
        out, rates, twist = self.room
        begin = len(rates) + len(twist)
        major, secondary = np.split(frozen(out[begin : begin + 2 * mobility]), 2)
        resolved = ResolvedRate(
            inverse.kinematics, self.velocity, major, secondary, inverse.rank,
            inverse.transmission,
        )
        resolved.__dict__.update(rates=rates, twist=twist)
        return LimitedRate(resolved, 1.0, 1.0, ())

    def begun(self) -> Begun:
        """Return how it begins."""
        mobility = self.readied.mobility
        out, rates, twist = self.room
        begin = len(rates) + len(twist) + 2 * mobility
        jump = Jump(*out[begin : begin + 2].tolist())
        return Begun(mobility, self.under_way, jump)
