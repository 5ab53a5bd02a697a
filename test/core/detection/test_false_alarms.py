# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A healthy machine that is not quite its model raises no alarm, in a million readings."""

from __future__ import annotations

from math import log

import numpy as np
import pytest

from fault_tolerance.detection.detector import CYCLES
from fault_tolerance.detection.hypotheses import hypotheses
from fault_tolerance.detection.responses import responses
from fault_tolerance.detection.separation import task_motions
from fault_tolerance.detection.sighting import Channels
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named

PERIOD = 0.01
NOISE = 2e-9
STRETCH = 1000
"""Readings for which a machine does the same."""


def commanded(rng, motions, count):
    """Return how setpoints are moved from reading to reading (k, N), m, in all kinds of ways."""
    steps = np.empty((count, len(motions)))
    time = PERIOD * np.arange(STRETCH)
    for begin in range(0, count, STRETCH):
        amplitude = 10.0 ** rng.uniform(-8.0, -4.5)
        width = motions.shape[1]
        kind = rng.integers(5)
        frequency = rng.uniform(0.1, 3.0, width)
        phase = rng.uniform(0.0, 2.0 * np.pi, width)
        speed = 2.0 * np.pi * frequency * np.cos(2.0 * np.pi * frequency * time[:, None] + phase)
        if kind == 1:  # raster: there and back at constant speed
            speed = 4.0 * frequency * np.sign(speed)
        elif kind == 2:  # steps
            speed = (rng.random((STRETCH, width)) < 0.02) / (10.0 * PERIOD)
        elif kind == 3:
            speed = np.zeros_like(speed)
        steps[begin : begin + STRETCH] = amplitude * PERIOD * speed @ motions.T
    return steps


def machine(rng, motions, steps):
    """Return the readings (k, N) of a machine with lags, wrong levers, lost commands and loads."""
    count = len(steps)
    lost = rng.random(count) < 0.01
    obeyed = steps.copy()
    for place in np.flatnonzero(lost[1:]) + 1:
        obeyed[place] = obeyed[place - 1]
    jitter = 1.0 + 0.05 * rng.standard_normal(count)
    obeyed *= jitter[:, None]
    late = rng.uniform(0.0, 0.2)
    moved = (1.0 - late) * obeyed
    moved[1:] += late * obeyed[:-1]
    levers = 1.0 + 0.005 * rng.uniform(-1.0, 1.0, steps.shape[1])
    true = np.cumsum(levers * moved, axis=0)
    loads = (rng.random(count) < 5e-4)[:, None] * rng.standard_normal((count, motions.shape[1]))
    true += np.cumsum(1e-7 * loads, axis=0) @ motions.T
    return true + NOISE * rng.standard_normal(true.shape)


@pytest.mark.parametrize(('name', 'count'), [
    ('mirror_3_strut', 250_000), ('mirror_4_strut', 500_000), ('gough_stewart_8', 250_000),
])
def test_a_healthy_machine_raises_no_alarm(name, count):
    mechanism, kernel = mechanism_named(name), best_kernel()
    if not kernel.compiled:
        pytest.skip('a million readings need the compiled kernel')
    rows = home_rows(mechanism)
    suspects = hypotheses(mechanism, FailureSet())
    found = responses(rows, FailureSet(), suspects)
    motions = task_motions(rows, reconfigured(rows, FailureSet()).present)
    rng = np.random.default_rng(7)
    steps = commanded(rng, motions, count)
    readings = machine(rng, motions, steps)
    drives, size = steps.shape[1], len(suspects)
    jumps = Channels(mechanism).jumps(found)
    # The encoders alone: the first channels.
    matrices, drift = (
        np.ascontiguousarray(array[:, :drives]) for array in (found.matrices, found.drift)
    )
    noise = np.full(drives, 1.3 * NOISE)
    levels, variance = np.tile(readings[0], (size, 1)), noise**2
    paces, scores = np.zeros((2, size))
    highest = 0.0
    for place in range(1, count):
        kernel.advance(
            matrices, drift, jumps, found.load, noise, steps[place], steps[place - 1],
            readings[place], levels, variance, paces, scores,
        )
        highest = max(highest, scores.max())
    assert highest < log(size * CYCLES), suspects[scores.argmax()]
