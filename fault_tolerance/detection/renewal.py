# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Tests with each reading whether a fault is still present or has been repaired."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fault_tolerance.detection.filter_bank import FilterBank
from fault_tolerance.detection.hypotheses import Hypothesis, Symptom
from fault_tolerance.detection.responses import Sensors, responses
from fault_tolerance.detection.suspicion import Suspicion, found_in
from fault_tolerance.kernel.evidence import CROSS_SHARE
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.arrays import FloatArray

LEAST = 1e-9
"""Evidence that is never taken away: the pace of what moves by itself is remembered with it."""


class Renewal:
    """Weighs the candidates of a suspicion against a machine in which it has healed.

    A drive that is not commanded shows nothing, and renews nothing.

    Parameters
    ----------
    suspicion : Suspicion
    bank : FilterBank
        In which it was found.
    stamp : int
        Of the readings with which it was found, nanoseconds.
    breakaway : float
        Metres by which healthy drives may lag before they slip (stick-slip).

    Attributes
    ----------
    seen : int
        When the evidence last sufficed to convict, nanoseconds.
    """

    def __init__(
        self, suspicion: Suspicion, bank: FilterBank, stamp: int, breakaway: float
    ) -> None:
        self._suspicion, self._breakaway = suspicion, breakaway
        self._bank = bank.branch(suspicion.candidates)
        self.seen = stamp

    def refresh(
        self, rows: StrutRows, failures: FailureSet, suspicions: tuple[Suspicion, ...]
    ) -> None:
        """Derive the responses anew.

        ``rows`` are of the configuration, ``failures`` those in force, ``suspicions`` all that
        has been found.
        """
        mine = self._suspicion
        others = found_in(one for one in suspicions if one is not mine)
        suspects = (Hypothesis(Symptom.HEALED, mine.name), *mine.candidates)
        self._bank.go_on_with(responses(rows, failures, suspects, Sensors(True, True), others))

    def start(self, readings: FloatArray, noise: FloatArray) -> None:
        """Begin anew at ``readings`` (c,) with ``noise`` (c,), metres."""
        self._bank.start(readings, noise)

    def take(
        self,
        advance: Callable[..., float],
        noise: FloatArray,
        moved: FloatArray,
        readings: FloatArray,
        stamp: int,
    ) -> bool:
        """Take one set of readings; return whether they convict once more.

        ``advance``, ``noise``, ``moved``, ``readings`` and ``stamp`` are those of
        `FilterBank.take`.
        """
        bank = self._bank
        # A filter without evidence would take what it finds moving for a new beginning.
        bank.scores[1:] = np.maximum(bank.scores[1:], LEAST)
        # The model is wrong of motions that nobody commands, too.
        wrong = CROSS_SHARE * bank.pace
        bank.take(advance, np.where(noise > 0.0, noise + wrong, 0.0), moved, readings, stamp)
        if bank.convincing(self._breakaway).max() <= bank.threshold:
            return False
        # What convicts once more has to be shown for the other half.
        bank.scores *= 0.5
        self.seen = stamp
        return True
