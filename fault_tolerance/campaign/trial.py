# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""One trial of a campaign: a healthy mechanism at work, then a failure, then what follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fault_tolerance.analysis.campaign import TrialRecord
from fault_tolerance.campaign.cases import is_convertible, is_tolerable
from fault_tolerance.closed_loop import ClosedLoop, LoopSettings, Trace
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.reference import Raster, Reference


@dataclass(frozen=True)
class TrialSettings:
    """How a trial goes; all times in seconds.

    The ``reference`` has a period of 1 s. By default it is a raster, the work of a scanning
    mirror: no feedforward foresees its turns, so that the healthy error is that of a task (some
    microradians) and not the elastic deflection alone, as on a circle.

    After ``warm_up`` from rest, errors count over ``healthy``; the failure happens within
    ``latest`` after that. After a tolerable failure errors count again from ``settling``, over
    ``watched``: the error at the failure itself, about the way of one period, dies away in
    between. A stop is watched for ``stopped``.

    Without ``recovery`` the campaign has to notice. ``seed`` is that of the healthy run. ``clock``
    returns seconds and measures what a recovery takes; 0 is given without it. Best is a clock of
    the thread's own work: others share the machine's cores while a campaign runs.
    """

    reference: Reference = Raster(frequency=1.0)
    warm_up: float = 1.0
    healthy: float = 1.0
    latest: float = 1.0
    settling: float = 1.0
    watched: float = 1.0
    stopped: float = 0.2
    recovery: bool = True
    seed: int = 1
    clock: Callable[[], float] | None = None


class Bench:
    """A healthy mechanism at work, of which every trial gets a copy to break.

    ``mechanism`` has struts, and wx, wy in its task.
    """

    def __init__(self, mechanism: Mechanism, settings: TrialSettings | None = None) -> None:
        self.mechanism = mechanism
        self.settings = settings or TrialSettings()
        control = Settings(recovery=self.settings.recovery, clock=self.settings.clock)
        loop = LoopSettings(control=control, seed=self.settings.seed)
        self._loop = ClosedLoop(mechanism, self.settings.reference, loop)
        self._loop.run(self.settings.warm_up)
        self._healthy = self._loop.run(self.settings.healthy)

    def trial(self, failures: FailureSet, seed: int, group: str = '') -> TrialRecord:
        """Return what comes of ``failures``, all in one period.

        ``seed`` decides when in the reference they happen, and on the noise from then on.
        ``group`` is the group that has failed, if it is one.
        """
        settings, (loop, first) = self.settings, self._broken(failures, seed)
        tolerable = is_tolerable(self.mechanism, failures)
        if first.states[0] is State.STOPPED:
            after = watched = loop.run(settings.stopped)
        else:
            after = loop.run(settings.settling)
            watched = loop.run(settings.watched)
        states = [*first.states, *after.states, *watched.states]
        moved = max(float(np.abs(one.rates).max()) for one in (first, after, watched))
        state, error, convertible = '', 0.0, False
        converter = loop.supervisor.converter
        if not tolerable and (converter.brakes or converter.releases):
            state, error = self._converted(failures, seed)
            convertible = is_convertible(self.mechanism, failures)
        return TrialRecord(
            mechanism=self.mechanism.name,
            failures=';'.join(map(str, failures.failures)),
            tolerable=tolerable,
            states=tuple(dict.fromkeys(state.value for state in states)),
            final_state=states[-1].value,
            largest_rate=moved,
            error_rms=watched.major_error_rms,
            healthy_error_rms=self._healthy.major_error_rms,
            peak_force=max(self._peak_force(one) for one in (first, after, watched)),
            recovery_time_us=1e6 * loop.supervisor.output.reconfiguration_time,
            seed=seed,
            group=group,
            with_conversion=state,
            converted_error_rms=error,
            convertible=convertible,
        )

    def _broken(self, failures: FailureSet, seed: int, **control: Any) -> tuple[ClosedLoop, Trace]:
        """Return a copy of the mechanism with ``failures``, and its first period with them.

        ``control`` are settings of the controller that are changed.
        """
        loop = self._loop.forked(seed)
        if control:
            loop.supervisor.apply_settings(replace(loop.supervisor.settings, **control))
        loop.run(float(np.random.default_rng(seed).uniform(0.0, self.settings.latest)))
        for failure in failures.failures:
            loop.inject(f'{failure.mode.value} {failure.name}')
        return loop, loop.run(loop.settings.period)

    def _converted(self, failures: FailureSet, seed: int) -> tuple[str, float]:
        """Return final state and error where brakes and releases are commanded."""
        loop, _ = self._broken(failures, seed, convert='act')
        loop.run(self.settings.settling)
        watched = loop.run(self.settings.watched)
        return watched.states[-1].value, watched.major_error_rms

    def _peak_force(self, trace: Trace) -> float:
        """Return the largest effort beyond the mean healthy one, N; moments are divided by Lc."""
        excess = np.abs(trace.efforts - self._healthy.mean_efforts)
        return float((excess / _levers(self.mechanism)).max())


def _levers(mechanism: Mechanism) -> FloatArray:
    """Return what turns the efforts of the actuators (N,) into forces when it divides them."""
    turning = [actuator.kind == 'revolute' for actuator in mechanism.actuators]
    return np.where(turning, mechanism.characteristic_length, 1.0)
