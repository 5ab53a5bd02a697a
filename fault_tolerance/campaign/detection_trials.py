# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What detection makes of many healthy cycles, and how soon it names a failure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import log
from typing import Any

import numpy as np

from fault_tolerance.campaign.healthy_machine import NO_FLAWS, Flaws, healthy_cycles
from fault_tolerance.campaign.replaying import BINS, PER_UNIT, replay
from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.detection.filter_bank import CYCLES
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.kernel.compilation import around, best_kernel
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.simulation.reference import Circle, Step

PERIOD = 0.01
"""Seconds between two joint states of a trial."""

WARM_UP, PATIENCE = 1.8, 2.0
"""Seconds before a failure, and those it may take to be noticed."""

LEVELS = tuple(range(2, 26))
"""Thresholds of which is noted when the evidence for any failure has passed them."""


@dataclass(frozen=True)
class HealthyRun:
    """Many cycles of a healthy ``mechanism``: ``cycles`` of them, with model errors or without.

    ``key`` and ``entropy`` make its random numbers, whoever runs it.
    """

    mechanism: str
    cycles: int
    key: tuple[int, ...]
    entropy: int
    flawed: bool = True


@dataclass(frozen=True)
class FailureRun:
    """Trials of one failure that nobody reports, in closed loop.

    ``fault`` is a word of the fault injection topic. ``amplitude`` is that of the circle (radians,
    1 Hz), or, where ``probing``, that of a probe of the machine at rest (metres). Each of the
    ``trials`` breaks another drive, at another time, with other noise.
    """

    mechanism: str
    fault: str
    amplitude: float
    probing: bool
    trials: int
    key: tuple[int, ...]
    entropy: int


Run = HealthyRun | FailureRun


def result_of(run: Run) -> dict[str, Any]:
    """Carry out a ``run``; return what came of it, as plain values for JSON.

    Parameters
    ----------
    run : HealthyRun or FailureRun

    Returns
    -------
    dict
    """
    return _healthy(run) if isinstance(run, HealthyRun) else _failing(run)


@cache
def _replay() -> Callable[..., int]:
    return around(replay, best_kernel())


def _healthy(run: HealthyRun) -> dict[str, Any]:
    rng = np.random.default_rng(np.random.SeedSequence(run.entropy, spawn_key=run.key))
    flaws = Flaws() if run.flawed else NO_FLAWS
    made = healthy_cycles(run.mechanism, run.cycles, rng, flaws)
    count = len(made.found.hypotheses)
    heights = np.zeros((count, BINS + 1))
    unexplained = _replay()(
        made.found.matrices, made.found.drift, made.jumps, made.found.load, made.noises,
        made.moved, made.readings, np.tile(made.readings[0], (count, 1)), made.noises[0] ** 2,
        np.zeros(count), np.zeros(count), heights,
    )
    # What is up at the end has not come back, and counts as well.
    rows = np.flatnonzero(heights[:, BINS])
    heights[rows, np.minimum(PER_UNIT * heights[rows, BINS], BINS - 1).astype(int)] += 1.0
    histogram = heights[:, :BINS].sum(axis=0)
    highest = int(np.flatnonzero(histogram).max(initial=0))
    worst = int(heights[:, highest].argmax()) if histogram.any() else 0
    threshold = log(count * CYCLES)
    return {
        'mechanism': run.mechanism,
        'cycles': len(made.moved),
        'hypotheses': count,
        'threshold': threshold,
        'alarms': int(histogram[int(PER_UNIT * threshold) :].sum()),
        'highest': highest / PER_UNIT,
        'highest_of': str(made.found.hypotheses[worst]),
        'unexplained': int(unexplained),
        'histogram': histogram.astype(int).tolist(),
    }


@cache
def _warm_loop(mechanism: str, amplitude: float, probing: bool) -> ClosedLoop:
    """Return a loop that has been at work for a while."""
    monitor = MonitorSettings('advise', probe_amplitude=amplitude if probing else 0.0)
    reference = Step((0.0, 0.0)) if probing else Circle(amplitude, 1.0)
    loop = ClosedLoop(
        mechanism_named(mechanism), reference,
        LoopSettings(period=PERIOD, lead=0.6 * PERIOD, monitor=monitor),
    )
    loop.run(WARM_UP)
    return loop


def _failing(run: FailureRun) -> dict[str, Any]:
    warm = _warm_loop(run.mechanism, run.amplitude, run.probing)
    mechanism = warm.mechanism
    names = mechanism.strut_names if run.fault == 'lost' else mechanism.actuator_names
    delays: list[int | None] = []
    passed: list[dict[int, int]] = []
    wrong = 0
    for number in range(run.trials):
        rng = np.random.default_rng(
            np.random.SeedSequence(run.entropy, spawn_key=(*run.key, number))
        )
        loop = warm.forked(int(rng.integers(2**31)))
        loop.run(float(rng.uniform(PERIOD, 1.0)))
        name = names[int(rng.integers(len(names)))]
        loop.inject(f'silent {run.fault} {name}')
        delay, levels = _watched(loop, run.probing)
        found = loop.monitor.detector.suspicions
        forming = loop.monitor.detector.forming
        last = found[0] if found else forming
        part = mechanism.strut_of(name) if name in mechanism.actuator_names else name
        if last is not None and part not in last.parts:
            wrong += 1
        delays.append(delay)
        passed.append(levels)
    return {
        'mechanism': run.mechanism, 'fault': run.fault, 'amplitude': run.amplitude,
        'probing': run.probing, 'delays': delays, 'wrong': wrong,
        'passed': [{str(level): cycle for level, cycle in one.items()} for one in passed],
    }


def _watched(loop: ClosedLoop, probing: bool) -> tuple[int | None, dict[int, int]]:
    """Return after how many cycles something is suspected, and when thresholds were passed."""
    detector, levels = loop.monitor.detector, dict[int, int]()
    if probing:
        loop.monitor.prober.request()
    for cycle in range(1, round(PATIENCE / PERIOD) + 1):
        loop.run(PERIOD)
        if detector.suspicions or detector.forming:
            levels.update({level: cycle for level in LEVELS if level not in levels})
            return cycle, levels
        highest = max(detector.evidence.values())
        levels.update({
            level: cycle for level in LEVELS if level <= highest and level not in levels
        })
    return None, levels
