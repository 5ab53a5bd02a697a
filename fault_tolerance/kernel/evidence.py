# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A Kalman filter for each hypothesis, and the evidence for each against a healthy machine.

Plain loops, for numba. All filters have the same gains, so the differences of their squared
innovations are log-likelihood ratios. Each is summed up while it is positive (CUSUM): where it is
zero, a filter starts again from that of the healthy machine, so that a sum begins where a failure
does (docs/detection.md, eq. 4-6).
"""

from __future__ import annotations

from math import log

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray

NOISE_SHARE = 0.5
"""Process noise per cycle of a machine at rest, of the sensor noise: it drifts and shakes."""

MODEL_SHARE = 0.1
"""Share of a commanded motion that the model may be wrong by: levers, lags, gains."""

CROSS_SHARE = 0.02
"""Share of the largest motion by which any joint may move that should not: at another place."""

MOST_PER_CYCLE = 14.0
"""What one reading may add to a sum: no single one convicts."""

LOAD_STEP = 15.0
"""Evidence that a step of the load on the platform costs. It explains every motion of the joints
that fits the platform, so what has it as the best explanation is no failure."""

UNEXPLAINED = 36.0
"""Mean squared innovation, in variances, of the best explanation at which all start again."""

FASTEST_DRIFT = 10.0
"""Size of unknown motions per cycle, over the largest commanded one."""

SMALLEST_DRIFT = 20.0
"""The same over the sensor noise, at rest."""

LEAST_COST = 1.5
"""Evidence that an unknown motion costs at least: errors of the model that last must not add up
to one."""

CHANGE_OF_PACE = 0.1
"""Share by which an unknown motion may change in a cycle: what shakes is no runaway drive."""

SLACK = 0.25
"""Evidence that every hypothesis loses per cycle: what the model has wrong lasts, and must not add
up to a failure."""

JUMP_COST = 1.0
"""Evidence that a jump loses per cycle: what has not convicted soon only waits for another."""

REVERSAL = 1e3
"""Evidence that an unknown motion costs which turns round: that is a machine that shakes."""


def advance(
    matrices: FloatArray,
    drift: FloatArray,
    jumps: FloatArray,
    load: FloatArray,
    noise: FloatArray,
    moved: FloatArray,
    before: FloatArray,
    readings: FloatArray,
    levels: FloatArray,
    variance: FloatArray,
    paces: FloatArray,
    scores: FloatArray,
) -> float:
    """Take one set of readings into all filters; return how far the best one was off.

    Parameters
    ----------
    matrices : (h, c, N) array
        Motion of the c channels per motion of the setpoints, see `Responses`; row 0 is healthy.
    drift : (h, c) array
        Directions of unknown motion.
    jumps : (h,) array
        Metres by which a reading may have jumped once, at the onset, or -1 where that could not
        be noticed; 0 for hypotheses of another kind.
    load : (N, n) array
        Orthonormal motions of the encoders under loads on the platform.
    noise : (c,) array
        Standard deviation of each channel, metres; 0 where there is no sensor.
    moved, before : (N,) arrays
        What the setpoints were moved by since the last readings, and between those and the ones
        before them, metres.
    readings : (c,) array
        Metres; NaN where there is nothing new.
    levels : (h, c) array
        The filters' states, changed in place.
    variance : (c,) array
        Their common variance, changed in place.
    paces : (h,) array
        The unknown motions of the last cycle, metres. Changed in place.
    scores : (h,) array
        Sums of the evidence, changed in place.

    Returns
    -------
    float
        Mean squared innovation of the best hypothesis, in variances; above `UNEXPLAINED` the
        readings have only been taken as a new beginning.
    """
    count, channels, drives = matrices.shape
    gain, weight = np.zeros(channels), np.zeros(channels)
    used = _uncertainty(matrices[0], noise, moved, before, readings, variance, gain, weight)
    least = noise[:drives].max()
    small = SMALLEST_DRIFT * least
    for j in range(drives):
        small = max(small, FASTEST_DRIFT * abs(moved[j]))
    misfit, odds, expected = np.zeros(count), np.zeros(count), np.empty((count, channels))
    best = 1e300
    for h in range(count):
        size = small
        if jumps[h] != 0.0:
            size = jumps[h] if scores[h] == 0.0 and jumps[h] > 0.0 else 0.0
        elif scores[h] > 0.0:
            size = CHANGE_OF_PACE * abs(paces[h]) + least
        if jumps[h] != 0.0 or scores[h] == 0.0:
            paces[h] = 0.0
        _predict(
            matrices[h], drift[h], weight, moved, readings, levels[h], size, expected[h],
            misfit, odds, paces, h,
        )
        best = min(best, misfit[h])
    fit = np.zeros(drives)
    beside = _load_step(load, weight, readings, expected[0], fit)
    best = min(best, beside) / max(used, 1.0)
    if best > UNEXPLAINED:
        for c in range(channels):
            if weight[c] > 0.0:
                variance[c] = noise[c] * noise[c]
                levels[:, c] = readings[c]
        return best
    stepped = -0.5 * beside - LOAD_STEP > odds[0]
    if stepped:
        odds[0] = -0.5 * beside - LOAD_STEP
    # What is off the fit, by a share, is explained as well, if nothing explains it better.
    whole = stepped and odds[0] >= odds.max()
    for c in range(channels):
        heard = weight[c] > 0.0
        if heard:
            variance[c] = noise[c] * noise[c] * (1.0 if whole else gain[c])
        if heard and (whole or (stepped and c >= drives)):
            expected[0, c] = readings[c]
        elif stepped and c < drives:
            expected[0, c] += fit[c]
        for h in range(count):
            levels[h, c] = expected[h, c]
            if heard:
                levels[h, c] += gain[c] * (readings[c] - expected[h, c])
    _add_up(odds, jumps, levels, scores)
    return best


def _add_up(odds: FloatArray, jumps: FloatArray, levels: FloatArray, scores: FloatArray) -> None:
    """Add the evidence of one cycle; where nothing is left, start from the healthy filter."""
    highest = odds.max()
    for h in range(1, len(odds)):
        # Capped against the healthy machine, and still ranked.
        step = min(highest - odds[0], MOST_PER_CYCLE) - min(highest - odds[h], MOST_PER_CYCLE)
        step -= JUMP_COST if jumps[h] != 0.0 else SLACK
        scores[h] = max(scores[h] + step, 0.0)
        if scores[h] == 0.0:
            for c in range(levels.shape[1]):
                levels[h, c] = levels[0, c]


def _uncertainty(
    healthy: FloatArray,
    noise: FloatArray,
    moved: FloatArray,
    before: FloatArray,
    readings: FloatArray,
    variance: FloatArray,
    gain: FloatArray,
    weight: FloatArray,
) -> float:
    """Fill in the ``gain`` and the inverse variance (``weight``) of each channel; count them.

    The motion that is expected may be wrong by a share, and may come a cycle late. A channel that
    has not been read keeps a weight of zero, and its variance grows.
    """
    largest, sudden = 0.0, 0.0
    for j in range(len(moved)):
        largest = max(largest, abs(moved[j]))
        sudden = max(sudden, abs(moved[j] - before[j]))
    used = 0.0
    drives = len(moved)
    for c in range(len(noise)):
        if noise[c] <= 0.0:
            continue
        motion, change = 0.0, 0.0
        for j in range(drives):
            motion += healthy[c, j] * moved[j]
            change += healthy[c, j] * (moved[j] - before[j])
        if drives <= c < 2 * drives:  # an effort: it answers to all setpoints, and cancels
            motion = largest
        wrong = MODEL_SHARE * max(abs(motion), abs(moved[c]) if c < drives else 0.0)
        # Lags of the drives: any joint may answer to a sudden motion where something has failed.
        wrong = max(wrong, CROSS_SHARE * largest, MODEL_SHARE * sudden)
        rest = NOISE_SHARE * noise[c]
        predicted = variance[c] + rest * rest + wrong * wrong + change * change
        if readings[c] != readings[c]:
            variance[c] = predicted
            continue
        weight[c] = 1.0 / (predicted + noise[c] * noise[c])
        gain[c] = predicted * weight[c]
        used += 1.0
    return used


def _load_step(
    load: FloatArray,
    weight: FloatArray,
    readings: FloatArray,
    expected: FloatArray,
    fit: FloatArray,
) -> float:
    """Fill in the step of the encoders that fits a load; return the misfit that is left.

    What efforts and the platform do under a load is not known, and counts as explained. A step
    may be off its fit by a share: the mechanism may be a little away from where ``load`` is from.
    """
    drives, count = load.shape
    for k in range(count):
        along = 0.0
        for c in range(drives):
            if weight[c] > 0.0:
                along += load[c, k] * (readings[c] - expected[c])
        for c in range(drives):
            fit[c] += along * load[c, k]
    slack = 0.0
    for c in range(drives):
        slack = max(slack, CROSS_SHARE * abs(fit[c]))
    left = 0.0
    for c in range(drives):
        if weight[c] > 0.0:
            off = readings[c] - expected[c] - fit[c]
            left += off * off / (1.0 / weight[c] + slack * slack)
    return left


def _predict(
    matrix: FloatArray,
    drift: FloatArray,
    weight: FloatArray,
    moved: FloatArray,
    readings: FloatArray,
    level: FloatArray,
    size: float,
    expected: FloatArray,
    misfit: FloatArray,
    odds: FloatArray,
    paces: FloatArray,
    place: int,
) -> None:
    """Fill in what one filter expects, by how much it is off, and the logarithm of its odds.

    An unknown motion along ``drift``, of standard deviation ``size`` about the last pace, is
    estimated from the readings; what it explains counts as explained, and its freedom costs
    evidence.
    """
    along, length, total = 0.0, 0.0, 0.0
    for c in range(len(weight)):
        motion = paces[place] * drift[c]
        for j in range(len(moved)):
            motion += matrix[c, j] * moved[j]
        expected[c] = level[c] + motion
        if weight[c] == 0.0:
            continue
        off = readings[c] - expected[c]
        total += weight[c] * off * off
        along += weight[c] * drift[c] * off
        length += weight[c] * drift[c] * drift[c]
    room = size * size
    if length > 0.0 and room > 0.0:
        share = room / (1.0 + room * length)
        total -= share * along * along
        odds[place] = -max(0.5 * log(1.0 + room * length), LEAST_COST)
        if paces[place] * (paces[place] + share * along) < 0.0:
            odds[place] -= REVERSAL
        paces[place] += share * along
        for c in range(len(weight)):
            expected[c] += share * along * drift[c]
    misfit[place] = total
    odds[place] -= 0.5 * total
