# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Accepts joint values that can follow from the last ones: unwraps them, rejects jumps."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite, isinf, pi

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.control.timed_input import TimedInput
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator

SPEED_FACTOR = 2.0
"""How much faster than the limit in the mechanism file a joint may be read to move."""

GRACE = 0.02
"""Seconds by which the times between readings may be wrong: messages come in bursts."""

SLACK = 1e-3
"""Jumps up to this are ignored (noise, encoder resolution): characteristic lengths, or radians for
drives that turn."""

FROZEN_READINGS = 3
"""Readings in a row that the encoder of a limp drive repeats while others change, after which it
counts as sensorless. A drive that its brake holds may do that too, so `BrakeEvidence` goes by
`encoder_values`, which are what was read."""

WHOLE_TURNS = 0.02
"""Share of a turn by which a jump may differ from whole turns to be called a wrap."""


class ReadingGate(TimedInput):
    """Accepts joint values as continuations of the last ones.

    Values older than the last ones are rejected. Those of an encoder with a period are unwrapped.
    Values that no drive can have reached since the last reading are rejected; a rejected jump does
    not widen the allowed range for the next reading. Any values are accepted after a gap, after
    `accept_next`, and while the mechanism does not move on command. Limp drives and lost struts go
    as fast as they like.

    ``timeout`` is the seconds without a reading that are a gap; rejections that last longer are a
    `rejection_reason`. ``find_turns``, see `closing_turns`, returns the values with whole periods
    added, given values of ``mechanism`` from home and where its drives were last; it is called for
    the first reading, and after `accept_next`.
    """

    def __init__(
        self, mechanism: Mechanism, timeout: float,
        find_turns: Callable[[FloatArray, FloatArray], FloatArray],
    ) -> None:
        super().__init__('joint state', timeout)
        self._missing_text = 'no usable joint state'
        self._mechanism, self._find_turns = mechanism, find_turns
        drives = mechanism.actuators
        self._per_speed = 1.0 / np.array([_plausible_speed(one) for one in drives])
        self._slacks = SLACK * mechanism.characteristic_length / mechanism.rate_scale
        self._periods = np.array([one.period for one in drives])
        self._wraps = bool(np.isfinite(self._periods).any())
        self._last_places = np.zeros(len(drives))
        self._last_values, self.encoder_values = np.full((2, len(drives)), np.nan)
        """(N,): the last accepted values, also those of sensorless drives."""
        self._repeats = np.zeros(len(drives), np.intp)
        self._none: BoolArray = frozen(np.zeros(len(drives), bool))
        self._stamp = self._received_at = self._rejected_at = -inf
        self._jumping_since = inf
        self.moving = False
        """Whether the mechanism moves on command: else by hand, perhaps."""
        self.rejection_reason = ''
        """Why readings are rejected, where that has lasted; empty otherwise."""
        self.sensorless = self._none
        """(N,): actuators that have failed, not with their struts, and have no usable reading."""
        self.set_failures(FailureSet())

    def accept_next(self) -> None:
        """Accept the next readings, whatever they are."""
        unknown = np.isnan(self._last_values)
        self._last_places = np.where(unknown, self._last_places, self._last_values)
        self._last_values = np.full_like(self._last_values, np.nan)
        self._received_at, self._jumping_since, self.rejection_reason = -inf, inf, ''

    def set_failures(self, failures: FailureSet) -> None:
        """Go by other ``failures`` from the next readings on."""
        # Lists: the first command after a failure waits for this.
        place = self._mechanism.actuator_index
        self._stuck = [place(name) for name in failures.stuck]
        self._free = [place(name) for name in failures.free]
        self._off = [
            place(name) for strut in failures.lost for name in self._mechanism.actuators_of(strut)]
        self.sensorless = self._none
        self._repeats[:] = 0

    def restart_clock(self) -> None:
        """Let the values be stale until the next ones, which are accepted."""
        super().restart_clock()
        self._stamp = -inf
        self.accept_next()

    def offer(self, value: FloatArray, now: float, stamp: float | None) -> Notice | None:
        """Accept joint values, or return why they are rejected.

        ``value`` (N,) is from home, rad or m, NaN where there is none. It was received at ``now``
        (s), and measured at ``stamp`` (s); None and what is ahead count as now. It is kept
        unwrapped; a stuck drive without a reading is where it was last, a limp one NaN.
        """
        given = now if stamp is None or not isfinite(stamp) else min(stamp, now)
        if now - given > self.timeout:
            return self._stale(now - given)
        if given < self._stamp:
            return self._too_old('old', f'{self._stamp - given:.3f} s older than the last')
        gap = now - self._received_at
        passed = max(gap, given - self._stamp)
        self._received_at, self._stamp = now, given
        if self._jumping_since != inf and now - self._rejected_at > self.timeout:
            self._jumping_since, self.rejection_reason = inf, ''
        if self._wraps:
            value = self._unwrapped(value)
        # Seconds that the way from the last values takes; NaN where there is no reading.
        needed = (np.abs(value - self._last_values) - self._slacks) * self._per_speed
        plausible = np.maximum.reduce(needed) <= SPEED_FACTOR * (passed + GRACE)
        if not plausible and gap <= self.timeout and (self.moving or self._jumping_since != inf):
            jumps = needed > SPEED_FACTOR * (passed + GRACE)
            jumps[self._free + self._off] = False
            if jumps.any():
                return self._rejection(value, jumps, now, passed)
        last_read, self.encoder_values = self.encoder_values, value
        if self._stuck or self._free:
            same = value == last_read
            if not same.all():
                self._repeats = np.where(same, self._repeats + 1, 0)
            absent, plausible = np.isnan(value), False
            absent[self._free] |= self._repeats[self._free] >= FROZEN_READINGS
            last = np.where(absent, self._last_values, value)
            value = np.where(absent, np.nan, value)
            value[self._stuck] = last[self._stuck]
            self.sensorless = self._none.copy()
            self.sensorless[self._stuck + self._free] = absent[self._stuck + self._free]
        if not plausible:
            self._last_values = np.where(np.isnan(value), self._last_values, value)
        else:
            self._last_values = value
        self.value, self.deadline = value, now + self.timeout
        return None

    def _unwrapped(self, values: FloatArray) -> FloatArray:
        """Return ``values`` (N,) nearest to the last ones, in whole periods."""
        unknown = np.isnan(self._last_values)
        if unknown.all():
            return self._find_turns(values, self._last_places)
        last = np.where(unknown, self._last_places, self._last_values)
        with np.errstate(invalid='ignore'):  # infinite periods
            turned = values + np.round((last - values) / self._periods) * self._periods
        return np.where(np.isfinite(self._periods), turned, values)

    def _rejection(
        self, values: FloatArray, jumps: BoolArray, now: float, passed: float
    ) -> Notice:
        """Return why ``values`` (N,) are rejected, and note it."""
        parts = []
        for index in np.flatnonzero(jumps).tolist():
            drive = self._mechanism.actuators[index]
            jump = values[index] - self._last_values[index]
            text = f'{drive.name} by {jump:.3g} {"rad" if drive.kind == "revolute" else "m"}'
            turns = jump / (2.0 * pi)
            if drive.kind == 'revolute' and abs(turns - round(turns)) < WHOLE_TURNS:
                text += ' (whole turns: give its `period` in the mechanism file)'
            parts.append(text)
        text = f'readings jump: {", ".join(parts)} in {1e3 * passed:.0f} ms; not believed'
        self._rejected_at, self._jumping_since = now, min(self._jumping_since, now)
        if now - self._jumping_since > self.timeout:
            self.rejection_reason = text
        return Notice('jump', text)


def _plausible_speed(drive: Actuator) -> float:
    """Return how fast a ``drive`` may be read to move, rad/s or m/s."""
    if not isinf(drive.velocity):
        return drive.velocity
    # Without a limit: half a stroke, or a quarter of a turn, at once is too much.
    stroke = drive.position[1] - drive.position[0]
    reach = 0.5 * pi if isinf(stroke) and drive.kind == 'revolute' else 0.5 * stroke
    return reach / (SPEED_FACTOR * GRACE)
