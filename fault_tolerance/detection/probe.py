# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The self-stress probe: drives push against each other for a moment, by a little.

A healthy platform stays where it is. A drive that holds nothing, a lost strut and a stuck drive
give way, and the encoders show it (docs/detection.md, section 4).
"""

from __future__ import annotations

from math import pi, sin

import numpy as np

from fault_tolerance.detection.responses import Responses
from fault_tolerance.mechanism.arrays import FloatArray

SAMPLES = 64
"""Readings a sequence takes."""

SLOWEST, SPACING = 5, 2
"""Periods of the slowest tone in a sequence, and how many more each further one has."""

STROKE_SHARE = 1e-3
"""The largest amplitude, of a stroke."""

CLEARANCE = 10.0
"""Amplitudes that must be left to the ends of the strokes."""


def probe_amplitude(stiffness: float, force: float, stroke: float) -> float:
    """Return the amplitude of a probe, metres.

    ``stiffness`` is the largest of a drive, N/m, ``force`` the largest extra force on any drive,
    N, ``stroke`` the shortest one, metres.
    """
    return min(force / stiffness, STROKE_SHARE * stroke)


MOST_FROM_PROBE = 100.0
"""Evidence that one probe can make: beyond, its noise is not known well enough."""

OVERTAKING = 2.0
"""How much faster than its tones a probe goes, to make good what late readings have left."""

POLYNOMIAL = 5
"""Degree of the polynomial that stands for the task during a probe."""


class Probe:
    """One probing sequence: a tone for each direction of self-stress.

    The tones are orthogonal over the sequence, begin and end at zero, and are commanded from
    where the setpoints really are, so that nothing is left over.

    Parameters
    ----------
    directions : (N, r) array
        Orthonormal motions of the setpoints, metres, that move nothing.
    amplitude : float
        Metres.
    period : float
        Seconds between two readings.

    Attributes
    ----------
    directions : (N, r) array
    """

    def __init__(self, directions: FloatArray, amplitude: float, period: float) -> None:
        count = directions.shape[1]
        self.directions = directions
        self._amplitude = amplitude / max(np.abs(directions).sum(axis=1).max(initial=0.0), 1.0)
        self._period, self._done = period, 0
        self._tones = [SLOWEST + SPACING * place for place in range(count)]
        fastest = 2.0 * pi * max(self._tones, default=0) / (SAMPLES * period)
        self._fastest = OVERTAKING * amplitude * fastest
        self._moved = np.zeros(len(directions))

    @property
    def over(self) -> bool:
        """Whether the sequence is complete."""
        return self._done > SAMPLES

    def rates(self, moved: FloatArray) -> FloatArray:
        """Return the rates (N,) until the next reading, m/s.

        ``moved`` (N,) is how far the last rates have moved the setpoints, metres.
        """
        self._moved = self._moved + moved
        self._done += 1
        phase = 2.0 * pi * min(self._done, SAMPLES) / SAMPLES
        tones = np.array([sin(tone * phase) for tone in self._tones])
        wanted = self.directions @ (self._amplitude * tones)
        rates = (wanted - self._moved) / self._period
        over = float(np.abs(rates).max(initial=0.0)) / self._fastest
        return np.asarray(rates / max(over, 1.0))


class ProbeRecord:
    """What the sensors showed during a probe, and how well each hypothesis explains it.

    The task goes on meanwhile. Its motions are slower than the tones: what the model gets wrong
    of them is taken for a polynomial of time, and what is left beside tones and polynomial is the
    noise that they are judged by.
    """

    def __init__(self) -> None:
        self._strange: list[FloatArray] = []
        self._moved: list[FloatArray] = []
        self._explained: list[FloatArray] = []

    def add(self, readings: FloatArray, moved: FloatArray, explained: FloatArray) -> None:
        """Take ``readings`` (c,), what ``moved`` (N,), what a healthy machine ``explained``."""
        self._strange.append(readings)
        self._moved.append(moved)
        self._explained.append(explained)

    def reach(self, strain: FloatArray) -> float:
        """Return how far the task has moved any setpoint meanwhile, metres.

        ``strain`` (N, r) are the orthonormal directions of the probe.
        """
        setpoints = np.cumsum(self._moved, axis=0)
        return float(np.ptp(setpoints - setpoints @ strain @ strain.T, axis=0).max())

    def odds(self, found: Responses, strain: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the log-likelihood of every hypothesis of ``found`` (h,), up to a constant.

        ``strain`` (N, r) are the orthonormal directions of the probe, ``noise`` (c,) is the
        standard deviation of each channel, metres, 0 where there is none. Zeros if too little has
        been recorded.
        """
        setpoints = np.cumsum(self._moved, axis=0) @ strain
        strange = np.array(self._strange) - np.cumsum(self._explained, axis=0)
        count, tones = setpoints.shape
        heard = (noise > 0.0) & np.isfinite(strange).all(axis=0)
        time = np.linspace(-1.0, 1.0, count)
        design = np.hstack([np.polynomial.legendre.legvander(time, POLYNOMIAL), setpoints])
        freedom = count - design.shape[1]
        if freedom < tones or not heard.any():
            return np.zeros(len(found.hypotheses))
        shown, *_ = np.linalg.lstsq(design, strange[:, heard], rcond=None)
        left = strange[:, heard] - design @ shown
        variance = np.maximum((left**2).sum(axis=0) / freedom, noise[heard] ** 2)
        inverse = np.linalg.inv(design.T @ design)[-tones:, -tones:]
        information = np.linalg.inv(inverse)
        expected = (found.matrices - found.matrices[0])[:, heard] @ strain
        off = shown[-tones:].T - expected
        odds = -0.5 * np.einsum('hci,ij,hcj,c->h', off, information, off, 1.0 / variance)
        return np.asarray(np.maximum(odds - odds.max(), -MOST_FROM_PROBE))
