# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether readings show that a brake holds a limp drive.

A brake is engaged where a limp drive leaves the platform free to move. Then standing still proves
nothing, whatever the other drives do; an abrupt stop after the drive moved under load does: a
brake ends that motion at once, while springs, friction and damping bring it to rest slowly.
"""

from __future__ import annotations

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.parts import Actuator

LEAST_TRAVEL = 1e-5
"""Characteristic lengths that a drive must have moved while it was limp."""

NOISE_BAND = 6.0
"""Standard deviations of the noise within which a drive stands. Noise leaves them once in 5e8
readings."""

TRAVEL_BAND = 0.02
"""Share of the travel within which a drive stands."""

TRAVEL_PER_NOISE = 200.0
"""Standard deviations of the noise that the travel must be."""

ABRUPT = 1.15
"""The time that the second half of the travel takes, over that of the first half.

Both are less `TRAVEL_BAND`; standing before the motion does not count. Steady motion that is cut
off has 1, and less if it gets faster. What comes to rest by itself takes longer: 1.7 at a turning
point, 2 by friction, 2.8 and more on a damped spring.
"""

LEAST_STAND = 0.3
"""Seconds for which it must have stood."""

STAND_PER_MOTION = 3.0
"""Times as long as it moved for which it must have stood."""

STROKE_END = 0.02
"""Share of the stroke beside its ends where a limp drive stands without a brake; of the
characteristic length where the stroke has one end only."""

GIVEN_WAY = 1e-4
"""Characteristic lengths after which a drive that moves is not held; or its travel, if longer."""

MOST_READINGS = 2000
"""Readings kept. Beyond, every second one goes, and of further ones as many are left out: the
course is kept from its beginning, evenly, as finely as its length needs."""

EVALUATION_PERIOD = 0.015
"""Seconds between two evaluations, which take a quarter of a millisecond."""

_LEAST_READINGS = 4


class BrakeEvidence:
    """Collects what a limp ``drive`` reads, and says whether it is held.

    ``unit`` is the characteristic length, in the unit of the drive (m or rad).
    """

    def __init__(self, drive: Actuator, unit: float) -> None:
        self._drive, self._unit = drive, unit
        self._course: list[tuple[float, float]] = []
        self._stride, self._skipped = 1, 0
        self._evaluated_at = -np.inf
        self.travel = 0.0
        """How far it moved while it was limp, m or rad, as far as is known."""
        self.held_at: float | None = None
        """Where it is held, m or rad; None where that has not been shown."""
        self.refuted = False
        """Whether it has moved though it seemed to be held; then readings prove nothing more."""

    def add(self, now: float, value: float) -> None:
        """Take what the drive reads ``now`` (s): ``value``, m or rad from home."""
        if self._course and now < self._course[-1][0]:  # the clock was set back
            self._course, self._stride, self._evaluated_at = [], 1, -np.inf
        self._skipped += 1
        if np.isfinite(value) and self._skipped >= self._stride:
            self._course.append((now, value))
            self._skipped = 0
            if len(self._course) > MOST_READINGS:
                del self._course[1::2]
                self._stride *= 2

    @property
    def has_moved(self) -> bool:
        """Whether it has moved while it was limp: else standing proves nothing."""
        return self.travel >= LEAST_TRAVEL * self._unit

    def refutes(self, value: float) -> bool:
        """Return whether a drive that was held has moved for the first time, by its ``value``."""
        limit = max(self.travel, GIVEN_WAY * self._unit)
        moved = (
            self.held_at is not None and not self.refuted and abs(value - self.held_at) > limit
        )
        self.refuted |= moved
        return moved

    def shows_a_stop(self, engaged_at: float) -> bool:
        """Return whether it has been held since its brake was commanded, at ``engaged_at`` (s)."""
        if self.refuted or len(self._course) < 2 * _LEAST_READINGS:
            return False
        if self._course[-1][0] < self._evaluated_at + EVALUATION_PERIOD:
            return False
        self._evaluated_at = self._course[-1][0]
        times, values = np.array(self._course).T
        end = float(np.median(values[-_LEAST_READINGS:]))
        self.travel = abs(end - values[0])
        noise = _noise(values)
        if self.travel < TRAVEL_PER_NOISE * noise or not self.has_moved or self._at_an_end(end):
            return False
        band = max(NOISE_BAND * noise, TRAVEL_BAND * self.travel)
        gone, left = np.abs(values - values[0]), np.abs(values - end)
        # The last reading before it began to move, and before it stood.
        first, last = int(np.argmax(gone > band)) - 1, int(np.flatnonzero(left > band)[-1])
        if last - first < _LEAST_READINGS or last >= len(values) - _LEAST_READINGS:
            return False
        middle = int(np.flatnonzero(left > 0.5 * self.travel)[-1])
        begun, whole = _crossing(times, gone, first, band), _crossing(times, left, last, band)
        half = _crossing(times, left, middle, 0.5 * self.travel)
        stood = times[-1] - times[last + 1]
        held = bool(
            whole >= engaged_at
            and whole - half <= ABRUPT * (half - begun)
            and stood >= max(LEAST_STAND, STAND_PER_MOTION * (whole - times[0]))
        )
        self.held_at = end if held else None
        return held

    def _at_an_end(self, value: float) -> bool:
        low, high = self._drive.position
        stroke = high - low
        margin = STROKE_END * (stroke if np.isfinite(stroke) else self._unit)
        return not low + margin < value < high - margin


def _noise(values: FloatArray) -> float:
    """Return the standard deviation of what is read (k,), whatever steady motion there is."""
    bends = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(bends)) / np.sqrt(6.0))


def _crossing(times: FloatArray, ways: FloatArray, index: int, limit: float) -> float:
    """Return when ``ways`` (k,) pass a ``limit``, between ``index`` and the next of the times."""
    share = (limit - ways[index]) / (ways[index + 1] - ways[index])
    return float(times[index] + share * (times[index + 1] - times[index]))
