# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller: joint values, task velocities and failure reports in, rates out.

It keeps no time of its own: ``now`` and stamps are seconds on one time line, given by the
caller. Inputs are noted as they come; `Supervisor.step` computes the command, the same way every
time: estimate, resolve, ease, limit, decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan

import numpy as np

from fault_tolerance.control.continuity import Continuity
from fault_tolerance.control.converter import Converter
from fault_tolerance.control.estimate import Estimate, control_model, estimate
from fault_tolerance.control.failure_ledger import FailureLedger, LedgerUpdate
from fault_tolerance.control.failure_reports import Report
from fault_tolerance.control.joint_states import unusable
from fault_tolerance.control.metrics import Metrics, metrics_of
from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.control.output import ClearOutcome, Output, clear_outcome
from fault_tolerance.control.parking import Parking
from fault_tolerance.control.resolved_rate import no_command, rate_command, resting
from fault_tolerance.control.secondary_motion import SecondaryMotion
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import MOVING, Reason, State, StateMachine
from fault_tolerance.control.task_velocity import TaskVelocity
from fault_tolerance.control.unwrapping import closing_turns
from fault_tolerance.control.watch import Watch
from fault_tolerance.kernel.compilation import Kernel, announced_kernel
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import FARTHEST

MOST_ERRORS = 3
"""Internal errors in a row after which the controller stops."""

WAITING = 'no joint state yet'
"""Why the state is waiting."""


class Supervisor:
    """Keeps a ``mechanism`` pointing through failures, or stops it.

    ``kernel`` is the compiled one by default, where numba works. ``output`` is what the last step
    gave; ``still_reported(now)`` returns whether ``clear(now)`` would leave a failure in force.
    Whoever runs the steps calls ``converter`` and ``secondary`` after the command.
    """

    def __init__(
        self, mechanism: Mechanism, settings: Settings | None = None, kernel: Kernel | None = None,
    ) -> None:
        self.mechanism = mechanism
        self.settings = given = settings or Settings()
        self._readings = Continuity(mechanism, given.joint_state_timeout, self._turns)
        self._velocity = TaskVelocity(len(mechanism.task.coordinates), given.command_timeout)
        self._ledger = FailureLedger(
            mechanism, auto_clear=given.auto_clear, report_timeout=given.report_timeout,
            stop_on_unknown_mode=given.unknown_mode == 'stop',
        )
        self.still_reported = self._ledger.still_reported
        self._machine = StateMachine()
        self._model = control_model(mechanism, self.settings, kernel or announced_kernel())
        self._estimate = self._base = self._model.unknown
        self._command = no_command(self._model)
        self._watch = Watch(mechanism, self.settings)
        self._parking = Parking(mechanism)
        self.converter = Converter(mechanism, given.convert == 'act')
        self.secondary = SecondaryMotion(mechanism, given.secondary == 'tolerance')
        self._shape = (len(mechanism.actuators),)
        self._beside: tuple[FloatArray, FailureSet, int] | None = None
        self._pauses: set[str] = set()
        self._outdated = False
        self._errors = self._accepted = self._estimated = 0
        self._reported_at: float | None = None
        self._now, self._reconfiguration_time = -inf, 0.0
        self.output = self.step(-inf)

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
        """Go on with ``kernel``, from the next step on."""
        self._model = self._model.with_kernel(kernel)

    def go_on_with(self, settings: Settings) -> None:
        """Take other ``settings``, from the next step on; what has been latched stays."""
        self.settings = self._watch.settings = settings
        self._readings.timeout = settings.joint_state_timeout
        self.converter.acting = settings.convert == 'act'
        self.secondary.switch(settings.secondary == 'tolerance')
        self._velocity.timeout = settings.command_timeout
        self._ledger.set_rules(
            settings.auto_clear, settings.unknown_mode == 'stop', settings.report_timeout
        )
        self._model = control_model(self.mechanism, settings, self.kernel)
        self._outdated = True

    def joint_reading(
        self, values: FloatArray, now: float, stamp: float | None = None
    ) -> Notice | None:
        """Take the joint ``values`` (N,) of all actuators; return why they were rejected.

        They are in the mechanism's order, counted from home; NaN where there is no reading, which
        only joints that have failed may lack. They were measured at ``stamp`` (``now`` by default,
        seconds). Of rejected ones the last good ones stand until they are stale.
        """
        if now < self._now:
            self.forget_times(now)
        self._now = now
        taken, notice = np.array(values, dtype=np.float64), None
        if taken.shape != self._shape or not np.maximum.reduce(np.abs(taken)) <= FARTHEST:
            notice = unusable(self.mechanism, taken, self._ledger.failures.parts)
            taken[~(np.abs(taken) <= FARTHEST)] = np.nan
        taken.setflags(write=False)
        self._readings.braked = self.converter.engaged
        try:
            notice = notice or self._readings.offer(taken, now, stamp)
        except Exception as error:  # an estimate of turns may fail
            notice = Notice('internal_error', f'joint state refused: {_words(error)}')
        if notice is None:
            self._outdated = True
            self._accepted += 1
        return notice

    def task_velocity(
        self, velocity: FloatArray, now: float, stamp: float | None = None
    ) -> Notice | None:
        """Take a task ``velocity`` (l,), rad/s and m/s, base axes; return why it was rejected.

        It was asked for at ``stamp`` (``now`` by default, seconds).
        """
        self._pass_time(now)
        return self._velocity.offer(velocity, now, stamp)

    def reports(self, reports: Sequence[Report], now: float) -> LedgerUpdate:
        """Take the failure ``reports`` of one message that came ``now`` (seconds).

        Returns
        -------
        LedgerUpdate
            True if they changed what is in force: then a step is due.
        """
        clock = self.settings.clock
        started = clock() if clock else None
        self._pass_time(now)
        update = self._ledger.apply(reports, now)
        if update.changed:
            self._outdated, self._reported_at = True, started
            self._readings.have_failed(self.failures)
            # Only a stop for what cannot be tolerated is over with a conversion.
            if self.converter.confirms(self.failures) and isinstance(self._machine.stop, Estimate):
                self._machine.release()
        return update

    def clear(self, now: float, seen: Sequence[str] = ()) -> ClearOutcome:
        """Release what is not reported any more ``now``, lift a stop; return what came of it.

        What detection has still ``seen``, in the words of the ledger, is named with the rest.
        """
        self._pass_time(now)
        cleared = self._ledger.clear(now)
        self._readings.have_failed(self._ledger.failures)
        self._readings.forget()
        self._outdated, self._errors = True, 0
        self._parking.end()
        was_stopped = self._machine.release()
        state = self.step(now).state.value
        return clear_outcome(cleared, seen, was_stopped and not self._machine.stop, state)

    def move_beside(self, rates: FloatArray | None) -> None:
        """Add ``rates`` (N,) to the commands up to the one that answers the next joint reading.

        They are in the mechanism's units and order; None, or any that is not finite: nothing. The
        limits do not know of them. They end when the failures change, and unless they are asked
        for again with every reading: what asks for them may have broken down.
        """
        self._beside = None
        if rates is not None and np.isfinite(rates).all():
            self._beside = rates, self.failures, self._accepted + 1

    def pause(self, paused: bool, now: float, why: str = 'paused') -> None:
        """Hold from ``now`` on while ``paused``; each reason ``why`` counts for itself."""
        self._pass_time(now)
        self._readings.forget()
        (self._pauses.add if paused else self._pauses.discard)(why)

    def forget_times(self, now: float) -> None:
        """Wait for fresh inputs: the clock they are stamped by was set back to ``now``."""
        self._readings.restart_clock()
        self._velocity.restart_clock()
        self._ledger.restart_clock(now)

    def step(self, now: float) -> Output:
        """Return the command for the inputs at hand ``now``: an `Output` with finite rates.

        Never raises: after an internal error the mechanism rests, after three in a row it stops.
        """
        if now < self._now:
            self.forget_times(now)
        self._now = now
        ledger, readings, parking = self._ledger, self._readings, self._parking
        failures, before, found = ledger.failures, self._command, self._estimate
        command, asked, idle, stale = None, self._velocity.value, '', now > readings.deadline
        if asked is None or now > self._velocity.deadline:
            asked, idle = self._velocity.nothing()
        try:
            # Without anything new, too: so the first step after a failure finds its way cached.
            if readings.value is not None and (self._outdated or not stale):
                if self._estimated != self._accepted:
                    self._base = found  # of the reading before, so that a step can be repeated
                found = estimate(self._model, self._base, readings.value, failures)
                self._estimate, self._estimated, self._outdated = found, self._accepted, False
            degraded = found if failures.parts else ''
            stop = ledger.stop_reason or ('' if found.tolerated else degraded)
            hold: Reason = ', '.join(sorted(self._pauses)) or readings.doubt
            hold = hold or (readings.missing if stale else found.obstacle)
            hold = hold or ('' if found.tolerated or degraded else found)
            if found.located and not (stop or hold or self._machine.stop):
                climbs = self.secondary.active and not idle
                wanted = self.secondary.velocity(asked, found, now) if climbs else asked
                command = rate_command(self._model, found, wanted, before, now)
                hold = command.obstacle
            waiting = '' if found.located else WAITING
            decision = self._machine.decide(stop, hold, waiting, degraded, 'no failure')
            if decision.state is State.STOPPED:
                kept = not hold and decision.reason is found and not self.converter.engaged
                command = parking.command(found if kept else None, before, now)
            elif parking.used:
                parking.reset()
            self._errors = 0
        except Exception as error:  # whatever it is, the mechanism must come to rest
            self._errors += 1
            text = _words(error)
            stop = text if self._errors >= MOST_ERRORS else ledger.stop_reason
            decision, command = self._machine.decide(stop, text, '', '', ''), None
            parking.end()
        moving = decision.state in (*MOVING, State.STOPPED)
        if command is None or not moving:
            command, moving = resting(command or before, failures, now), False
        elif self._beside and self._beside[1] is failures and self._accepted <= self._beside[2]:
            command = command.with_rates_beside(self._beside[0])
        self._command, readings.moving = command, moving
        if self._reported_at is not None and self.settings.clock is not None:
            self._reconfiguration_time = self.settings.clock() - self._reported_at
            self._reported_at = None
        self.output = Output(
            command, decision, failures, self._estimate, self._estimated, asked, idle,
            stale or readings.value is None, self._reconfiguration_time,
            readings.sensorless, self._watch.notices, parking.text,
        )
        return self.output

    def watch(self, internal_force: float = nan) -> tuple[Notice, ...]:
        """Return what is new to warn of after the last step, see `Watch`.

        To be called after the command is on its way; what it finds is in the next output.
        ``internal_force`` is in N; NaN: not known.
        """
        return self._watch.observe(self._now, self.output, internal_force)

    def metrics(self, output: Output | None = None) -> Metrics:
        """Return the measures that go with ``output``, that of the last step by default."""
        return metrics_of(output or self.output, self._watch, self._now - self._ledger.heard)

    def _turns(self, values: FloatArray, near: FloatArray) -> FloatArray:
        return closing_turns(self._model, values, near, self.failures)

    def _pass_time(self, now: float) -> None:
        if now < self._now:
            self.forget_times(now)
        self._now = now


def _words(error: Exception) -> str:
    return clean(f'internal error: {type(error).__name__}: {error}')
