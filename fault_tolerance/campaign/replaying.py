# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Many readings at once through the filters of detection, and how high their sums get."""

from __future__ import annotations

import numpy as np

from fault_tolerance.kernel.evidence import UNEXPLAINED, advance
from fault_tolerance.mechanism.arrays import FloatArray

PER_UNIT, HIGHEST = 4, 60
"""Bins of the histogram of sums: how many in a unit, and where the last one begins."""

BINS = PER_UNIT * HIGHEST + 1


def replay(
    matrices: FloatArray,
    drift: FloatArray,
    jumps: FloatArray,
    load: FloatArray,
    noises: FloatArray,
    moved: FloatArray,
    readings: FloatArray,
    levels: FloatArray,
    variance: FloatArray,
    paces: FloatArray,
    scores: FloatArray,
    heights: FloatArray,
) -> int:
    """Take k readings into the filters, as a detector does; return how many nothing explained.

    Plain loops, for `kernel.compilation.around`.

    Parameters
    ----------
    matrices, drift, jumps, load : arrays
        As of `kernel.evidence.advance`, and so ``levels``, ``variance``, ``paces``, ``scores``.
    noises : (w, c) array
        Standard deviation of each channel, metres, in w parts of the readings of equal length.
    moved : (k, N) array
        Motions of the setpoints, metres.
    readings : (k, c) array
        Metres.
    heights : (h, BINS + 1) array
        How often the sum of each hypothesis has risen from zero and come back, by the highest
        value between; the last column is that of the sum that is up now. Changed in place.

    Returns
    -------
    int
    """
    unexplained = 0
    part = (len(moved) + len(noises) - 1) // len(noises)
    before = np.zeros(moved.shape[1])
    for k in range(len(moved)):
        off = advance(
            matrices, drift, jumps, load, noises[k // part], moved[k], before, readings[k],
            levels, variance, paces, scores,
        )
        unexplained += off > UNEXPLAINED
        before = moved[k]
        for h in range(1, len(scores)):
            if scores[h] > heights[h, BINS]:
                heights[h, BINS] = scores[h]
            elif scores[h] == 0.0 and heights[h, BINS] > 0.0:
                heights[h, min(int(PER_UNIT * heights[h, BINS]), BINS - 1)] += 1.0
                heights[h, BINS] = 0.0
    return unexplained
