# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Initial turn of wrapping encoders: the combination for which the loops close."""

from __future__ import annotations

from heapq import heappop, heappush
from math import isfinite

import numpy as np

from fault_tolerance.control.control_model import ControlModel
from fault_tolerance.control.estimate import estimate
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray

AGREEMENT = 1e-3
"""Characteristic lengths; readings that contradict each other by less are of the right turns."""

MAX_PERIODS = 3
"""Periods to either side that are looked at where nothing limits the stroke."""

TRIES, TRIES_IN_PYTHON = 250, 50
"""Combinations that are tried until one closes the loops: 20 ms, and a second in Python. Without
one the mechanism holds."""

FURTHER_TRIES = 5
"""Combinations tried after the first that closes the loops, for one that agrees better."""


def closing_turns(
    model: ControlModel, values: FloatArray, near: FloatArray, failures: FailureSet
) -> FloatArray:
    """Return joint ``values`` (N,) with whole periods added, such that the loops close.

    Of those within the strokes the nearest to ``near`` (N,), where the drives were last, or home,
    with which the loops close, or one little farther away with which redundant readings agree;
    where they never close, the nearest. Readings of drives without redundancy fit any turn.
    ``model`` and ``failures`` are as in `estimate`; values are from home, rad or m, NaN where
    there is no reading.
    """
    mechanism = model.mechanism
    choices = [
        _choices(value, drive.period, drive.position, place)
        for value, drive, place in zip(
            values.tolist(), mechanism.actuators, near.tolist(), strict=True)
    ]
    limit = AGREEMENT * mechanism.characteristic_length
    closing: FloatArray | None = None
    begin = (0,) * len(choices)
    queue, known = [(0.0, begin)], {begin}
    left = TRIES if model.kernel.compiled else TRIES_IN_PYTHON
    while queue and left > 0:
        _, chosen = heappop(queue)
        turned = np.array([some[one] for some, one in zip(choices, chosen, strict=True)])
        tried = estimate(model, model.unknown, turned, failures)
        if not tried.hold_reason:
            if tried.misfit <= limit:
                return turned
            if closing is None:
                closing, left = turned, FURTHER_TRIES + 1
        left -= 1
        for place, some in enumerate(choices):
            following = (*chosen[:place], chosen[place] + 1, *chosen[place + 1:])
            if following[place] < len(some) and following not in known:
                known.add(following)
                away = np.array([some[one] for some, one in zip(choices, following, strict=True)])
                distance = np.linalg.norm(np.nan_to_num(mechanism.rate_scale * (away - near)))
                heappush(queue, (float(distance), following))
    return np.array([some[0] for some in choices]) if closing is None else closing


def _choices(
    value: float, period: float, stroke: tuple[float, float], near: float
) -> list[float]:
    """Return what a reading may mean within a stroke, the nearest to ``near`` first."""
    if not (isfinite(value) and isfinite(period)):
        return [value]
    farthest = MAX_PERIODS * period
    low, high = max(stroke[0], near - farthest), min(stroke[1], near + farthest)
    turns = np.arange(np.ceil((low - value) / period), np.floor((high - value) / period) + 1.0)
    return sorted((value + turns * period).tolist(), key=lambda one: abs(one - near)) or [value]
