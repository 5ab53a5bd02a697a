# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether readings can follow from the last ones: wraps, jumps, and encoders that fall silent."""

from __future__ import annotations

from math import inf, isinf, pi

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator

MARGIN = 2.0
"""How much faster than the limit in the mechanism file a joint may be read to move."""

GRACE = 0.02
"""Seconds by which the times between readings may be wrong: messages come in bursts."""

SLACK = 1e-3
"""Characteristic lengths (radians for drives that turn) of a jump that is none: noise, steps."""

FROZEN = 3
"""Readings in a row that an encoder repeats while others change, after which it is silent."""

WHOLE_TURNS = 0.02
"""Share of a turn by which a jump may differ from whole turns to be called a wrap."""


class Continuity:
    """Takes joint values as continuations of the last ones.

    Values of an encoder with a period are unwrapped. Values that no drive can have reached since
    the last reading are refused, for as long as they come: the time they have been refused for
    does not make them true. After a gap, where the mechanism did not move on command, and after
    `forget` whatever comes is believed. Limp drives and lost struts go as fast as they like.

    Parameters
    ----------
    mechanism : Mechanism
    timeout : float
        Seconds without a reading that are a gap; refusals that last longer are a `doubt`.

    Attributes
    ----------
    sensorless : (N,) array of bool
        Actuators that have failed, not with their struts, and whose encoders say nothing.
    """

    def __init__(self, mechanism: Mechanism, timeout: float) -> None:
        self._mechanism, self._timeout = mechanism, timeout
        drives = mechanism.actuators
        self._speeds = np.array([_speed(one) for one in drives])
        self._slacks = SLACK * mechanism.characteristic_length / mechanism.rate_scale
        self._periods = np.array([one.period for one in drives])
        self._wraps = bool(np.isfinite(self._periods).any())
        self._lasts, self._raws = np.full((2, len(drives)), np.nan)
        self._repeated = np.zeros(len(drives), np.intp)
        self._failures = FailureSet()
        self._stuck, self._loose = np.zeros((2, len(drives)), bool)
        self._heard = self._stamp = self._refused = -inf
        self._since = inf
        self._text = ''
        self.sensorless: BoolArray = np.zeros(len(drives), bool)

    def forget(self) -> None:
        """Believe the next readings, whatever they are."""
        self._lasts[:], self._heard, self._since = np.nan, -inf, inf

    def doubt(self, now: float) -> str:
        """Return why what is read is not believed ``now`` (s); empty while it is, or but lately.

        Parameters
        ----------
        now : float

        Returns
        -------
        str
        """
        if self._since > now - self._timeout or now - self._refused > self._timeout:
            return ''
        return self._text

    def followed(
        self,
        values: FloatArray,
        now: float,
        stamp: float | None,
        failures: FailureSet,
        moving: bool,
    ) -> tuple[FloatArray, Notice | None]:
        """Return joint values as they are to be understood, or why they are not believed.

        Parameters
        ----------
        values : (N,) array
            From home, rad or m; NaN where there is none.
        now : float
            When they came, seconds.
        stamp : float or None
            When they were measured; None: ``now``.
        failures : FailureSet
            Those in force.
        moving : bool
            Whether the mechanism moves on command: else by hand, perhaps.

        Returns
        -------
        values : (N,) array
            Unwrapped. A stuck drive without a reading is where it was last, a limp one is NaN.
        notice : Notice or None
            Why they are not believed.
        """
        if failures is not self._failures:
            self._note(failures)
        gap = now - self._heard
        given = now if stamp is None else stamp
        passed = max(gap, given - self._stamp) + GRACE
        self._heard, self._stamp = now, max(given, self._stamp)
        if now - self._refused > self._timeout:
            self._since = inf
        if self._wraps:
            values = self._unwrapped(values)
        known = gap <= self._timeout and (moving or not isinf(self._since))
        if known:
            far = np.abs(values - self._lasts) > self._slacks + MARGIN * passed * self._speeds
            if far.any() and (far & ~self._loose).any():
                return values, self._refusal(values, far & ~self._loose, now, passed - GRACE)
        if failures.stuck or failures.free:
            values = self._completed(values)
        self._lasts = np.where(np.isnan(values), self._lasts, values)
        return values, None

    def _note(self, failures: FailureSet) -> None:
        """Prepare what depends on the failures."""
        drives, self._failures = self._mechanism.actuators, failures
        self._stuck = np.array([one.name in failures.stuck for one in drives])
        self._loose = np.array([
            one.name in failures.free or one.strut in failures.lost for one in drives
        ])
        self.sensorless = np.zeros(len(drives), bool)
        self._repeated[:] = 0

    def _unwrapped(self, values: FloatArray) -> FloatArray:
        """Return ``values`` (N,) nearest to the last ones, or to home, in whole periods."""
        near = np.where(np.isnan(self._lasts), 0.0, self._lasts)
        with np.errstate(invalid='ignore'):  # infinite periods
            turned = values + np.round((near - values) / self._periods) * self._periods
        return np.where(np.isfinite(self._periods), turned, values)

    def _completed(self, values: FloatArray) -> FloatArray:
        """Return ``values`` (N,) without those of dead encoders, stuck drives where they were."""
        same = values == self._raws
        if not same.all():
            self._repeated = np.where(same, self._repeated + 1, 0)
        self._raws = values
        loose = self._loose & (self._repeated >= FROZEN)
        silent = np.isnan(values) | loose
        lost = np.array([one.strut in self._failures.lost for one in self._mechanism.actuators])
        self.sensorless = silent & (self._stuck | self._loose) & ~lost
        values = np.where(loose, np.nan, values)
        return np.where(np.isnan(values) & self._stuck, self._lasts, values)

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
        self._text = f'readings jump: {", ".join(parts)} in {1e3 * passed:.0f} ms; not believed'
        self._since = min(self._since, now)
        self._refused = now
        return Notice('jump', self._text)


def _speed(drive: Actuator) -> float:
    """Return how fast a ``drive`` may be read to move, rad/s or m/s."""
    if not isinf(drive.velocity):
        return drive.velocity
    # Nobody has said: half a stroke, or half a turn, from one reading to the next is too much.
    stroke = drive.position[1] - drive.position[0]
    if not isinf(stroke):
        return 0.25 * stroke / GRACE
    return 0.25 * pi / GRACE if drive.kind == 'revolute' else inf
