# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From a task velocity to a command: resolved, slowed near singularities, kept within limits."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, sqrt

import numpy as np

from fault_tolerance.control.limits import (
    LimitedRate,
    kept_within_limits,
    singularity_scale,
)
from fault_tolerance.control.resolved_rate import (
    RateResolver,
    ResolvedRate,
    TaskInverse,
    common,
)
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.transition import Transition
from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    differential_kinematics,
)
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.linear_algebra import length

LEAVING = 2.0
"""How far above the margin at which it holds the mechanism must be before it moves again."""


def _whole(target: LimitedRate, _: Callable[[ResolvedRate], LimitedRate]) -> LimitedRate:
    return target


class CommandLaw:
    """Turns task velocities into commands.

    Parameters
    ----------
    mechanism : Mechanism
    settings : Settings

    Attributes
    ----------
    slowed : bool
        Whether the last command was slowed down for being near a singularity.
    resolver : RateResolver
    unit : float or None
        Metres per second per unit of every drive, if it is the same for all.
    yardstick, tight : float
        The smallest transmission, and the looseness, at home: what margins are measured by.
    """

    def __init__(self, mechanism: Mechanism, settings: Settings) -> None:
        self._mechanism = mechanism
        self._settings = settings
        self._twist_scale, self._rate_scale = _scales(mechanism)
        self.resolver = RateResolver(
            mechanism.task, twist_scale=self._twist_scale, rate_scale=self._rate_scale
        )
        self.unit = common(self._rate_scale)
        self._inverse: TaskInverse | None = None
        self._loose: tuple[DifferentialKinematics, float] | None = None
        self._near_singular = False
        self.slowed = False
        # What is near is judged against home, where the mechanism is made to work; a home that
        # is singular itself, as of a stretched arm, is no yardstick.
        rows = home_rows(mechanism)
        self._weights = rows.twist_scale[:, None]
        home = differential_kinematics(rows)
        resting = np.zeros(len(mechanism.task.coordinates))
        at_home = self.resolved(home, resting).transmission
        self.yardstick = at_home if at_home > settings.slow_below else 1.0
        loose_at_home = self._looseness(home)
        self.tight = loose_at_home if loose_at_home * settings.slow_below < 1.0 else 1.0

    def resolved(self, kinematics: DifferentialKinematics, velocity: FloatArray) -> ResolvedRate:
        """Return the rates for a task velocity (l,), not limited yet."""
        return self.inverse(kinematics).resolved(velocity)

    def inverse(self, kinematics: DifferentialKinematics) -> TaskInverse:
        """Return what resolves task velocities with ``kinematics``."""
        if self._inverse is None or self._inverse.kinematics is not kinematics:
            self.adopt(self.foreseen(kinematics))
        assert self._inverse is not None
        return self._inverse

    def foreseen(self, kinematics: DifferentialKinematics) -> TaskInverse:
        """Return what `inverse` would, and remember nothing of it."""
        return self.resolver.inverse(kinematics)

    def adopt(self, inverse: TaskInverse, looseness: float | None = None) -> None:
        """Use ``inverse`` when its kinematics are those to go by, and what else is known."""
        self._inverse = inverse
        if looseness is not None:
            self._loose = inverse.kinematics, looseness

    @property
    def at_ease(self) -> bool:
        """Whether the last command was far from singularities."""
        return not (self.slowed or self._near_singular)

    def obstacle(self, resolved: ResolvedRate) -> str:
        """Return why the mechanism is too near a singularity to move; empty if it is not."""
        moved, held = self.margins(resolved)
        limit = self._settings.hold_below * (LEAVING if self._near_singular else 1.0)
        self._near_singular = min(moved, held) <= limit
        if not self._near_singular:
            return ''
        kind = 'of the major task' if moved <= limit else 'where the drives hardly hold it'
        return f'near a singularity {kind} (margin below {limit:.2g})'

    def transition(self) -> Transition:
        """Return what eases its commands in."""
        return Transition(
            self._mechanism.task,
            self._twist_scale,
            self._rate_scale,
            self._settings.max_acceleration,
        )

    def limited(
        self,
        resolved: ResolvedRate,
        values: FloatArray,
        ease: Callable[[LimitedRate, Callable[[ResolvedRate], LimitedRate]], LimitedRate] = _whole,
    ) -> LimitedRate:
        """Return the command at the joint values (N,), NaN where there are none.

        Parameters
        ----------
        resolved : ResolvedRate
        values : (N,) array
        ease : callable, optional
            Gives the command on the way to the one within all limits; is told how commands are
            brought within them.

        Raises
        ------
        ArithmeticError
            If it is not finite.
        """
        settings = self._settings
        margin = min(self.margins(resolved))
        slowing = singularity_scale(margin, settings.hold_below, settings.slow_below)
        self.slowed = slowing < 1.0

        def within(way: ResolvedRate, scale: float = 1.0) -> LimitedRate:
            return kept_within_limits(
                way, self._mechanism, values, settings.stroke_gain, scale
            )

        limited = ease(within(resolved, slowing), within)
        command = limited.command
        if not isfinite(float(command.rates.sum()) + sum(command.twist.tolist())):
            raise ArithmeticError('the command is not finite')
        return limited

    def margins(self, resolved: ResolvedRate | TaskInverse) -> tuple[float, float]:
        """Return how far it is from singularities of both kinds: 0 there, about 1 at home.

        Where the drives no longer move the platform, and where they no longer hold it
        (docs/theory.md, eq. 23).
        """
        looseness = self._looseness(resolved.kinematics)
        held = self.tight / looseness if looseness > self.tight else 1.0
        return resolved.transmission / self.yardstick, held

    def _looseness(self, kinematics: DifferentialKinematics) -> float:
        """Return how fast the platform may go at unit speed of the drives, m/s per m/s.

        Without bound on the way to where it moves with every drive at rest. Over all directions
        (the root of the sum of squares), as the platform is to be held in all of them; kept.
        """
        if self._loose is None or self._loose[0] is not kinematics:
            twists = self._weights * kinematics.twist_jacobian
            if self.unit is None:
                drives = self._rate_scale[:, None] * kinematics.mapping
                squares = twists.T * np.linalg.solve(drives.T @ drives, twists.T)
                found = sqrt(float(squares.sum()))
            else:
                found = length(twists) / self.unit
            self._loose = kinematics, found
        return self._loose[1]


def _scales(mechanism: Mechanism) -> tuple[FloatArray, FloatArray]:
    """Return what turns task velocities (l,) and actuator rates (N,) into metres per second."""
    length = mechanism.characteristic_length
    turning = [name.startswith('w') for name in mechanism.task.coordinates]
    revolute = [actuator.kind == 'revolute' for actuator in mechanism.actuators]
    return np.where(turning, length, 1.0), np.where(revolute, length, 1.0)
