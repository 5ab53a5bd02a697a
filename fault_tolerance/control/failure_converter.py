# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Engage brakes or release struts where that turns an intolerable failure into a tolerable one.

Section III-F of the paper; the choice is made in kinematics/conversion.py.
"""

from __future__ import annotations

from math import inf

from fault_tolerance.control.brake_evidence import BrakeEvidence
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.notices import Notice
from fault_tolerance.control.step_output import Output
from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.conversion import Conversion, best_conversion
from fault_tolerance.kinematics.failures import FailureMode, FailureSet
from fault_tolerance.mechanism.description import Mechanism

CONFIRMATION = 1.0
"""Seconds after which there is a notice of a brake or a release that nobody has confirmed."""

CONVERSION = 'fault_tolerance: conversion'
"""The source of failure reports that readings of a braked drive lead to."""


class FailureConverter:
    """Finds the best conversion of the failures on ``mechanism``; with ``acting`` commands it.

    It commands only where the failures are not tolerated: an engaged brake and a released strut
    are failures too. They come into force when the drive reports them, or readings show that the
    brake holds (`BrakeEvidence`). Then the stop is lifted; without that it stays.
    """

    def __init__(self, mechanism: Mechanism, acting: bool) -> None:
        self._mechanism = mechanism
        self.acting = acting
        """Whether brakes and releases are commanded, or only advised."""
        self.brakes = tuple(one.name for one in mechanism.actuators if one.brake)
        """Actuators that have a brake."""
        self.releases = tuple(one.name for one in mechanism.struts if one.release)
        """Struts that can be released."""
        self.engaged: tuple[str, ...] = ()
        """Those of which brake or release is commanded."""
        self.advice: Conversion | None = None
        """The best conversion of the failures in force; None where there is nothing better."""
        self._judged = FailureSet(), True, acting
        self._goal: FailureSet | None = None
        self._goal_set_at = inf
        self._engaged_at: dict[str, float] = {}
        self._evidence_for = FailureSet()
        self._evidence: dict[str, BrakeEvidence] = {}
        self._reading = 0
        self._reported_at: dict[str, float] = {}

    def consider(self, output: Output, now: float) -> bool:
        """Look for a conversion of the failures of an ``output``, ``now`` (s), unless done before.

        It is done again when they are no longer tolerated, or `acting` has changed. Takes
        milliseconds: to be called after the command. Returns whether `engaged` has changed.
        """
        failures, estimate, before = output.failures, output.estimate, self.engaged
        judged = failures, estimate.tolerated, self.acting
        known = failures is self._judged[0] and judged == self._judged
        if known or not (self.brakes or self.releases) or not estimate.located:
            return False
        self._judged, self.advice = judged, None
        self.engaged = tuple(name for name in before if self._is_needed(name, failures))
        self._engaged_at = {name: self._engaged_at[name] for name in self.engaged}
        if failures != self._goal:
            self._goal, self._goal_set_at = None, inf
        if failures:
            try:
                found = best_conversion(estimate.post.rows, failures)
            except FailureError:  # so many failures that nobody waits for the best answer
                return self.engaged != before
            self.advice = found.best if found.best.actions else None
        best = self.advice
        if best and self.acting and best.verdict.tolerable and not estimate.tolerated:
            commanded = (new.name for _, new in best.actions)
            self.engaged = tuple(dict.fromkeys((*self.engaged, *commanded)))
            self._engaged_at = {name: self._engaged_at.get(name, now) for name in self.engaged}
            self._goal, self._goal_set_at = best.failures, now
        return self.engaged != before

    def observe(self, output: Output, now: float) -> Report | None:
        """Take the readings of an ``output``, ``now`` (s); return a report if they show anything.

        It says that a limp drive is stuck, as its brake holds it; or limp, as it does not hold.
        """
        failures = output.failures
        if failures is not self._evidence_for:
            self._evidence_for = failures
            self._evidence = {
                name: self._evidence.get(name) or self._new_evidence(name) for name in self.brakes
                if name in failures.free or (name in self._evidence and name in failures.stuck)
            }
        if not self._evidence or output.reading == self._reading:
            return None
        self._reading = output.reading
        for name, evidence in self._evidence.items():
            value = float(output.encoder_values[self._mechanism.actuator_index(name)])
            if name in failures.stuck and evidence.refutes(value):
                return Report((CONVERSION, name), name, FailureMode.TORQUE.value, ERROR, now)
            if name in failures.free:
                evidence.add(now, value)
                if self._is_shown_to_hold(name, now):
                    self._reported_at[name] = now
                    return Report((CONVERSION, name), name, FailureMode.POSITION.value, ERROR, now)
        return None

    def _is_shown_to_hold(self, name: str, now: float) -> bool:
        # A report takes its time to come back, and may get lost.
        if 0.0 <= now - self._reported_at.get(name, -inf) < CONFIRMATION:
            return False
        if name not in self._engaged_at:
            return False
        # The clock may have been set back since.
        self._engaged_at[name] = min(self._engaged_at[name], now)
        return self._evidence[name].shows_a_stop(self._engaged_at[name])

    def confirms(self, failures: FailureSet) -> bool:
        """Return whether ``failures`` are the goal of what was commanded; then it is done."""
        done = self._goal is not None and failures == self._goal
        if done:
            self._goal, self._goal_set_at = None, inf
        return done

    def overdue(self, now: float) -> Notice | None:
        """Return a notice, once, if a command has not been confirmed in time by ``now`` (s)."""
        if now < self._goal_set_at + CONFIRMATION:
            return None
        self._goal_set_at = inf
        text = f'not confirmed within {CONFIRMATION:g} s: {", ".join(self.engaged)}'
        unmoved = [name for name in self.engaged
                   if name in self._evidence and not self._evidence[name].has_moved]
        if unmoved:
            text += f'; {", ".join(unmoved)} did not move before, so readings do not tell'
        return Notice('conversion', f'brake or release {text}', rejected=False)

    def __str__(self) -> str:
        """Return what is advised or commanded, as ``torque:theta_1 to position:theta_1``."""
        if self.advice is None:
            return ', '.join(f'{name} engaged' for name in self.engaged)
        actions = ', '.join(f'{old} to {new}' for old, new in self.advice.actions)
        return f'{actions}: {"commanded" if self._goal is not None else "advised"}'

    def _new_evidence(self, name: str) -> BrakeEvidence:
        place = self._mechanism.actuator_index(name)
        unit = self._mechanism.characteristic_length / self._mechanism.rate_scale[place]
        return BrakeEvidence(self._mechanism.actuators[place], float(unit))

    def _is_needed(self, name: str, failures: FailureSet) -> bool:
        """Return whether a part whose brake or release is engaged still has a failure."""
        if name in failures.parts:
            return True
        if name not in self._mechanism.strut_names:
            strut = self._mechanism.strut_of(name)
            return bool(strut) and strut in failures.lost
        return any(one in failures.parts for one in self._mechanism.actuators_of(name))
