# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether the evidence of a bank of filters suffices to suspect a failure, and which one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fault_tolerance.detection.filter_bank import FilterBank
from fault_tolerance.detection.hypotheses import Hypothesis, Symptom
from fault_tolerance.detection.outlook import Outlook, outlook
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
    """Return what the ``scores`` (h,) of a ``bank`` convict; None if they do not suffice.

    ``noise`` (c,) is the standard deviation of each channel, metres; 0 where there is no sensor.
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
    """Return what there is to say of a conviction that was ``found`` in a ``bank``.

    ``rows``, the known ``failures`` and the ``sensors`` there are say what it leads to.
    """
    place, excursions = found.place, bank.excursions
    parts, would_separate, ahead = _consequences(rows, failures, found.candidates, sensors)
    return Suspicion(
        found.candidates, float(bank.scores[place]), int(excursions.onset[place]),
        float(excursions.travel[place]), parts, would_separate, ahead,
    )


@lru_cache(maxsize=1)
def _consequences(
    rows: StrutRows, failures: FailureSet, candidates: tuple[Hypothesis, ...], sensors: Sensors
) -> tuple[tuple[str, ...], tuple[str, ...], Outlook | None]:
    """Return parts, what would separate the candidates, and what the worst of them leaves.

    Kept, as while a suspicion is forming every reading asks for the same.
    """
    return (
        parts_of(rows.mechanism, candidates),
        separators(rows, failures, candidates, sensors, CROSS_SHARE),
        outlook(rows, failures, candidates),
    )
