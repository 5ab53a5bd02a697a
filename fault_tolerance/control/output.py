# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The results: what one step of the controller gives, and what a clear did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fault_tolerance.control.estimate import Estimate
from fault_tolerance.control.failure_ledger import LedgerClear
from fault_tolerance.control.failure_reports import ERROR, OK, STALE, WARN
from fault_tolerance.control.notices import Notice
from fault_tolerance.control.resolved_rate import RateCommand
from fault_tolerance.control.state_machine import MOVING, Decision, State
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.kinematics.verdict import failures_in_words
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen
from fault_tolerance.mechanism.configuration import Configuration


@dataclass(frozen=True, eq=False)
class Output:
    """The command of one step, and the certificate that goes with it."""

    command: RateCommand
    """Zero unless nominal, degraded or parking."""
    decision: Decision
    failures: FailureSet
    """Latched, whatever the state."""
    estimate: Estimate
    """Of the last usable joint values."""
    reading: int
    """How many readings had been accepted up to that of the estimate: the same number, the same
    reading, in however many steps; 0 before the first."""
    asked: FloatArray
    """(l,): the task velocity in force, rad/s and m/s."""
    idle: str
    """Why nothing is asked for; empty if something is."""
    input_lost: bool
    """Whether joint states that were there, or are waited for, are missing."""
    reconfiguration_time: float
    """Seconds from the last failure report that changed anything to the end of the step that
    followed it; 0 before there was one, or without a clock."""
    silent: BoolArray
    """(N,): actuators that have failed, not with their struts, and whose encoders say nothing."""
    warnings: tuple[Notice, ...]
    """What readings contradict, as far as `Supervisor.watch` has found it."""
    parking: str = ''
    """What there is to say of a park move; empty if there is none."""

    def __repr__(self) -> str:
        """Return state and reason."""
        return f'<Output {self.state.value}: {self.reason}>'

    @property
    def rates(self) -> FloatArray:
        """Joint rates in the mechanism's order (N,), rad/s and m/s, always finite."""
        return self.command.rates

    @property
    def achieved(self) -> FloatArray:
        """The twist (6,) the rates give the platform, base axes, v of the platform's origin."""
        return self.command.twist

    @property
    def residual(self) -> FloatArray:
        """What is missing of the task velocity asked for, (l,), in the task's order."""
        return frozen(self.asked - self.achieved[self.estimate.model.mechanism.task.rows])

    @property
    def state(self) -> State:
        """The state of the controller."""
        return self.decision.state

    @property
    def level(self) -> int:
        """The diagnostic level: OK nominal, WARN degraded and hold, ERROR stopped, STALE no input.

        A warning makes it WARN at least.
        """
        if self.state is State.STOPPED:
            return ERROR
        if self.input_lost:
            return STALE
        return OK if self.state is State.NOMINAL and not self.warnings else WARN

    @property
    def reason(self) -> str:
        """Why it is in this state, and what else there is to know: a sentence."""
        parts = list(filter(None, (str(self.decision.reason), self.parking)))
        # No task velocity is no fault: it rests in the state it is in.
        if self.state in MOVING and self.idle:
            parts.append(self.idle)
        elif self.state in MOVING and self.command.slowed:
            parts.append('slowed down near a singularity')
        if self.failures and self.state in (State.WAITING, State.HOLD):
            parts.append(failures_in_words(self.failures))
        return '; '.join([*parts, *(notice.text for notice in self.warnings)])

    @property
    def standstill(self) -> str:
        """Why nothing moves although something is asked for; empty if it is not so."""
        # This runs at every step: `any` of a list takes a fifth of what an array's takes.
        if self.state not in MOVING or self.idle or any(self.rates.tolist()):
            return ''
        if not self.asked.any():
            return ''
        if self.saturation:
            return f'nothing moves: {", ".join(self.saturation)} at the end of the stroke'
        return 'nothing moves: what is asked for is outside what the mechanism can do'

    @property
    def sensorless(self) -> tuple[str, ...]:
        """Actuators that have failed, and whose encoders say nothing."""
        names = self.estimate.model.mechanism.actuator_names
        return tuple(name for name, yes in zip(names, self.silent.tolist(), strict=True) if yes)

    @property
    def saturation(self) -> tuple[str, ...]:
        """Actuators that would have crossed a limit."""
        return self.command.saturated(self.estimate.model.mechanism.actuator_names)

    @property
    def post(self) -> PostFailure | None:
        """Kinematics and verdict of the estimate by definition; None before there was any."""
        return self.estimate.post if self.estimate.located else None

    @property
    def configuration(self) -> Configuration | None:
        """The last configuration whose loops closed; None before there was any."""
        return self.estimate.configuration if self.estimate.located else None


@dataclass(frozen=True)
class ClearOutcome:
    """What clearing the failures did."""

    success: bool
    """Whether anything was released."""
    message: str
    """What was, what is still reported, and the state now."""


def clear_outcome(
    cleared: LedgerClear, seen: Sequence[str], lifted: bool, state: str
) -> ClearOutcome:
    """Return what a clear did: failures ``cleared``, a stop ``lifted``, and the ``state`` now.

    What is still ``seen`` counts as still reported.
    """
    parts, remaining = [], dict.fromkeys([*cleared.remaining, *seen])
    if cleared.released:
        parts.append(f'released {", ".join(cleared.released)}')
    if remaining:
        parts.append(f'still reported: {", ".join(remaining)}')
    if not parts:
        parts.append('stop lifted' if lifted else 'nothing to release')
    return ClearOutcome(bool(cleared.released) or lifted, f'{"; ".join(parts)}; now {state}')
