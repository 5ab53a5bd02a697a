# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From one way of moving to another without a bump: at a failure, a clearing, a resumption.

The new command begins as near to the last one as the new kinematics allow, with the major task
moving as it moved, and goes to what it should be at a limited acceleration. Only secondary
motion, and a start from rest, then take time; the major task is followed from the first command
on. Outside of transitions nothing is limited: what the operator asks for is what is given.
Motion that is to end ends at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from fault_tolerance.control.limits import LimitedRate
from fault_tolerance.control.resolved_rate import (
    SINGULAR_BELOW,
    ResolvedRate,
    common,
    drive_coordinates,
)
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.linear_algebra import decomposed, length
from fault_tolerance.mechanism.task import Task

ROUNDING = 1e-9
"""Commands that differ by less than this share are the same."""


@dataclass(frozen=True)
class Jump:
    """By how much the first command of a transition differs from the one before, m/s.

    Attributes
    ----------
    major : float
        Of the major task's velocity, rotations times the characteristic length.
    rates : float
        Of the actuators' rates, turning ones times the characteristic length; the norm.
    """

    major: float = 0.0
    rates: float = 0.0

    def exceeds(self, other: Jump) -> bool:
        """Return whether it is larger than another in any respect."""
        return self.major > (1.0 + ROUNDING) * other.major + 1e-15 or (
            self.rates > (1.0 + ROUNDING) * other.rates + 1e-15
        )


class Sent(NamedTuple):
    """The command before.

    Attributes
    ----------
    rates : (N,) array
    major : (m,) array
        Velocity of the major task, metres per second.
    moves : bool
    failures : FailureSet
    mobility : int
        What it was made with.
    time : float
    """

    rates: FloatArray
    major: FloatArray
    moves: bool
    failures: FailureSet
    mobility: int
    time: float


@dataclass(frozen=True)
class Begun:
    """How a transition begins.

    Attributes
    ----------
    mobility : int
        Of the kinematics it leads to.
    under_way : bool
        Whether it takes more than one command.
    jump : Jump
    """

    mobility: int
    under_way: bool
    jump: Jump


class Transition:
    """Eases commands in after the kinematics have changed, and after a rest.

    Parameters
    ----------
    task : Task
    twist_scale : (l,) array
        Turns task velocities into metres per second.
    rate_scale : (N,) array
        Turns actuator rates into metres per second.
    max_acceleration : float
        Metres per second squared, of the reduced coordinates.
    """

    def __init__(
        self,
        task: Task,
        twist_scale: FloatArray,
        rate_scale: FloatArray,
        max_acceleration: float,
    ) -> None:
        self._rows = task.major_rows
        self._twist_scale = twist_scale
        self._weights = twist_scale[self._rows]
        self._rate_scale = rate_scale
        self._unit = common(rate_scale)
        self._max_acceleration = max_acceleration
        self._sent: Sent | None = None
        self._mobility = 0
        self._under_way = False
        self.jump = Jump()

    def eased(
        self,
        target: LimitedRate,
        within: Callable[[ResolvedRate], LimitedRate],
        failures: FailureSet,
        now: float,
    ) -> LimitedRate:
        """Return the command to give now on the way to ``target``.

        Parameters
        ----------
        target : LimitedRate
            Where it is to lead.
        within : callable
            Brings a command into the bounds.
        failures : FailureSet
            Those in force.
        now : float
        """
        self._mobility = target.command.kinematics.mobility
        sent = self._sent
        if sent is None:
            return target
        kind = (sent.moves, sent.failures, sent.mobility)
        begins = kind != (True, failures, self._mobility)
        self._under_way = self._under_way or begins
        if not (self._under_way and target.command.rates.any()):
            # At rest there is nothing to ease in, yet.
            return target
        found = self._on_the_way(target, within, sent, now)
        self._under_way = found is not target
        if begins or not sent.rates.any():
            self.jump = self._jump(found.command, sent)
        return found

    @property
    def sent(self) -> Sent | None:
        """The command before; None before there was one."""
        return self._sent

    def allowed(self, now: float) -> float:
        """Return by how much the drives' speed may differ from the command before, m/s."""
        since = now - self._sent.time if self._sent else 0.0
        return self._max_acceleration * max(since, 0.0)

    def begun(self, how: Begun) -> None:
        """Take note of a first command that was not made by `eased`."""
        self._mobility, self._under_way, self.jump = how.mobility, how.under_way, how.jump

    def is_over(self, failures: FailureSet) -> bool:
        """Return whether a command with ``failures``, made as before, needs no easing."""
        sent = self._sent
        return (
            sent is not None
            and not self._under_way
            and (sent.moves, sent.failures, sent.mobility) == (True, failures, self._mobility)
        )

    def passed(
        self,
        rates: FloatArray,
        task_velocity: FloatArray,
        failures: FailureSet,
        now: float,
        *,
        moves: bool,
    ) -> None:
        """Take note of a command that is given: rates (N,), and the task's velocity (l,)."""
        major = (self._twist_scale * task_velocity)[self._rows]
        self._sent = Sent(rates, major, moves, failures, self._mobility, now)

    def _on_the_way(
        self,
        target: LimitedRate,
        within: Callable[[ResolvedRate], LimitedRate],
        sent: Sent,
        now: float,
    ) -> LimitedRate:
        command = target.command
        kinematics = command.kinematics
        # Coordinates in which the drives' speed is a length: y with x = coordinates @ y.
        unit = self._unit
        if unit is None:
            coordinates = drive_coordinates(kinematics, self._rate_scale)
            drives = self._rate_scale[:, None] * kinematics.mapping.dot(coordinates)
            goal = drives.T.dot(self._rate_scale * kinematics.mapping.dot(command.reduced))
            nearest = drives.T.dot(self._rate_scale * sent.rates)
            jacobian = self._weights[:, None] * kinematics.major.dot(coordinates)
            left, sigma, right = decomposed(jacobian)
            asked = sent.major - jacobian.dot(nearest)
        else:
            # They differ from the reduced rates by a factor only, and the columns of T are
            # orthonormal.
            goal = unit * command.reduced
            nearest = unit * kinematics.mapping.T.dot(sent.rates)
            left, sigma, right = kinematics.decomposed_major(self._weights)
            sigma = sigma / unit
            asked = sent.major - self._weights * kinematics.major.dot(nearest / unit)
        driven = sum(value > SINGULAR_BELOW for value in sigma.tolist())
        left, sigma, right = left[:, :driven], sigma[:driven], right[:driven]
        start = nearest + right.T.dot(left.T.dot(asked) / sigma)

        way = goal - start
        distance = length(way)
        allowed = self.allowed(now)
        if distance <= allowed + ROUNDING * max(length(goal), length(start)):
            return target
        reached = start + (allowed / distance) * way
        major = right.T.dot(right.dot(reached))
        secondary = reached - major
        if unit is None:
            major, secondary = coordinates.dot(major), coordinates.dot(secondary)
        else:
            major, secondary = major / unit, secondary / unit
        eased = within(replace(command, major=frozen(major), secondary=frozen(secondary)))
        # Limits may have bent the way: then it is no use.
        if self._jump(eased.command, sent).exceeds(self._jump(command, sent)):
            return target
        saturation = (*target.saturation, *eased.saturation)
        return replace(
            eased,
            scale=target.scale,
            secondary_scale=target.secondary_scale,
            saturation=tuple(dict.fromkeys(saturation)),
        )

    def _jump(self, command: ResolvedRate, sent: Sent) -> Jump:
        major = (self._twist_scale * command.achieved)[self._rows] - sent.major
        rates = self._rate_scale * (command.rates - sent.rates)
        return Jump(length(major), length(rates))
