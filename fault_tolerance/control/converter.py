# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Brakes and releases that turn failures which must not stand into such as may (section III-F)."""

from __future__ import annotations

from math import inf

from fault_tolerance.control.brake_evidence import BrakeEvidence
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.notices import Notice
from fault_tolerance.control.output import Output
from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.conversion import Conversion, best_conversion
from fault_tolerance.kinematics.failures import FailureMode, FailureSet
from fault_tolerance.mechanism.description import Mechanism

CONFIRMATION = 1.0
"""Seconds after which a brake or a release that nobody has confirmed is told of."""

CONVERSION = 'fault_tolerance: conversion'
"""Who says what readings show about a brake, in failure reports."""


class Converter:
    """Finds the best conversion of the failures in force, and may ask for it.

    It is asked for only where the failures must not stand as they are: a brake that engages and a
    strut that comes off are failures too. What is in force changes when the drive reports it, or
    readings show that its brake holds (`BrakeEvidence`), and then the stop is lifted; without that
    the stop stays.

    Parameters
    ----------
    mechanism : Mechanism
    acting : bool
        Whether brakes and releases are commanded, or only advised.

    Attributes
    ----------
    brakes, releases : tuple of str
        Actuators that have a brake, and struts that can be released.
    engaged : tuple of str
        Those of which brake or release is commanded.
    advice : Conversion or None
        The best conversion of the failures in force; None where there is nothing better.
    """

    def __init__(self, mechanism: Mechanism, acting: bool) -> None:
        self._mechanism, self.acting = mechanism, acting
        self.brakes = tuple(one.name for one in mechanism.actuators if one.brake)
        self.releases = tuple(one.name for one in mechanism.struts if one.release)
        self.engaged: tuple[str, ...] = ()
        self.advice: Conversion | None = None
        self._judged = FailureSet(), True, acting
        self._goal: FailureSet | None = None
        self._asked = inf
        self._since: dict[str, float] = {}
        self._watched = FailureSet()
        self._reading = 0
        self._evidence: dict[str, BrakeEvidence] = {}
        self._told: dict[str, float] = {}

    def consider(self, output: Output, now: float) -> bool:
        """Look at the failures of an ``output`` (``now``, s), unless they have been looked at.

        They are looked at again where they must not stand any more, or brakes may be commanded.
        Takes milliseconds: to be called after the command. Returns whether what is commanded has
        changed.

        Parameters
        ----------
        output : Output
        now : float

        Returns
        -------
        bool
        """
        failures, estimate, before = output.failures, output.estimate, self.engaged
        judged = failures, estimate.tolerated, self.acting
        known = failures is self._judged[0] and judged == self._judged
        if known or not (self.brakes or self.releases) or not estimate.located:
            return False
        self._judged, self.advice = judged, None
        self.engaged = tuple(name for name in before if self._concerns(name, failures))
        self._since = {name: self._since[name] for name in self.engaged}
        if failures != self._goal:
            self._goal, self._asked = None, inf
        if failures:
            try:
                found = best_conversion(estimate.post.rows, failures)
            except FailureError:  # so many failures that nobody waits for the best answer
                return self.engaged != before
            self.advice = found.best if found.best.actions else None
        best = self.advice
        if best and self.acting and best.verdict.tolerable and not estimate.tolerated:
            asked = (new.name for _, new in best.actions)
            self.engaged = tuple(dict.fromkeys((*self.engaged, *asked)))
            self._since = {name: self._since.get(name, now) for name in self.engaged}
            self._goal, self._asked = best.failures, now
        return self.engaged != before

    def observe(self, output: Output, now: float) -> Report | None:
        """Take what an ``output`` has read (``now``, s).

        Parameters
        ----------
        output : Output
        now : float

        Returns
        -------
        Report or None
            That a limp drive is stuck, as its brake holds it; or limp, as it does not after all.
        """
        failures, readings = output.failures, output.estimate.readings
        if failures is not self._watched:
            self._watched = failures
            self._evidence = {
                name: self._evidence.get(name) or self._evidence_of(name) for name in self.brakes
                if name in failures.free or (name in self._evidence and name in failures.stuck)
            }
        if not self._evidence or output.reading == self._reading:
            return None
        self._reading = output.reading
        for name, evidence in self._evidence.items():
            value = float(readings[self._mechanism.actuator_index(name)])
            if name in failures.stuck and evidence.refutes(value):
                return Report((CONVERSION, name), name, FailureMode.TORQUE.value, ERROR, now)
            if name in failures.free:
                evidence.add(now, value)
                # A report takes its time to come back, and may get lost.
                told = 0.0 <= now - self._told.get(name, -inf) < CONFIRMATION
                if name in self._since and not told:
                    # A clock may have been set back since.
                    self._since[name] = asked = min(self._since[name], now)
                    if not evidence.shows_a_stop(asked):
                        continue
                    self._told[name] = now
                    return Report((CONVERSION, name), name, FailureMode.POSITION.value, ERROR, now)
        return None

    def confirms(self, failures: FailureSet) -> bool:
        """Return whether ``failures`` are what was asked for; then it is done.

        Parameters
        ----------
        failures : FailureSet

        Returns
        -------
        bool
        """
        done = self._goal is not None and failures == self._goal
        if done:
            self._goal, self._asked = None, inf
        return done

    def overdue(self, now: float) -> Notice | None:
        """Return that something asked for has not been confirmed ``now`` (s), once.

        Parameters
        ----------
        now : float

        Returns
        -------
        Notice or None
        """
        if now < self._asked + CONFIRMATION:
            return None
        self._asked = inf
        text = f'not confirmed within {CONFIRMATION:g} s: {", ".join(self.engaged)}'
        still = [name for name in self.engaged
                 if name in self._evidence and not self._evidence[name].has_moved]
        if still:
            text += f'; {", ".join(still)} did not move before, so readings do not tell'
        return Notice('conversion', f'brake or release {text}', rejected=False)

    def __str__(self) -> str:
        """Return what is advised or commanded, as ``torque:theta_1 to position:theta_1``."""
        if self.advice is None:
            return ', '.join(f'{name} engaged' for name in self.engaged)
        actions = ', '.join(f'{old} to {new}' for old, new in self.advice.actions)
        return f'{actions}: {"commanded" if self._goal is not None else "advised"}'

    def _evidence_of(self, name: str) -> BrakeEvidence:
        place = self._mechanism.actuator_index(name)
        unit = self._mechanism.characteristic_length / self._mechanism.rate_scale[place]
        return BrakeEvidence(self._mechanism.actuators[place], float(unit))

    def _concerns(self, name: str, failures: FailureSet) -> bool:
        """Return whether a part engaged has a failure still."""
        if name in failures.parts:
            return True
        if name not in self._mechanism.strut_names:
            strut = self._mechanism.strut_of(name)
            return bool(strut) and strut in failures.lost
        return any(one in failures.parts for one in self._mechanism.actuators_of(name))
