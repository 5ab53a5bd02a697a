# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether readings can follow from the last ones: wraps, jumps, and encoders that fall silent."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite, isinf, pi

import numpy as np

from fault_tolerance.control.input_watchdog import InputWatchdog
from fault_tolerance.control.notices import Notice
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator

MARGIN = 2.0
"""How much faster than the limit in the mechanism file a joint may be read to move."""

GRACE = 0.02
"""Seconds by which the times between readings may be wrong: messages come in bursts."""

SLACK = 1e-3
"""Characteristic lengths (radians for drives that turn) of a jump that is none: noise, steps."""

FROZEN = 3
"""Readings in a row that an encoder repeats while others change, after which it is silent: but not
while a brake is engaged, as what it holds stands still. An encoder that was silent before stays so
until its reading changes."""

WHOLE_TURNS = 0.02
"""Share of a turn by which a jump may differ from whole turns to be called a wrap."""


Turns = Callable[[FloatArray, FloatArray], FloatArray]


class Continuity(InputWatchdog):
    """Takes joint values as continuations of the last ones; a watchdog for them.

    Values older than the last ones are refused. Those of an encoder with a period are unwrapped.
    Values that no drive can have reached since the last reading are refused, for as long as they
    come: the time they have been refused for does not make them true. After a gap, where the
    mechanism did not move on command, and after `forget` whatever comes is believed. Limp drives
    and lost struts go as fast as they like.

    Parameters
    ----------
    mechanism : Mechanism
    timeout : float
        Seconds without a reading that are a gap; refusals that last longer are a `doubt`.
    turns : callable
        Given values from home and where the drives were last, or home, returns in which turns they
        are: see `closing_turns`. Asked at the start and after `forget`.

    Attributes
    ----------
    moving : bool
        Whether the mechanism moves on command: else by hand, perhaps.
    braked : tuple of str
        Actuators whose brakes are engaged.
    doubt : str
        Why what is read is not believed, where that has lasted; empty otherwise.
    sensorless : (N,) array of bool
        Actuators that have failed, not with their struts, and whose encoders say nothing.
    """

    def __init__(self, mechanism: Mechanism, timeout: float, turns: Turns) -> None:
        super().__init__('joint state', timeout)
        self._lacking = 'no usable joint state'
        self._mechanism = mechanism
        drives = mechanism.actuators
        self._speeds = np.array([_speed(one) for one in drives])
        self._slacks = SLACK * mechanism.characteristic_length / mechanism.rate_scale
        self._per_speed = 1.0 / self._speeds
        self._periods = np.array([one.period for one in drives])
        self._wraps = bool(np.isfinite(self._periods).any())
        self._turns, self._places = turns, np.zeros(len(drives))
        self._lasts, self._raws = np.full((2, len(drives)), np.nan)
        self._repeated = np.zeros(len(drives), np.intp)
        self._none: BoolArray = frozen(np.zeros(len(drives), bool))
        self._heard = self._refused = -inf
        self._since = inf
        self.moving, self.doubt = False, ''
        self.braked: tuple[str, ...] = ()
        self.have_failed(FailureSet())

    def forget(self) -> None:
        """Believe the next readings, whatever they are."""
        self._places = np.where(np.isnan(self._lasts), self._places, self._lasts)
        self._lasts = np.full_like(self._lasts, np.nan)
        self._heard, self._since, self.doubt = -inf, inf, ''

    def have_failed(self, failures: FailureSet) -> None:
        """Go by other ``failures`` from the next readings on."""
        # Lists: the first command after a failure waits for this.
        place = self._mechanism.actuator_index
        self._stuck = [place(name) for name in failures.stuck]
        self._free = [place(name) for name in failures.free]
        self._off = [
            place(name) for strut in failures.lost for name in self._mechanism.actuators_of(strut)]
        self.sensorless = self._none
        self._repeated[:] = 0

    def restart_clock(self) -> None:
        """Let the values be stale until the next ones, which are believed."""
        super().restart_clock()
        self.forget()

    def offer(self, value: FloatArray, now: float, stamp: float | None) -> Notice | None:
        """Take joint values, or return why they are too old or not believed.

        Parameters
        ----------
        value : (N,) array
            From home, rad or m; NaN where there is none. They are kept unwrapped; a stuck drive
            without a reading is where it was last, a limp one NaN.
        now : float
            When they came, seconds.
        stamp : float or None
            When they were measured; None and what is ahead count as now.

        Returns
        -------
        Notice or None
        """
        given = now if stamp is None or not isfinite(stamp) else min(stamp, now)
        if now - given > self.timeout:
            return self._too_old('stale', f'{now - given:.3f} s old on arrival')
        if given < self._stamp:
            return self._too_old('old', f'{self._stamp - given:.3f} s older than the last')
        gap = now - self._heard
        passed = max(gap, given - self._stamp)
        self._heard, self._stamp = now, given
        if self._since != inf and now - self._refused > self.timeout:
            self._since, self.doubt = inf, ''
        if self._wraps:
            value = self._unwrapped(value)
        # Seconds that the way from the last values takes; NaN where there is no reading.
        needed = (np.abs(value - self._lasts) - self._slacks) * self._per_speed
        near = np.maximum.reduce(needed) <= MARGIN * (passed + GRACE)
        if not near and gap <= self.timeout and (self.moving or self._since != inf):
            far = needed > MARGIN * (passed + GRACE)
            far[self._free + self._off] = False
            if far.any():
                return self._refusal(value, far, now, passed)
        if self._stuck or self._free:
            same = value == self._raws
            if not same.all():
                counted = np.where(same, self._repeated + 1, 0)
                for index in self._free:
                    if same[index] and self._mechanism.actuators[index].name in self.braked:
                        counted[index] = self._repeated[index]
                self._repeated = counted
            self._raws = value
            silent, near = np.isnan(value), False
            silent[self._free] |= self._repeated[self._free] >= FROZEN
            lasts, value = np.where(silent, self._lasts, value), np.where(silent, np.nan, value)
            value[self._stuck] = lasts[self._stuck]
            self.sensorless = self._none.copy()
            self.sensorless[self._stuck + self._free] = silent[self._stuck + self._free]
        self._lasts = value if near else np.where(np.isnan(value), self._lasts, value)
        self.value, self.deadline = value, now + self.timeout
        return None

    def _unwrapped(self, values: FloatArray) -> FloatArray:
        """Return ``values`` (N,) nearest to the last ones, in whole periods."""
        if np.isnan(self._lasts).all():
            return self._turns(values, self._places)
        near = np.where(np.isnan(self._lasts), self._places, self._lasts)
        with np.errstate(invalid='ignore'):  # infinite periods
            turned = values + np.round((near - values) / self._periods) * self._periods
        return np.where(np.isfinite(self._periods), turned, values)

    def _refusal(
        self, values: FloatArray, far: BoolArray, now: float, passed: float
    ) -> Notice:
        """Return why ``values`` (N,) are not believed, and note it."""
        parts = []
        for index in np.flatnonzero(far).tolist():
            drive, jump = self._mechanism.actuators[index], values[index] - self._lasts[index]
            text = f'{drive.name} by {jump:.3g} {"rad" if drive.kind == "revolute" else "m"}'
            turns = jump / (2.0 * pi)
            if drive.kind == 'revolute' and abs(turns - round(turns)) < WHOLE_TURNS:
                text += ' (whole turns: give its `period` in the mechanism file)'
            parts.append(text)
        text = f'readings jump: {", ".join(parts)} in {1e3 * passed:.0f} ms; not believed'
        self._refused, self._since = now, min(self._since, now)
        if now - self._since > self.timeout:
            self.doubt = text
        return Notice('jump', text)


def _speed(drive: Actuator) -> float:
    """Return how fast a ``drive`` may be read to move, rad/s or m/s."""
    if not isinf(drive.velocity):
        return drive.velocity
    # Nobody has said: half a stroke, or half a turn, from one reading to the next is too much.
    stroke = drive.position[1] - drive.position[0]
    if not isinf(stroke):
        return 0.25 * stroke / GRACE
    return 0.25 * pi / GRACE if drive.kind == 'revolute' else inf
