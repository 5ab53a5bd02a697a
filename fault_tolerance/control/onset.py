# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The first command after a failure that had been anticipated, the shortest way.

All that does not depend on the motion at that moment is made ready with the entry of the table;
the compiled path does the rest in one call, or declines. What there is to know of the new
kinematics is put in its place after the command has gone out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fault_tolerance.compiled.activation import Active
from fault_tolerance.control.assessment import Assessment
from fault_tolerance.control.command import LEAVING, CommandLaw
from fault_tolerance.control.limits import LimitedRate, constant_limits
from fault_tolerance.control.resolved_rate import SINGULAR_BELOW, ResolvedRate, TaskInverse
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.transition import Begun, Jump, Sent
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism


@dataclass(frozen=True, eq=False)
class Readied:
    """What the first command with some failures needs, but for the motion at that moment.

    Attributes
    ----------
    inverse : TaskInverse
    arguments : tuple
        Of `fault_tolerance.compiled.beginning.begin`, without the last six.
    """

    inverse: TaskInverse
    arguments: tuple[Any, ...]


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
        self._limits = constant_limits(mechanism)
        self._stroke_gain = settings.stroke_gain

    def readied(self, assessment: Assessment, inverse: TaskInverse) -> Readied | None:
        """Return what can be made ready; None where the long way is to be taken."""
        law, kinematics = self._law, inverse.kinematics
        weights, unit, _, _ = law.resolver.constants
        if Active.kernels is None or unit is None or not kinematics.stable:
            return None
        if not min(law.margins(inverse)) >= self._least:
            return None
        if not assessment.configuration.largest_misfit <= self._most_misfit:
            return None
        major = kinematics.task.major_rows
        decomposition = kinematics.decomposed_major(weights[major])
        parts = (
            inverse.major, inverse.secondary,
            kinematics.jacobian, kinematics.mapping, kinematics.twist_jacobian,
            kinematics.rate_map, *decomposition, weights, *self._limits,
        )
        prepared = np.concatenate([part.ravel() for part in parts])
        return Readied(inverse, (
            prepared, major, kinematics.mobility, len(decomposition[1]), unit, SINGULAR_BELOW,
            self._stroke_gain,
        ))

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
        kernels, kinematics = Active.kernels, readied.inverse.kinematics
        if kernels is None:
            return None
        out = np.empty(len(values) + 8 + 2 * kinematics.mobility)
        kind = kernels.begin(
            *readied.arguments, values, velocity, sent.rates, sent.major, allowed, out
        )
        # Before any part of it is taken: what is given out stays as it is.
        out.setflags(write=False)
        return FirstCommand(readied.inverse, velocity, out, kind == 2) if kind else None


class FirstCommand(NamedTuple):
    """A first command.

    Attributes
    ----------
    inverse : TaskInverse
    velocity : (l,) array
        What was asked for.
    out : array
        As the compiled path has written it.
    under_way : bool
        Whether more are to follow until it is what it is to be.
    """

    inverse: TaskInverse
    velocity: FloatArray
    out: FloatArray
    under_way: bool

    @property
    def motion(self) -> tuple[FloatArray, FloatArray]:
        """Rates of all actuators, (N,), and the platform's twist, (6,)."""
        count = len(self.inverse.kinematics.mapping)
        return self.out[:count], self.out[count : count + 6]

    def limited(self) -> LimitedRate:
        """Return what the command is made of."""
        inverse = self.inverse
        mobility = inverse.kinematics.mobility
        begin = len(self.out) - 2 - 2 * mobility
        major = self.out[begin : begin + mobility]
        secondary = self.out[begin + mobility : begin + 2 * mobility]
        resolved = ResolvedRate(
            inverse.kinematics, self.velocity, major, secondary, inverse.rank,
            inverse.transmission,
        )
        rates, twist = self.motion
        resolved.__dict__.update(rates=rates, twist=twist)
        return LimitedRate(resolved, 1.0, 1.0, ())

    def begun(self) -> Begun:
        """Return how it begins."""
        jump = Jump(*self.out[-2:].tolist())
        return Begun(self.inverse.kinematics.mobility, self.under_way, jump)
