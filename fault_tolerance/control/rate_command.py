# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The command of one step: the rates that serve a task velocity within all limits.

The control law itself, limits and all, is in kernel/law.py and kernel/commanding.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from fault_tolerance.control.control_model import ControlModel
from fault_tolerance.control.estimate import Estimate
from fault_tolerance.control.estimate import estimate as estimated
from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import command_of, command_size
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.tolerances import NEGLIGIBLE_RATE, OBSTACLE_BAND

_SINGULARITIES = {
    at.HARDLY_MOVES: 'of the major task',
    at.HARDLY_HELD: 'where the drives hardly hold it',
}


@dataclass(frozen=True, eq=False)
class RateCommand:
    """One command, with its certificate; and what the next one needs to know of it."""

    rates: FloatArray
    """(N,): of all actuators in the mechanism's order, rad/s and m/s; free ones as they follow."""
    twist: FloatArray
    """(6,): what they give the platform, ``[w; v]``, base axes, v at the platform's origin."""
    failures: FailureSet
    """Those it was made with."""
    numbers: FloatArray
    """The kernel's result, see `fault_tolerance.kernel.array_layout.CommandArrays`."""
    hold_reason: str = ''
    """Why the mechanism is too near a singularity to move; empty if it is not."""

    def __repr__(self) -> str:
        """Return the rates."""
        return f'<RateCommand {np.array2string(self.rates, precision=3)}>'

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

    def with_probe(self, rates: FloatArray) -> RateCommand:
        """Return the same command with ``rates`` (N,) added, which do not serve the task.

        Rates negligible beside the largest are set to 0: a stuck drive gets exactly 0.
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


def initial_command(model: ControlModel) -> RateCommand:
    """Return the command of ``model`` before the first one: at rest."""
    numbers = np.zeros(command_size(len(model.mechanism.actuators)))
    numbers[at.TIME] = -inf
    parts = command_of(frozen(numbers))
    return RateCommand(parts.rates, parts.twist, FailureSet(), numbers)


def zero_command(last: RateCommand, failures: FailureSet, now: float) -> RateCommand:
    """Return a command of zeros ``now`` (s), after the ``last`` one, with the ``failures``."""
    numbers = last.numbers.copy()
    numbers[at.N_COMMAND_FACTS :] = 0.0
    numbers[[at.SCALE, at.SECONDARY_SCALE, at.SLOWED, at.MOVED]] = 0.0
    numbers[at.TIME] = now
    parts = command_of(frozen(numbers))
    return RateCommand(parts.rates, parts.twist, failures, numbers)


def rate_command(
    model: ControlModel, estimate: Estimate, velocity: FloatArray, last: RateCommand, now: float,
) -> RateCommand:
    """Return the rates that serve a task ``velocity`` (l,) within all limits, ``now`` (s).

    ``velocity`` is in the task's order, rad/s and m/s; ``model`` has the limits, ``estimate`` is
    where the mechanism is; a transition starts from the ``last`` command. ArithmeticError if a
    rate is not finite.
    """
    packed, numbers = model.packed, np.empty(len(last.numbers))
    earlier, present, used = last.failures, estimate.failures, estimate
    if not model.settings.recovery:  # for comparison: as if nothing had failed
        used = estimated(model, estimate, estimate.readings, FailureSet())
    changed = earlier is not present and (earlier.stuck, earlier.free, earlier.lost) != (
        present.stuck, present.free, present.lost)
    model.kernel.command(
        packed.counts, packed.numbers, used.numbers, used.readings, velocity,
        last.numbers, now, changed, numbers, packed.work,
    )
    numbers.setflags(write=False)
    count = at.N_COMMAND_FACTS + len(estimate.readings)
    rates, twist = numbers[at.N_COMMAND_FACTS : count], numbers[count : count + 6]
    if not numbers[at.FINITE] == 1.0:
        raise ArithmeticError('the command is not finite')
    hold_reason = ''
    if numbers[at.OBSTACLE]:
        kind = _SINGULARITIES[int(numbers[at.OBSTACLE])]
        band = OBSTACLE_BAND if last.numbers[at.OBSTACLE] else 1.0
        limit = band * model.settings.hold_below
        hold_reason = f'near a singularity {kind} (margin below {limit:.2g})'
    return RateCommand(rates, twist, present, numbers, hold_reason)
