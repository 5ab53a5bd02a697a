# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller: joint values, task velocities and failure reports in, rates out.

It keeps no time of its own: ``now`` and stamps are seconds on one time line, given by the
caller. Inputs are accepted as they come; `Supervisor.step` computes the command, the same way
every time: estimate, rates within all limits, state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, nan

import numpy as np

from fault_tolerance.control.control_model import control_model
from fault_tolerance.control.estimate import Estimate, estimate
from fault_tolerance.control.failure_converter import FailureConverter
from fault_tolerance.control.failure_ledger import ClearOutcome, FailureLedger, LedgerUpdate
from fault_tolerance.control.failure_reports import Report
from fault_tolerance.control.joint_states import unusable
from fault_tolerance.control.metrics import Metrics, metrics_of
from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.control.parking import Parking
from fault_tolerance.control.rate_command import initial_command, rate_command, zero_command
from fault_tolerance.control.reading_gate import ReadingGate
from fault_tolerance.control.secondary_motion import SecondaryMotion
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import Reason, State, StateMachine
from fault_tolerance.control.step_output import Output
from fault_tolerance.control.timed_input import TaskVelocity
from fault_tolerance.control.unwrapping import closing_turns
from fault_tolerance.control.warning_monitor import WarningMonitor
from fault_tolerance.kernel.compilation import Kernel, announced_kernel
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import FARTHEST

MOST_ERRORS = 3
"""Internal errors in a row after which the controller stops."""

WAITING = 'no joint state yet'
"""The reason of the waiting state."""


class Supervisor:
    """Keeps a ``mechanism`` pointing through failures, or stops it.

    ``kernel`` is the compiled one by default, where numba works. `converter` and `secondary` are
    called by whoever runs the steps, after the command.
    """

    def __init__(
        self, mechanism: Mechanism, settings: Settings | None = None, kernel: Kernel | None = None,
    ) -> None:
        self.mechanism = mechanism
        self.settings = given = settings or Settings()
        self._gate = ReadingGate(mechanism, given.joint_state_timeout, self._find_turns)
        self._velocity = TaskVelocity(len(mechanism.task.coordinates), given.command_timeout)
        self._ledger = FailureLedger(mechanism, given)
        self.still_reported = self._ledger.still_reported
        """`still_reported(now)`: whether `clear(now)` would leave a failure in force."""
        self._machine = StateMachine()
        self._model = control_model(mechanism, given, kernel or announced_kernel())
        self._estimate = self._estimate_before = self._model.unknown
        self._command = initial_command(self._model)
        self._monitor = WarningMonitor(mechanism, given)
        self._parking = Parking(mechanism)
        self.converter = FailureConverter(mechanism, given.convert == 'act')
        self.secondary = SecondaryMotion(mechanism, given.secondary == 'tolerance')
        self._shape = (len(mechanism.actuators),)
        self._probe: tuple[FloatArray, FailureSet, int] | None = None
        self._pauses: set[str] = set()
        self._outdated = False  # whether the estimate is
        self._accepted = self._estimated = 0  # numbers of readings
        self._errors = 0
        self._reported_at: float | None = None
        self._now, self._reconfiguration_time = -inf, 0.0
        self.output = self.step(-inf)
        """What the last step gave."""

    @property
    def failures(self) -> FailureSet:
        """The failures in force."""
        return self._ledger.failures

    @property
    def kernel(self) -> Kernel:
        """What computes the steps."""
        return self._model.kernel

    @kernel.setter
    def kernel(self, kernel: Kernel) -> None:
        """Use ``kernel`` from the next step on; estimates go on from each other."""
        self._model = replace(self._model, kernel=kernel)

    def apply_settings(self, settings: Settings) -> None:
        """Use other ``settings`` from the next step on; what has been latched stays."""
        self.settings = self._monitor.settings = self._ledger.settings = settings
        self._gate.timeout = settings.joint_state_timeout
        self._velocity.timeout = settings.command_timeout
        self.converter.acting = settings.convert == 'act'
        self.secondary.switch(settings.secondary == 'tolerance')
        self._model = control_model(self.mechanism, settings, self.kernel)
        self._outdated = True

    def joint_reading(
        self, values: FloatArray, now: float, stamp: float | None = None
    ) -> Notice | None:
        """Accept the joint ``values`` (N,) of all actuators; or return why they are rejected.

        They are in the mechanism's order, counted from home; NaN where there is no reading, which
        only joints that have failed may lack. They were measured at ``stamp`` (``now`` by default,
        seconds). After a rejection the last accepted reading stays in use until it is stale.
        """
        if now < self._now:
            self.restart_clock(now)
        self._now = now
        taken, notice = np.array(values, dtype=np.float64), None
        if taken.shape != self._shape or not np.maximum.reduce(np.abs(taken)) <= FARTHEST:
            notice = unusable(self.mechanism, taken, self._ledger.failures.parts)
            taken[~(np.abs(taken) <= FARTHEST)] = np.nan
        taken.setflags(write=False)
        try:
            notice = notice or self._gate.offer(taken, now, stamp)
        except Exception as error:  # unwrapping makes estimates, which may fail
            notice = Notice('internal_error', f'joint state rejected: {_text_of(error)}')
        if notice is None:
            self._outdated = True
            self._accepted += 1
        return notice

    def task_velocity(
        self, velocity: FloatArray, now: float, stamp: float | None = None
    ) -> Notice | None:
        """Accept a task ``velocity`` (l,), rad/s and m/s, base axes; or return why it is rejected.

        It was requested at ``stamp`` (``now`` by default, seconds).
        """
        self._pass_time(now)
        return self._velocity.offer(velocity, now, stamp)

    def reports(self, reports: Sequence[Report], now: float) -> LedgerUpdate:
        """Take the failure ``reports`` of one message that came ``now`` (seconds).

        Return an update that is true if they changed what is in force: then a step is due.
        """
        clock = self.settings.clock
        started = clock() if clock else None
        self._pass_time(now)
        update = self._ledger.apply(reports, now)
        if update.changed:
            self._outdated, self._reported_at = True, started
            self._gate.set_failures(self.failures)
            # Only a stop for what cannot be tolerated is over with a conversion.
            if self.converter.confirms(self.failures) and isinstance(self._machine.stop, Estimate):
                self._machine.release()
        return update

    def rehearse(self, reports: Sequence[Report], now: float) -> None:
        """Take made-up failure ``reports``, estimate what they leave, and forget the outcome.

        A failure is rare. Without a rehearsal shortly before, its command waits until the code it
        needs has come into the processor's caches. With failures in force the steps themselves use
        that code. ``now`` is in seconds.
        """
        ledger, values = FailureLedger(self.mechanism, self.settings), self._gate.value
        ledger.apply(reports, now)
        if values is None or self.failures or not self.kernel.compiled or np.isnan(values).any():
            return
        estimate(self._model, self._estimate, values, ledger.failures)

    def clear(self, now: float, seen: Sequence[str] = ()) -> ClearOutcome:
        """Release what is not reported any more ``now``, lift a stop; return what came of it.

        Failures that detection has still ``seen``, as text, are named with the remaining ones.
        """
        self._pass_time(now)
        cleared = self._ledger.clear(now, seen)
        self._gate.set_failures(self.failures)
        self._gate.accept_next()
        self._outdated, self._errors = True, 0
        self._parking.end()
        stopped = self._machine.release()
        state = self.step(now).state.value
        return replace(cleared, stop_lifted=stopped and not self._machine.stop, state=state)

    def add_probe_rates(self, rates: FloatArray | None) -> None:
        """Add probe ``rates`` (N,), outside the limits, until the next reading has been answered.

        The caller renews them with each reading, so they end if it fails; and when the failures
        change. They are in the mechanism's units and order; None, or any that is not finite: none.
        """
        self._probe = None
        if rates is not None and np.isfinite(rates).all():
            self._probe = rates, self.failures, self._accepted + 1

    def pause(self, paused: bool, now: float, why: str = 'paused') -> None:
        """Hold from ``now`` on while ``paused``; each reason ``why`` counts for itself."""
        self._pass_time(now)
        self._gate.accept_next()
        (self._pauses.add if paused else self._pauses.discard)(why)

    def restart_clock(self, now: float) -> None:
        """Wait for fresh inputs: the clock they are stamped by was set back to ``now``."""
        self._gate.restart_clock()
        self._velocity.restart_clock()
        self._ledger.restart_clock(now)

    def step(self, now: float) -> Output:
        """Return the command for the inputs at hand ``now``: an `Output` with finite rates.

        Never raises: after an internal error the rates are zero, after three in a row it stops.
        """
        if now < self._now:
            self.restart_clock(now)
        self._now = now
        gate, parking, stale = self._gate, self._parking, now > self._gate.deadline
        failures, last, present = self._ledger.failures, self._command, self._estimate
        command, requested, no_request = None, self._velocity.value, ''
        if requested is None or now > self._velocity.deadline:
            requested, no_request = self._velocity.zeros, self._velocity.missing_reason
        try:
            # Also while no reading is new: the CPU cache stays warm for the step after a failure.
            if gate.value is not None and (self._outdated or not stale):
                if self._estimated != self._accepted:
                    self._estimate_before = present  # of the last reading: repeated steps agree
                present = estimate(self._model, self._estimate_before, gate.value, failures)
                self._estimate, self._estimated, self._outdated = present, self._accepted, False
            unfit = '' if present.tolerated else present
            degraded = present if failures.parts else ''
            stop = self._ledger.stop_reason or (unfit if degraded else '')
            hold: Reason = ', '.join(sorted(self._pauses)) or gate.rejection_reason
            hold = hold or (gate.missing_reason if stale else present.hold_reason)
            hold = hold or ('' if degraded else unfit)
            if present.located and not (stop or hold or self._machine.stop):
                velocity = requested
                if self.secondary.active and not no_request:
                    velocity = self.secondary.velocity(requested, present, now)
                command = rate_command(self._model, present, velocity, last, now)
                hold = command.hold_reason
            waiting = '' if present.located else WAITING
            decision = self._machine.decide(stop, hold, waiting, degraded)
            if decision.state is State.STOPPED:
                parks = not hold and decision.reason is present and not self.converter.engaged
                command = parking.command(present if parks else None, last, now)
            elif parking.needs_reset:
                parking.reset()
            self._errors = 0
        except Exception as error:  # whatever it is, the mechanism must come to rest
            self._errors, text = self._errors + 1, _text_of(error)
            stop = text if self._errors >= MOST_ERRORS else self._ledger.stop_reason
            decision, command = self._machine.decide(stop, text, '', ''), None
            parking.end()
        moving = command is not None and decision.state not in (State.WAITING, State.HOLD)
        if command is None or not moving:
            command = zero_command(command or last, failures, now)
        elif self._probe and self._probe[1] is failures and self._accepted <= self._probe[2]:
            command = command.with_probe(self._probe[0])
        self._command, gate.moving = command, moving
        if self._reported_at is not None and self.settings.clock is not None:
            self._reconfiguration_time = self.settings.clock() - self._reported_at
            self._reported_at = None
        self.output = Output(
            command, decision, failures, self._estimate, self._estimated, requested,
            no_request, stale or gate.value is None, self._reconfiguration_time,
            gate.sensorless, gate.encoder_values, self._monitor.notices, parking.text,
        )
        return self.output

    def watch(self, internal_force: float = nan) -> tuple[Notice, ...]:
        """Return the warnings that are new after the last step, see `WarningMonitor`.

        To be called after the command; the next output has them, for as long as they last.
        ``internal_force`` is in N; NaN: not known.
        """
        return self._monitor.observe(self._now, self.output, internal_force)

    def metrics(self, output: Output | None = None) -> Metrics:
        """Return the measures that go with ``output``, that of the last step by default."""
        return metrics_of(output or self.output, self._monitor, self._now - self._ledger.heard)

    def _find_turns(self, values: FloatArray, near: FloatArray) -> FloatArray:
        return closing_turns(self._model, values, near, self.failures)

    def _pass_time(self, now: float) -> None:
        if now < self._now:
            self.restart_clock(now)
        self._now = now


def _text_of(error: Exception) -> str:
    return clean(f'internal error: {type(error).__name__}: {error}')
