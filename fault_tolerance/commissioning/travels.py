# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Travels read per travel commanded, and how long the readings took to follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.commissioning.jogs import Jog
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray

LONGEST_DELAY = 0.5
"""Seconds."""

_DELAYS = np.arange(0.0, LONGEST_DELAY, 1e-3)
_CLEAR = 20.0
"""A motion so many times larger than the noise shows its delay."""

_SIGNIFICANT = 6.0
"""Standard deviations; a smaller travel is none."""


@dataclass(frozen=True, eq=False)
class Travels:
    """What came of m motions, in metres: drives that turn count at the characteristic length.

    Attributes
    ----------
    commanded : (N, m) array
        Travel commanded, in the file's order and signs.
    read : (N, m) array
        Travel read for as much.
    sigma : (N, m) array
        Standard deviation of that.
    rough : (m,) array of bool
        Motions that were cut short: their travels are good to about a quarter.
    """

    commanded: FloatArray
    read: FloatArray
    sigma: FloatArray
    rough: BoolArray

    def __repr__(self) -> str:
        return f'Travels({self.read.shape[1]} motions)'

    @property
    def significant(self) -> BoolArray:
        """Which travels are more than noise, (N, m)."""
        return np.asarray(np.abs(self.read) > _SIGNIFICANT * self.sigma)


def delay_of(jog: Jog, noise: FloatArray) -> float:
    """Return by how many seconds the readings of ``jog`` followed what was commanded.

    NaN where ``noise`` (N,), their standard deviation, hides it. It is the delay with which the
    path commanded fits the path read best: a lag of the drives counts as one.
    """
    scale = np.maximum(noise, 1e-300)
    travel = jog.out / scale
    if jog.stopped or jog.share <= 0.0 or np.linalg.norm(travel) < _CLEAR:
        return float('nan')
    weights = travel / scale / (travel @ travel)
    path = (np.array(jog.values) - jog.values[0]) @ weights
    times, shares = np.array(jog.times), np.array(jog.shares)
    errors = []
    for delay in _DELAYS:
        told = np.interp(times - delay, times, shares, left=0.0)
        errors.append(float(((path * jog.share - told) ** 2).sum()))
    return float(_DELAYS[int(np.argmin(errors))])
