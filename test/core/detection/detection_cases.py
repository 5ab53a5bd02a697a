# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Closed loops with detection, which the tests of it share."""

from __future__ import annotations

import copy
from functools import cache

import pytest

from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.control.settings import Settings
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.suspicion import Suspicion
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.reference import Circle, Reference, Step

PERIOD = 0.01
ENGINES = ('elastic', 'mujoco')
REST = Step((0.0, 0.0))
BRIEF = Settings(report_timeout=0.5)
"""What was said half a second ago is not said any more."""


def loop_of(
    name: str = 'mirror_4_strut',
    reference: Reference | None = None,
    *,
    period: float = PERIOD,
    side: str = 'load',
    engine: str = 'elastic',
    monitor: MonitorSettings | None = None,
    control: Settings | None = None,
    seed: int = 1,
    kind: type[ClosedLoop] = ClosedLoop,
    **plant,
) -> ClosedLoop:
    """Return a loop that listens and only tells, by default."""
    if engine == 'mujoco':
        pytest.importorskip('mujoco')
    mechanism = mechanism_named(name)
    if side != 'load':
        mechanism = mechanism.with_encoders(side)
    return kind(
        mechanism, reference or Circle(1e-3, 1.0),
        LoopSettings(
            period=period, lead=0.6 * period, engine=engine, seed=seed,
            monitor=monitor or MonitorSettings('advise'), control=control or Settings(),
            plant=PlantSettings(encoders=side, **plant),
        ),
    )


@cache
def _warm(name: str, moving: bool, side: str, engine: str) -> ClosedLoop:
    loop = loop_of(name, None if moving else REST, side=side, engine=engine)
    loop.run(1.7)
    assert loop.monitor.detector.ready
    return loop


def warm(name='mirror_4_strut', moving=True, side='load', engine='elastic', seed=2) -> ClosedLoop:
    """Return a copy of a loop that has been running for a while."""
    # As `ClosedLoop.forked` makes it, but for machine code, which is slow to copy: it is shared.
    kernel = best_kernel()
    shared = {id(one): one for one in (kernel, kernel.estimate, kernel.command, kernel.measures,
                                       kernel.advance)}
    twin = copy.deepcopy(_warm(name, moving, side, engine), shared)
    twin.plant.reseed(seed)
    return twin


def probed(loop: ClosedLoop) -> str:
    """Let the loop probe to the end; return what it has found."""
    assert loop.monitor.prober.request() == ''
    while loop.monitor.prober.probing:
        loop.run(loop.settings.period)
    return loop.monitor.prober.finding


def awaited(loop: ClosedLoop, duration: float) -> int:
    """Run until something is suspected; return the number of periods."""
    count = 0
    while not loop.monitor.detector.suspicions and count * loop.settings.period < duration:
        loop.run(loop.settings.period)
        count += 1
    return count


def suspected(loop: ClosedLoop) -> tuple[Suspicion, ...]:
    """Return what has been found, and what is about to be."""
    detector = loop.monitor.detector
    return detector.suspicions + ((detector.forming,) if detector.forming else ())


def named(loop: ClosedLoop) -> list[set[str]]:
    """Return the candidates of everything suspected, as words."""
    return [set(map(str, one.candidates)) for one in suspected(loop)]
