# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What one step of the controller gives: command, state, estimate, and the reason in words."""

from __future__ import annotations

from dataclasses import dataclass

from fault_tolerance.control.estimate import Estimate
from fault_tolerance.control.failure_reports import ERROR, OK, STALE, WARN
from fault_tolerance.control.notices import Notice
from fault_tolerance.control.rate_command import RateCommand
from fault_tolerance.control.state_machine import MOVING, Decision, State
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.verdict import failures_in_words
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen


@dataclass(frozen=True, eq=False)
class Output:
    """The command of one step, and the certificate that goes with it."""

    command: RateCommand
    """Zero unless nominal, degraded or parking."""
    decision: Decision
    failures: FailureSet
    """Latched, whatever the state."""
    estimate: Estimate
    """Of the last accepted joint values."""
    reading: int
    """How many readings had been accepted up to that of the estimate: the same number, the same
    reading, in however many steps; 0 before the first."""
    requested: FloatArray
    """(l,): the task velocity in force, rad/s and m/s."""
    no_request_reason: str
    """Why there is no task velocity in force; empty if there is one."""
    input_lost: bool
    """Whether joint states that were there, or are waited for, are missing."""
    reconfiguration_time: float
    """Seconds from the last failure report that changed anything to the end of the step that
    followed it; 0 before there was one, or without a clock."""
    sensorless_flags: BoolArray
    """(N,): actuators that have failed, not with their struts, and have no usable reading."""
    encoder_values: FloatArray
    """(N,): the last accepted joint values, also those of sensorless drives and lost struts."""
    warnings: tuple[Notice, ...]
    """Those in force, as far as `Supervisor.watch` has found them."""
    parking: str = ''
    """The outcome of a park move so far; empty if there is none."""

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
        """What is missing of the task velocity requested, (l,), in the task's order."""
        return frozen(self.requested - self.achieved[self.estimate.model.mechanism.task.rows])

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
        if self.state in MOVING and self.no_request_reason:
            parts.append(self.no_request_reason)
        elif self.state in MOVING and self.command.slowed:
            parts.append('slowed down near a singularity')
        if self.failures and self.state in (State.WAITING, State.HOLD):
            parts.append(failures_in_words(self.failures))
        return '; '.join([*parts, *(notice.text for notice in self.warnings)])

    @property
    def standstill(self) -> str:
        """Why nothing moves although motion is requested; empty if it is not so."""
        # This runs at every step: `any` of a list takes a fifth of what an array's takes.
        if self.state not in MOVING or self.no_request_reason or any(self.rates.tolist()):
            return ''
        if not self.requested.any():
            return ''
        if self.saturation:
            return f'nothing moves: {", ".join(self.saturation)} at the end of the stroke'
        return 'nothing moves: the requested motion is not achievable with the remaining drives'

    @property
    def sensorless(self) -> tuple[str, ...]:
        """Actuators that have failed, not with their struts, and have no usable reading."""
        names, flags = self.estimate.model.mechanism.actuator_names, self.sensorless_flags.tolist()
        return tuple(name for name, yes in zip(names, flags, strict=True) if yes)

    @property
    def saturation(self) -> tuple[str, ...]:
        """Actuators that would have crossed a limit."""
        return self.command.saturated(self.estimate.model.mechanism.actuator_names)
