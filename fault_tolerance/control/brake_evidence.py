# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether readings show that a brake holds a limp drive.

A brake is asked for where a limp drive leaves the platform free to move. Then the other drives do
not determine what it reads: that it stands is possible whether it is held or not, whatever they
do. What tells is how it came to stand. Under a load it moved by itself, and a brake ends that at
once, while springs, friction and damping bring it to rest slowly.
"""

from __future__ import annotations

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.parts import Actuator

TRAVEL = 1e-5
"""Characteristic lengths that a drive must have moved while it was limp."""

NOISES, STANDING, CLEAR = 6.0, 0.02, 200.0
"""What stands: all readings within so many standard deviations of the noise, or within this share
of the travel. Noise leaves six of them once in 5e8 readings; the travel is `CLEAR` of them."""

ABRUPT = 1.25
"""The time from half of the travel to all of it (less `STANDING`), over that of the first half.

Steady motion that is cut off has 0.96, and less if it gets faster. What comes to rest by itself
takes longer: 1.6 at a turning point, 1.9 by friction, 2.5 and more on a damped spring.
"""

SHORTEST, LONGER = 0.3, 3.0
"""Seconds for which it must have stood, and times as long as it moved."""

END = 0.02
"""Share of the stroke beside its ends where a limp drive stands without a brake; of the
characteristic length where the stroke has one end only."""

REVOKED = 1e-4
"""Characteristic lengths after which a drive that moves is not held; or its travel, if longer."""

MOST = 2000
"""Readings kept. Beyond, every second one goes, and of further ones as many are left out: the
course is kept from its beginning, evenly, as finely as its length needs."""

LOOK = 0.015
"""Seconds between two looks at the readings, which take a quarter of a millisecond."""

_LEAST_READINGS = 4


class BrakeEvidence:
    """Collects what a limp ``drive`` reads, and says whether it is held.

    Parameters
    ----------
    drive : Actuator
    unit : float
        The characteristic length, in the unit of the drive (m or rad).

    Attributes
    ----------
    travel : float
        How far it moved while it was limp, m or rad, as far as is known.
    place : float or None
        Where it is held; None where that has not been shown.
    refuted : bool
        Whether it has moved though it seemed to be held; then readings are no evidence any more.
    """

    def __init__(self, drive: Actuator, unit: float) -> None:
        self._drive, self._unit = drive, unit
        self._course: list[tuple[float, float]] = []
        self._stride, self._skipped = 1, 0
        self.travel = 0.0
        self.place: float | None = None
        self.refuted = False
        self._looked = -np.inf

    def add(self, now: float, value: float) -> None:
        """Take what the drive reads ``now`` (s): ``value``, m or rad from home."""
        if self._course and now < self._course[-1][0]:  # the clock was set back
            self._course, self._stride, self._looked = [], 1, -np.inf
        self._skipped += 1
        if np.isfinite(value) and self._skipped >= self._stride:
            self._course.append((now, value))
            self._skipped = 0
            if len(self._course) > MOST:
                del self._course[1::2]
                self._stride *= 2

    @property
    def has_moved(self) -> bool:
        """Whether it has moved while it was limp, so that standing could mean anything."""
        return self.travel >= TRAVEL * self._unit

    def refutes(self, value: float) -> bool:
        """Return whether a drive that was held is not where it was, now: it reads ``value``."""
        limit = max(self.travel, REVOKED * self._unit)
        moved = self.place is not None and not self.refuted and abs(value - self.place) > limit
        self.refuted |= moved
        return moved

    def shows_a_stop(self, asked: float) -> bool:
        """Return whether it has been held since its brake was ``asked`` for (s)."""
        if self.refuted or len(self._course) < 2 * _LEAST_READINGS:
            return False
        if self._course[-1][0] < self._looked + LOOK:
            return False
        self._looked = self._course[-1][0]
        times, values = np.array(self._course).T
        end = float(np.median(values[-_LEAST_READINGS:]))
        self.travel = abs(end - values[0])
        noise = _noise(values)
        if self.travel < CLEAR * noise or not self.has_moved or self._at_an_end(end):
            return False
        band = max(NOISES * noise, STANDING * self.travel)
        moving = np.flatnonzero(np.abs(values - end) > band)
        last = int(moving[-1]) if len(moving) else 0
        if not _LEAST_READINGS - 1 <= last < len(values) - _LEAST_READINGS:
            return False
        left = np.abs(values[: last + 2] - end)
        half, whole = _fallen(times, left, 0.5 * self.travel), _fallen(times, left, band)
        first = half - times[0]
        stood = times[-1] - times[last + 1]
        held = bool(
            whole >= asked
            and whole - half <= ABRUPT * first
            and stood >= max(SHORTEST, LONGER * (whole - times[0]))
        )
        self.place = end if held else None
        return held

    def _at_an_end(self, value: float) -> bool:
        low, high = self._drive.position
        stroke = high - low
        margin = END * (stroke if np.isfinite(stroke) else self._unit)
        return not low + margin < value < high - margin


def _noise(values: FloatArray) -> float:
    """Return the standard deviation of what is read (k,), whatever steady motion there is."""
    bends = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(bends)) / np.sqrt(6.0))


def _fallen(times: FloatArray, left: FloatArray, limit: float) -> float:
    """Return at which of the ``times`` what is ``left`` (k,) falls below a ``limit`` at last."""
    before = int(np.flatnonzero(left > limit)[-1])
    above, below = left[before: before + 2]
    passed = times[before + 1] - times[before]
    return float(times[before] + (above - limit) / (above - below) * passed)
