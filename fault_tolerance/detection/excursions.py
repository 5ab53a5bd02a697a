# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Since when there has been evidence for each hypothesis, and how far drives were told to go."""

from __future__ import annotations

import numpy as np

from fault_tolerance.detection.hypotheses import Hypothesis, Symptom
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism

_JUMPS = (Symptom.RUNAWAY, Symptom.BIASED)
"""Symptoms that can appear while the drive is not commanded."""


class Excursions:
    """What happened while the evidence for each of the ``suspects`` was above zero.

    Parameters
    ----------
    mechanism : Mechanism
    suspects : tuple of Hypothesis
        h of them.

    Attributes
    ----------
    onset : (h,) array of int
        When it began to rise, ns.
    travel : (h,) array
        How far all setpoints together were commanded since then, metres.
    """

    def __init__(self, mechanism: Mechanism, suspects: tuple[Hypothesis, ...]) -> None:
        count, names = len(suspects), mechanism.actuator_names
        strut_drives = {one.strut: place for place, one in enumerate(mechanism.actuators)}
        self._drive = np.array([
            names.index(one.name) if one.name in names else strut_drives.get(one.name, 0)
            for one in suspects
        ], dtype=np.intp)
        self._jumps = np.array([one.symptom in _JUMPS for one in suspects], dtype=np.bool_)
        self.onset = np.zeros(count, np.int64)
        self.travel = np.zeros(count)
        self._way, self._reach = np.zeros(count), np.zeros(count)

    def slip(self, strange: FloatArray, breakaway: float) -> None:
        """Begin anew for drives that have just slipped: what sticks again is not stuck.

        ``strange`` (N,) is by how much the encoders moved other than a healthy machine would,
        metres, NaN where there is nothing new; ``breakaway`` as in `beyond`.
        """
        slipped = (np.abs(strange) > 0.5 * breakaway)[self._drive]
        self._way[slipped] = self._reach[slipped] = 0.0

    def take(self, scores: FloatArray, stamp: int, moved: FloatArray) -> None:
        """Take ``scores`` (h,) at ``stamp``, ns, and what ``moved`` (N,) until then, metres."""
        self.travel += np.abs(moved).sum()
        self._way += moved[self._drive]
        np.maximum(self._reach, np.abs(self._way), out=self._reach)
        resting = scores == 0.0
        self.onset[resting] = stamp
        self.travel[resting] = self._way[resting] = self._reach[resting] = 0.0

    def beyond(self, breakaway: float) -> BoolArray:
        """Return for which hypotheses (h,) the drive should long have slipped, were it healthy.

        ``breakaway`` is how far healthy drives may lag before they move, metres.
        """
        return self._jumps | (self._reach >= 2.0 * breakaway)
