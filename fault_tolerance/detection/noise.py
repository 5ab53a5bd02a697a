# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How noisy the sensors are, learnt from what they read; and whether they read anything at all.

A sensor may accuse only after it has proved itself: before it has been heard for a while, or where
it never changes, nothing is concluded from it.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray

WINDOW = 64
"""Readings from which noise is estimated at a time."""

FEWEST = 16
"""Readings there must be in a window."""

KEPT = 5
"""Windows whose median counts: noise grows and falls slowly."""

MARGIN = 1.3
"""What is assumed, over what is found: an estimate that is too low would raise false alarms."""

SMALLEST = 1e-9
"""The least noise assumed, in characteristic lengths: rounding, and steps of the encoder."""


class SensorNoise:
    """Standard deviations of the channels of sensors.

    Third differences of what motion does not explain are taken: the errors of a model that is a
    little wrong change smoothly, noise does not.

    Parameters
    ----------
    channels : int
    smallest : float
        Metres; the least standard deviation assumed.
    """

    def __init__(self, channels: int, smallest: float) -> None:
        self._smallest = smallest
        self._readings, self._explained = np.zeros((2, WINDOW, channels))
        self._filled = 0
        self._changed = np.zeros(channels, np.bool_)
        self._found: list[FloatArray] = []
        self.deviation = np.zeros(channels)
        """(c,): metres; 0 where a channel has not proved itself."""

    @property
    def ready(self) -> bool:
        """Whether anything is known."""
        return bool(self._found)

    def restart(self) -> None:
        """Begin a new window: the readings that follow do not continue the last ones."""
        self._filled = 0

    def take(self, readings: FloatArray, explained: FloatArray) -> bool:
        """Take one set of ``readings`` (c,), metres, NaN where there is nothing.

        ``explained`` (c,) is the motion that a healthy machine has made since the first reading
        of the window, metres. Returns whether the deviations are new.
        """
        self._readings[self._filled], self._explained[self._filled] = readings, explained
        self._filled += 1
        if self._filled < WINDOW:
            return False
        self._filled = 0
        there = np.isfinite(self._readings)
        first = self._readings[there.argmax(axis=0), np.arange(there.shape[1])]
        self._changed |= (there & (self._readings != first)).any(axis=0)
        found = roughness(self._readings - self._explained)
        for place in np.flatnonzero((there.sum(axis=0) >= FEWEST) & ~np.isfinite(found)).tolist():
            # One that is read less often, as a pose sensor may be.
            rest = (self._readings - self._explained)[there[:, place], place]
            found[place] = roughness(rest[:, None])[0]
        self._found = [*self._found[1 - KEPT :], found]
        typical = np.median(self._found, axis=0)
        proved = self._changed & np.isfinite(typical)
        self.deviation = np.where(proved, np.maximum(MARGIN * typical, self._smallest), 0.0)
        return True


def roughness(strange: FloatArray) -> FloatArray:
    """Return the standard deviation (..., c) of the noise in windows of readings.

    ``strange`` (..., w, c) is what motion does not explain, w readings of c channels, metres.
    """
    third = np.abs(np.diff(strange, 3, axis=-2))
    # Of normal numbers: the median of |x| is 0.6745 sigma, a third difference has 20 sigma^2.
    return np.asarray(np.median(third, axis=-2) / (0.6745 * sqrt(20.0)))
