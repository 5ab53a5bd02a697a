# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the evidence of a bank of filters amounts to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.detection.filter_bank import FilterBank
from fault_tolerance.detection.hypotheses import Hypothesis, Symptom
from fault_tolerance.detection.outlook import outlook
from fault_tolerance.detection.responses import Sensors
from fault_tolerance.detection.separation import separators
from fault_tolerance.detection.suspicion import Suspicion, parts_of, with_limp
from fault_tolerance.kernel.evidence import CROSS_SHARE
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.arrays import FloatArray

LEAD = 7.0
"""Logarithm of the odds by which a hypothesis must lead over all that it can be told from."""

_NO_CANDIDATES = (Symptom.HEALTHY, Symptom.HEALED)


@dataclass(frozen=True)
class Conviction:
    """A hypothesis that the evidence convicts.

    Attributes
    ----------
    place : int
        Of the hypothesis in the bank.
    candidates : tuple of Hypothesis
        It, and all that would look the same or explain the readings about as well.
    settled : bool
        Whether it leads over all that it can be told from.
    """

    place: int
    candidates: tuple[Hypothesis, ...]
    settled: bool


def conviction(bank: FilterBank, scores: FloatArray, noise: FloatArray) -> Conviction | None:
    """Return what the evidence convicts; None if it does not suffice.

    Parameters
    ----------
    bank : FilterBank
    scores : (h,) array
        Those that count.
    noise : (c,) array
        Standard deviation of each channel, metres; 0 where there is no sensor.

    Returns
    -------
    Conviction or None
    """
    best = int(scores.argmax())
    if scores[best] <= bank.threshold:
        return None
    suspects = bank.found.hypotheses
    rivals = scores > scores[best] - LEAD
    # What stands still is stuck, and no drive that runs away at no speed.
    plain = rivals & np.array([one.symptom is not Symptom.RUNAWAY for one in suspects])
    if plain.any():
        best, rivals = int(np.where(plain, scores, -1.0).argmax()), plain
    apart = bank.separated(noise > 0.0)[best]
    chosen = rivals | (~apart if not bank.found.drift[best].any() else False)
    order = dict.fromkeys([suspects[best], *(suspects[i] for i in np.flatnonzero(chosen))])
    candidates = [one for one in order if one.symptom not in _NO_CANDIDATES]
    return Conviction(best, with_limp(candidates, suspects), not apart[rivals].any())


def suspicion_of(
    bank: FilterBank, found: Conviction, rows: StrutRows, failures: FailureSet, sensors: Sensors
) -> Suspicion:
    """Return what there is to say of a conviction.

    Parameters
    ----------
    bank : FilterBank
    found : Conviction
        Of this bank.
    rows : StrutRows
    failures : FailureSet
        What is known to have failed.
    sensors : Sensors
        Those there are.

    Returns
    -------
    Suspicion
    """
    place, excursions = found.place, bank.excursions
    return Suspicion(
        found.candidates, float(bank.scores[place]), int(excursions.onset[place]),
        float(excursions.travel[place]), parts_of(rows.mechanism, found.candidates),
        separators(rows, failures, found.candidates, sensors, CROSS_SHARE),
        outlook(rows, failures, found.candidates),
    )
