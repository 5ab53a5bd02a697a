# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Resolved rates: which actuator rates give a task velocity, by the law in `kernel.law`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from fault_tolerance.control.estimate import ControlModel, Estimate
from fault_tolerance.control.estimate import estimate as estimated
from fault_tolerance.kernel import model as at
from fault_tolerance.kernel.law import asked_velocity, prioritised
from fault_tolerance.kernel.model import Law, TaskRows, command_of, command_size
from fault_tolerance.kernel.workspace import workspace_size
from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray, frozen, frozen_array
from fault_tolerance.mechanism.task import COORDINATES
from fault_tolerance.tolerances import NEGLIGIBLE_RATE, OBSTACLE_BAND

_OBSTACLES = {
    at.HARDLY_MOVES: 'of the major task',
    at.HARDLY_HELD: 'where the drives hardly hold it',
}


@dataclass(frozen=True, eq=False)
class RateCommand:
    """One command, with its certificate; and what the next one needs to know of it.

    Attributes
    ----------
    rates : (N,) array
        Of all actuators in the mechanism's order, rad/s and m/s; free ones as they follow.
    twist : (6,) array
        What they give the platform: ``[w; v]``, base axes, v at the platform's origin.
    failures : FailureSet
        Those it was made with.
    numbers : array
        The kernel's result, see `fault_tolerance.kernel.model.CommandArrays`.
    obstacle : str
        Why the mechanism is too near a singularity to move; empty if it is not.
    """

    rates: FloatArray
    twist: FloatArray
    failures: FailureSet
    numbers: FloatArray
    obstacle: str = ''

    def __repr__(self) -> str:
        """Return the rates."""
        return f'<RateCommand {np.array2string(self.rates, precision=3)}>'

    @property
    def moves(self) -> bool:
        """Whether the mechanism was allowed to move."""
        return bool(self.numbers[at.MOVED])

    @property
    def scale(self) -> float:
        """The factor by which limits or a near singularity slow everything down."""
        return float(self.numbers[at.SCALE])

    @property
    def secondary_scale(self) -> float:
        """The factor by which the secondary motion had to give way before."""
        return float(self.numbers[at.SECONDARY_SCALE])

    @property
    def slowed(self) -> bool:
        """Whether a near singularity slows it down."""
        return bool(self.numbers[at.SLOWED])

    @property
    def major_jump(self) -> float:
        """By how much the major task's velocity jumped at the last transition, m/s."""
        return float(self.numbers[at.MAJOR_JUMP])

    @property
    def rate_jump(self) -> float:
        """By how much the actuators' rates jumped at the last transition (norm), m/s."""
        return float(self.numbers[at.RATE_JUMP])

    def with_rates_beside(self, rates: FloatArray) -> RateCommand:
        """Return the same command with ``rates`` (N,) added, which do not serve the task.

        What is only rounding beside the largest is left out: a stuck drive gets exactly 0.
        """
        size = np.abs(rates)
        added = np.where(size > NEGLIGIBLE_RATE * size.max(), rates, 0.0)
        return replace(self, rates=frozen(self.rates + added))

    def saturated(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return those of the N actuators ``names`` that would have crossed a bound."""
        flags = self.numbers[-len(names) :].tolist()
        if not any(flags):  # nearly always, and this runs at every step
            return ()
        return tuple(name for name, over in zip(names, flags, strict=True) if over)


def no_command(model: ControlModel) -> RateCommand:
    """Return what stands for the last command of ``model`` before there was any."""
    numbers = np.zeros(command_size(len(model.mechanism.actuators)))
    numbers[at.TIME] = -inf
    parts = command_of(frozen(numbers))
    return RateCommand(parts.rates, parts.twist, FailureSet(), numbers)


def rate_command(
    model: ControlModel,
    estimate: Estimate,
    velocity: FloatArray,
    before: RateCommand,
    now: float,
) -> RateCommand:
    """Return the rates that serve a task velocity within all limits.

    Parameters
    ----------
    model : ControlModel
    estimate : Estimate
    velocity : (l,) array
        Task velocity in the task's order, rad/s and m/s.
    before : RateCommand
        The last command, from which a transition starts.
    now : float
        Seconds.

    Returns
    -------
    RateCommand

    Raises
    ------
    ArithmeticError
        If a rate is not finite.
    """
    packed, numbers = model.packed, np.empty(len(before.numbers))
    last, present, used = before.failures, estimate.failures, estimate
    if not model.settings.recovery:  # for comparison: as if nothing had failed
        used = estimated(model, estimate, estimate.readings, FailureSet())
    changed = last is not present and (last.stuck, last.free, last.lost) != (
        present.stuck, present.free, present.lost)
    model.kernel.command(
        packed.counts, packed.numbers, used.numbers, used.readings, velocity,
        before.numbers, now, changed, numbers, packed.work,
    )
    numbers.setflags(write=False)
    count = at.COMMAND_FACTS + len(estimate.readings)
    rates, twist = numbers[at.COMMAND_FACTS : count], numbers[count : count + 6]
    if not numbers[at.FINITE] == 1.0:
        raise ArithmeticError('the command is not finite')
    obstacle = ''
    if numbers[at.OBSTACLE]:
        kind = _OBSTACLES[int(numbers[at.OBSTACLE])]
        band = OBSTACLE_BAND if before.numbers[at.OBSTACLE] else 1.0
        limit = band * model.settings.hold_below
        obstacle = f'near a singularity {kind} (margin below {limit:.2g})'
    return RateCommand(rates, twist, present, numbers, obstacle)


def resting(command: RateCommand, failures: FailureSet, now: float) -> RateCommand:
    """Return a command of zeros ``now`` in place of ``command``, with the present ``failures``."""
    numbers = command.numbers.copy()
    numbers[at.COMMAND_FACTS :] = 0.0
    numbers[[at.SCALE, at.SECONDARY_SCALE, at.SLOWED, at.MOVED]] = 0.0
    numbers[at.TIME] = now
    parts = command_of(frozen(numbers))
    return RateCommand(parts.rates, parts.twist, failures, numbers)


@dataclass(frozen=True, eq=False)
class ResolvedRate:
    """Actuator rates for a task velocity, without limits.

    Attributes
    ----------
    velocity : (l,) array
        What was asked for, in the task's order, rad/s and m/s.
    rates : (N,) array
        Of all actuators, free ones as they follow.
    achieved, residual : (l,) arrays
        The task velocity they give, and what is missing of the one asked for.
    twist : (d,) array
        The platform's twist they give.
    rank : int
        Directions of the major task that are driven.
    transmission : float
        The smallest transmission of a major direction, 0 where one is lost.
    """

    velocity: FloatArray
    rates: FloatArray
    achieved: FloatArray
    residual: FloatArray
    twist: FloatArray
    rank: int
    transmission: float

    def __repr__(self) -> str:
        """Return the rates."""
        return f'<ResolvedRate {np.array2string(self.rates, precision=3)}>'


def resolved_rate(
    kinematics: DifferentialKinematics,
    velocity: FloatArray,
    *,
    characteristic_length: float = 1.0,
    rate_scale: FloatArray | None = None,
) -> ResolvedRate:
    """Return the actuator rates for one task velocity by task priority (docs/theory.md, eq. 22).

    Parameters
    ----------
    kinematics : DifferentialKinematics
        At the present configuration, failures included.
    velocity : (l,) array
        In the task's order, rad/s and m/s, base axes.
    characteristic_length : float
        Metres; makes rotations and translations comparable.
    rate_scale : (N,) array, optional
        Metres per unit of each actuator; ones by default.

    Returns
    -------
    ResolvedRate

    Raises
    ------
    ArrayError
        If an array has the wrong shape or is not finite.
    """
    task, mapping = kinematics.task, kinematics.mapping
    asked = frozen_array(velocity, (len(task.coordinates),), 'task velocity')
    scale = np.repeat([characteristic_length, 1.0], 3)
    drives = np.ones(len(mapping)) if rate_scale is None else rate_scale
    drives = frozen_array(drives, (len(mapping),), 'rate_scale')
    # Coordinates in which lengths are the drives' speed.
    _, triangle = np.linalg.qr(drives[:, None] * mapping)
    per_speed = np.linalg.inv(triangle)
    twist = np.zeros((len(COORDINATES), kinematics.mobility))
    twist[task.rows] = kinematics.jacobian
    if len(kinematics.twist_jacobian) == len(COORDINATES):
        twist = kinematics.twist_jacobian
    major, other, ones = task.major_rows, task.secondary_rows, np.ones(len(task.rows))
    rows = TaskRows(task.rows, major, other, np.concatenate([major, other]), scale, ones)
    follow = drives[:, None] * (kinematics.rate_map @ per_speed)
    motions = np.vstack([scale[:, None] * (twist @ per_speed), follow]).T.copy()
    work = np.ones(workspace_size(0, 0, len(drives), len(task.rows)))
    wanted = asked_velocity(rows, asked, np.empty(len(asked)))
    found = prioritised(work, rows, Law(), motions, wanted)
    reduced = per_speed @ (found.first + found.second)
    achieved = kinematics.jacobian @ reduced
    complete = len(task.major) <= kinematics.mobility
    return ResolvedRate(
        asked,
        frozen(kinematics.rate_map @ reduced),
        frozen(achieved),
        frozen(asked - achieved),
        frozen(twist @ reduced),
        int(found.driven),
        float(found.found.sigma[len(task.major) - 1]) if complete else 0.0,
    )
