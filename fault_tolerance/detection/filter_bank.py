# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The filters of hypotheses that compete, and the evidence for each against the first of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import log

import numpy as np

from fault_tolerance.detection.excursions import Excursions
from fault_tolerance.detection.hypotheses import Hypothesis
from fault_tolerance.detection.responses import Responses
from fault_tolerance.detection.separation import separated
from fault_tolerance.detection.sighting import Channels
from fault_tolerance.kernel.evidence import CROSS_SHARE
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism

CYCLES = 3e9
"""Readings without a false alarm, on average: a year at 100 a second."""


class FilterBank:
    """One filter for each hypothesis of ``found``; they wait for `start`.

    Parameters
    ----------
    mechanism : Mechanism
    found : Responses
        The first hypothesis is the one that the others are held against.
    breakaway : float
        Metres by which healthy drives may lag before they slip (stick-slip).

    Attributes
    ----------
    found : Responses
    scores : (h,) array
        Logarithm of the odds of every hypothesis against the first.
    excursions : Excursions
    threshold : float
        The score that convicts.
    """

    def __init__(self, mechanism: Mechanism, found: Responses, breakaway: float) -> None:
        self._mechanism, self._channels = mechanism, Channels(mechanism)
        self._breakaway = breakaway
        self.threshold = log(len(found.hypotheses) * CYCLES)
        self.go_on_with(found)
        self.start(np.zeros(self._channels.count), np.zeros(self._channels.count))

    def go_on_with(self, found: Responses) -> None:
        """Take other responses of the same hypotheses: ``found`` at another place."""
        self.found, self._jumps = found, self._channels.jumps(found)
        self._apart: tuple[BoolArray, BoolArray] | None = None

    def start(self, readings: FloatArray, noise: FloatArray) -> None:
        """Begin anew at ``readings`` (c,), without evidence; ``noise`` (c,) as in `take`."""
        count = len(self.found.hypotheses)
        self._levels, self._last = np.tile(readings, (count, 1)), readings
        self._variance, self._before = noise**2, np.zeros(len(self._mechanism.actuators))
        self._paces, self.scores = np.zeros((2, count))
        self.excursions = Excursions(self._mechanism, self.found.hypotheses)

    @property
    def pace(self) -> float:
        """The largest motion that nobody commands, metres from reading to reading."""
        return float(np.abs(self._paces).max())

    def branch(self, suspects: tuple[Hypothesis, ...]) -> FilterBank:
        """Return a bank of the first hypothesis and ``suspects`` of this one, to go on from here.

        Half of the evidence is left behind.
        """
        found = self.found
        places = [0, *(found.hypotheses.index(one) for one in suspects)]
        branch = FilterBank(self._mechanism, replace(
            found, hypotheses=tuple(found.hypotheses[place] for place in places),
            matrices=found.matrices[places], drift=found.drift[places],
        ), self._breakaway)
        branch._levels, branch._last = self._levels[places], self._last
        branch._variance, branch._before = self._variance.copy(), self._before
        branch._paces, branch.scores = self._paces[places], 0.5 * self.scores[places]
        return branch

    def take(
        self,
        advance: Callable[..., float],
        noise: FloatArray,
        moved: FloatArray,
        readings: FloatArray,
        stamp: int,
    ) -> None:
        """Take one set of readings into all filters.

        Parameters
        ----------
        advance : callable
            `fault_tolerance.kernel.evidence.advance`, or its compiled form.
        noise : (c,) array
            Standard deviation of each channel, metres; 0 where there is no sensor.
        moved : (N,) array
            What the setpoints were moved by since the last readings, metres.
        readings : (c,) array
            Metres; NaN where there is nothing new.
        stamp : int
            Of the readings, nanoseconds.
        """
        found = self.found
        if self._breakaway > 0.0:
            strange = (readings - self._last - found.matrices[0] @ moved)[: len(moved)]
            self.excursions.slip(strange, self._breakaway)
        advance(
            found.matrices, found.drift, self._jumps, found.load, noise, moved, self._before,
            readings, self._levels, self._variance, self._paces, self.scores,
        )
        self.excursions.take(self.scores, stamp, moved)
        self._before, self._last = moved, readings

    def separated(self, heard: BoolArray) -> BoolArray:
        """Return which hypotheses (h, h) differ by more than the model may be wrong by.

        Channels that are ``heard`` (c,) count.
        """
        if self._apart is None or (self._apart[0] != heard).any():
            self._apart = heard, separated(self.found, heard, CROSS_SHARE)
        return self._apart[1]

    def convincing(self, breakaway: float) -> FloatArray:
        """Return the scores (h,), 0 where a healthy drive that sticks may show the same.

        ``breakaway`` is how far healthy drives may lag, metres.
        """
        if breakaway > 0.0:
            return np.where(self.excursions.beyond(breakaway), self.scores, 0.0)
        return self.scores
