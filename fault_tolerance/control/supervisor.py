# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller itself: joint values, task velocities and failure reports in, rates out.

It keeps no time of its own: ``now`` and stamps are seconds on one time line, given by the
caller. Inputs are noted as they come; `Supervisor.step` computes. A failure report changes the
very next step, wherever that is called from.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf

import numpy as np

from fault_tolerance.control.assessment import without_lost
from fault_tolerance.control.command import CommandLaw
from fault_tolerance.control.inputs import WatchedInput
from fault_tolerance.control.ledger import FailureLedger, LedgerUpdate
from fault_tolerance.control.metrics import Metrics, metrics_of
from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.control.output import ClearOutcome, Command, Output, clear_outcome
from fault_tolerance.control.plausibility import Plausibility
from fault_tolerance.control.readings import unusable
from fault_tolerance.control.recovery import Conditions, Decision, State, StateMachine
from fault_tolerance.control.reports import Report
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.situation import Situation
from fault_tolerance.errors import ArrayError
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import failures_in_words
from fault_tolerance.mechanism.arrays import FloatArray, frozen, frozen_array
from fault_tolerance.mechanism.description import Mechanism

MOST_ERRORS = 3
"""Internal errors in a row after which the controller stops."""

_WAITING = 'no joint state yet'
_NO_TWIST = frozen_array(np.zeros(6), (6,), 'twist')


class Supervisor:
    """Keeps a mechanism pointing through failures, or stops it.

    Parameters
    ----------
    mechanism : Mechanism
    settings : Settings, optional
    """

    def __init__(self, mechanism: Mechanism, settings: Settings | None = None) -> None:
        self.mechanism = mechanism
        self.settings = settings or Settings()
        self._readings = WatchedInput(
            'joint state', self.settings.joint_state_timeout, ordered=True
        )
        self._velocity = WatchedInput(
            'task velocity', self.settings.command_timeout, ordered=False
        )
        self._ledger = FailureLedger(
            mechanism,
            auto_clear=self.settings.auto_clear,
            stop_on_unknown_mode=self.settings.unknown_mode == 'stop',
            report_timeout=self.settings.report_timeout,
        )
        self._machine = StateMachine()
        self._law = CommandLaw(mechanism, self.settings)
        self._transition = self._law.transition()
        self._situation = Situation(mechanism, self.settings, self._law)
        self._plausibility = Plausibility(mechanism)
        self._paused = False
        self._errors = 0
        self._now = -inf
        self._reported_at: float | None = None
        self._recovery_time = 0.0
        count = len(mechanism.actuators)
        self._rest = frozen_array(np.zeros(count), (count,), 'rates')
        self._unseen: FloatArray | None = None
        self._given = self._resting(self._machine.decide(Conditions(waiting=_WAITING)), self._now)
        self._output = self._result(self._given)

    @property
    def failures(self) -> FailureSet:
        """The failures in force."""
        return self._ledger.failures

    @property
    def assessed_by(self) -> str:
        """Whether the last assessment was ``anticipated`` or ``derived`` when it was needed."""
        return self._situation.assessed_by

    @property
    def output(self) -> Output:
        """What the last step gave."""
        return self._output

    def joint_reading(
        self, values: FloatArray, now: float, stamp: float | None = None
    ) -> Notice | None:
        """Take the joint values of all actuators.

        Parameters
        ----------
        values : (N,) array
            In the mechanism's order, counted from home; NaN where there is no reading, which
            only joints of lost struts may lack.
        now : float
        stamp : float, optional
            When they were measured; now by default.

        Returns
        -------
        Notice or None
            Why the values were left aside; the last good ones then stand until they are stale.
        """
        self._pass_time(now)
        lost = self.failures.lost
        taken = np.array(values, dtype=np.float64)
        notice = unusable(self.mechanism, taken, lost) or self._readings.offer(taken, now, stamp)
        self._situation.outdated |= notice is None
        return notice

    def task_velocity(
        self, velocity: FloatArray, now: float, stamp: float | None = None
    ) -> Notice | None:
        """Take a task velocity (l,) in the task's order; return why it was left aside."""
        self._pass_time(now)
        count = len(self.mechanism.task.coordinates)
        try:
            taken = frozen_array(velocity, (count,), 'task velocity', finite=False)
        except ArrayError as error:
            return Notice('length', str(error))
        if not np.isfinite(taken).all():
            return Notice('not_finite', 'task velocity holds a number that is not finite')
        return self._velocity.offer(taken, now, stamp)

    def reports(self, reports: Sequence[Report], now: float) -> LedgerUpdate:
        """Take the failure reports of one message; true if they changed what is in force."""
        clock = self.settings.clock
        started = clock() if clock else None
        self._pass_time(now)
        update = self._ledger.apply(reports, now)
        if update.changed:
            self._situation.outdated = True
            self._reported_at = started
        return update

    def clear(self, now: float) -> ClearOutcome:
        """Release what is no longer reported, lift a stop, and judge what is left."""
        self._pass_time(now)
        cleared = self._ledger.clear(now)
        self._situation.outdated = True
        self._errors = 0
        was_stopped = self._machine.release()
        state = self.step(now).state.value
        lifted = was_stopped and not self._machine.stop
        return clear_outcome(cleared, lifted, state)

    def pause(self, paused: bool, now: float) -> None:
        """Hold until it is called with False."""
        self._pass_time(now)
        self._paused = paused

    def forget_times(self, now: float) -> None:
        """Wait for fresh inputs: the clock they are stamped by has been set back."""
        self._readings.restart_clock()
        self._velocity.restart_clock()
        self._ledger.restart_clock(now)

    def step(self, now: float) -> Output:
        """Return the command for the inputs at hand. Never raises; the rates are finite."""
        self.command(now)
        return self.settled()

    def command(self, now: float) -> Command:
        """Return what the drives wait for; `settled` is to be called when it is on its way.

        Never raises; the rates are finite.
        """
        self._pass_time(now)
        try:
            self._given = self._shortly(now) or self._cycle(now)
        except Exception as error:  # whatever it is, the mechanism must come to rest
            self._given = self._halted(error, now)
        if self._reported_at is not None and self.settings.clock is not None:
            self._recovery_time = self.settings.clock() - self._reported_at
            self._reported_at = None
        return self._given

    def settled(self) -> Output:
        """Return all there is to know of the last command, with what could wait until now.

        Should that fail, the output rests though the command did not.
        """
        try:
            self._look_back(self._given.time)
            if self._given.sound:
                self._errors = 0
        except Exception as error:
            self._given = self._halted(error, self._given.time)
        given = self._given
        self._transition.passed(
            given.rates,
            given.achieved[self.mechanism.task.rows],
            self.failures,
            given.time,
            moves=given.decision.moves,
        )
        self._output = self._result(given)
        return self._output

    def metrics(self) -> Metrics:
        """Return the measures that go with the last step; what is slow is computed here."""
        return metrics_of(self.mechanism, self._output, self._situation.assessment)

    def metrics_by_pieces(self) -> Iterator[Metrics | None]:
        """Yield what `metrics` would return now, after as many times None as it takes."""
        output, assessment = self._output, self._situation.assessment
        if assessment is not None:
            yield from assessment.work_out()
        yield metrics_of(self.mechanism, output, assessment)

    def anticipate(self) -> bool:
        """Work out what one further failure would come to; return whether there was any to do.

        For times when nothing else is to be done: it takes about as long as a step.
        """
        values = self._readings.value
        if values is None or self._machine.stop:
            return False
        return self._situation.anticipate(values, self.failures)

    def _shortly(self, now: float) -> Command | None:
        """Return the command for new joint values if it can be made just as the one before was."""
        values, before = self._readings.value, self._given
        if values is None or not (self._situation.outdated and before.decision.moves):
            return None
        if self._paused or self._ledger.stop_reason or self._readings.has_ceased(now):
            return None
        if self._transition.is_over(self.failures):
            taken = self._situation.shortcut(values, self._asked(now), self.failures)
            if taken is None:
                return None
            self._unseen = values
            return Command(taken.rates, taken.twist, before.decision, now, None, taken=taken)
        return self._first_command(values, now)

    def _first_command(self, values: FloatArray, now: float) -> Command | None:
        """Return the first command after a failure that was anticipated, if it can be made so."""
        sent, failures = self._transition.sent, self.failures
        if sent is None or not (failures and self.settings.recovery):
            return None
        first = self._situation.first_command(
            values, self._asked(now), failures, sent, self._transition.allowed(now)
        )
        if first is None:
            return None
        self._unseen = values
        return Command(first.room.rates, first.room.twist, first.readied.decision, now, None)

    def _cycle(self, now: float) -> Command:
        values, situation = self._readings.value, self._situation
        if situation.outdated and values is not None:
            self._unseen = values
            situation.assess(values, self.failures)
        assessment = situation.assessment
        stop = self._ledger.stop_reason or situation.intolerance
        hold = self._hold_reason(now)
        resolved = None
        if assessment and not (stop or hold or self._machine.stop):
            post = assessment.post
            kinematics = post.present if self.settings.recovery else post.nominal
            resolved = self._law.resolved(kinematics, self._asked(now))
            hold = self._law.obstacle(resolved)
        decision = self._machine.decide(self._conditions(stop, hold))
        if values is None or resolved is None or not decision.moves:
            return self._resting(decision, now)
        limited = self._law.limited(
            resolved,
            without_lost(self.mechanism, values, self.failures),
            lambda target, within: self._transition.eased(target, within, self.failures, now),
        )
        # Adding zero turns the -0.0 of a resting drive into 0.0.
        rates = frozen(limited.command.rates + 0.0)
        return Command(rates, limited.command.twist, decision, now, limited)

    def _conditions(self, stop: str, hold: str) -> Conditions:
        situation = self._situation
        return Conditions(
            stop=stop,
            hold=hold,
            waiting='' if situation.assessment else _WAITING,
            degraded=situation.verdict if self.failures else '',
            nominal='no failure',
        )

    def _resting(self, decision: Decision, now: float, *, sound: bool = True) -> Command:
        return Command(self._rest, _NO_TWIST, decision, now, None, sound)

    def _halted(self, error: Exception, now: float) -> Command:
        """Return the command after an internal error; with the third in a row it stops."""
        self._errors += 1
        text = clean(f'internal error: {type(error).__name__}: {error}')
        stop = text if self._errors >= MOST_ERRORS else self._ledger.stop_reason
        return self._resting(self._machine.decide(Conditions(stop=stop, hold=text)), now,
                             sound=False)

    def _look_back(self, now: float) -> None:
        """Compare the readings just used with the commands before, and judge what was not yet."""
        followed = self._situation.catch_up()
        if followed is not None:
            self._given = self._given._replace(limited=followed.limited)
            if followed.begun is not None:
                self._transition.begun(followed.begun)
        read, self._unseen = self._unseen, None
        if read is not None and self.settings.recovery:
            values = without_lost(self.mechanism, read, self.failures)
            self._plausibility.observe(values, self._output.rates, self.failures, now)
        situation, given = self._situation, self._given
        if situation.judge():
            stop = situation.intolerance
            decision = given.decision
            if stop or decision.state is State.DEGRADED:
                decision = self._machine.decide(self._conditions(stop, ''))
            if stop:
                given = self._resting(decision, given.time)
            self._given = given._replace(decision=decision)
        lasts = self.settings.recovery or not self.failures
        situation.prepare(moves=lasts and self._given.driven)

    def _hold_reason(self, now: float) -> str:
        """Return why the mechanism must not move now though nothing is wrong with it for good."""
        if self._paused:
            return 'paused'
        if self._readings.has_ceased(now):
            return f'no usable joint state for {self.settings.joint_state_timeout:g} s'
        return self._situation.obstacle

    def _idle(self, now: float) -> str:
        """Return why nothing is asked for; empty if something is."""
        if self._velocity.value is None:
            return 'no task velocity yet'
        if self._velocity.has_ceased(now):
            return f'no task velocity for {self.settings.command_timeout:g} s'
        return ''

    def _asked(self, now: float) -> FloatArray:
        """Return the task velocity in force; zero when there is none."""
        velocity = self._velocity.value
        if velocity is None or self._idle(now):
            count = len(self.mechanism.task.coordinates)
            return frozen_array(np.zeros(count), (count,), 'task velocity')
        return velocity

    def _pass_time(self, now: float) -> None:
        if now < self._now:
            self.forget_times(now)
        self._now = now

    def _result(self, given: Command) -> Output:
        """Return the output that goes with a command."""
        limited, taken = given.limited, given.taken
        if taken is not None:
            residual = taken.residual
        else:
            residual = limited.command.residual if limited else self._asked(given.time)
        whole = 1.0 if taken is not None else 0.0
        return Output(
            rates=given.rates,
            state=given.decision.state,
            reason=self._reason(given.decision, given.time),
            failures=self.failures,
            assessed=taken.assessed if taken is not None else self._situation.supplier(),
            achieved=given.achieved,
            residual=residual,
            scale=limited.scale if limited else whole,
            secondary_scale=limited.secondary_scale if limited else whole,
            saturation=limited.saturation if limited else (),
            jump=self._transition.jump,
            out_of_range=self._plausibility.out_of_range,
            inconsistent=self._plausibility.inconsistent,
            notices=self._plausibility.notices,
            input_lost=self._readings.value is None or self._readings.has_ceased(given.time),
            recovery_time=self._recovery_time,
        )

    def _reason(self, decision: Decision, now: float) -> str:
        """Return the reason for a state, and what else there is to know."""
        # To be asked for nothing is no fault: it rests, as healthy or degraded as it is.
        parts = [decision.reason]
        if decision.moves and self._idle(now):
            parts.append(self._idle(now))
        elif decision.moves and self._law.slowed:
            parts.append('slowed down near a singularity')
        if self.failures and decision.state in (State.WAITING, State.HOLD):
            parts.append(failures_in_words(self.failures))
        parts += [notice.text for notice in self._plausibility.notices]
        return '; '.join(parts)
