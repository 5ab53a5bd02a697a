# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Controller and simulated mechanism in one loop without ROS: deterministic, seeded, fast.

The same parts the nodes run, stepped by one clock. The only place below the nodes where control
and simulation meet.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np

from fault_tolerance.control.failure_ledger import ClearOutcome
from fault_tolerance.control.failure_reports import ERROR, OK, Report
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import MOVING, State
from fault_tolerance.control.step_output import Output
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.detection.monitor import Monitor
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.sighting import Sighting
from fault_tolerance.detection.suspicion import DETECTION, Suspicion
from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.engines import plant_named
from fault_tolerance.simulation.faults import FaultBook, fault_command
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.pointing import PointingLoop, platform_error
from fault_tolerance.simulation.reference import Circle, Reference
from fault_tolerance.simulation.state import Plant, PlantState


@dataclass(frozen=True)
class LoopSettings:
    """How the loop is closed.

    Attributes
    ----------
    period : float
        Seconds between two joint states.
    lead : float
        Seconds by which the feedforward runs ahead, to make up for the drives' lag.
    pointing : PointingLoop
    control : Settings
    plant : PlantSettings
    monitor : MonitorSettings
        How failures that nobody reports are looked for; by default they are not.
    seed : int
        Of the sensor noise.
    engine : str
        What simulates the mechanism, one of `simulation.engines.ENGINES`.
    """

    period: float = 0.004
    lead: float = 0.003
    pointing: PointingLoop = PointingLoop()
    control: Settings = Settings()
    plant: PlantSettings = PlantSettings()
    monitor: MonitorSettings = MonitorSettings('off')
    seed: int = 1
    engine: str = 'elastic'


@dataclass(frozen=True, eq=False)
class Trace:
    """What happened, one entry a period.

    ``time`` (k,) is in seconds since the loop was made, ``error`` (k, 2) the reference less the
    true rotation about x and y, radians. ``major_error`` (k, m) is the same for every major
    coordinate: radians, and displacements from home divided by the characteristic length. Of a
    mirror, whose task is to point, it is `error`. ``efforts`` (k, N) are what the actuators push
    with, N or N m, ``rates`` (k, N) those commanded, in the mechanism's order.
    """

    time: FloatArray
    error: FloatArray
    major_error: FloatArray
    efforts: FloatArray
    rates: FloatArray
    states: tuple[State, ...]

    @property
    def error_rms(self) -> float:
        """Root mean square length of the error, radians."""
        return _rms(self.error)

    @property
    def major_error_rms(self) -> float:
        """Root mean square length of the error of the major task."""
        return _rms(self.major_error)

    def peak_force(self, preload: FloatArray) -> float:
        """Return the largest effort beyond ``preload`` (N,), in N or N m."""
        return float(np.abs(self.efforts - preload).max())

    @property
    def mean_efforts(self) -> FloatArray:
        """Mean effort of each actuator (N,)."""
        return np.asarray(self.efforts.mean(axis=0))


class ClosedLoop:
    """A mechanism that follows a reference while parts of it fail and are mended.

    Parameters
    ----------
    mechanism : Mechanism
        With struts, and wx, wy among its task coordinates. What else there is in its task is
        kept where it is at home.
    reference : Reference, optional
        A circle of 1 mrad at 1 Hz by default.
    settings : LoopSettings, optional
    plant : Plant, optional
        Of this mechanism; by default one of `LoopSettings.engine`, as the settings say.

    Raises
    ------
    MechanismError
        If the mechanism cannot point, or is given by its Jacobian.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        reference: Reference | None = None,
        settings: LoopSettings | None = None,
        plant: Plant | None = None,
    ) -> None:
        missing = [name for name in ('wx', 'wy') if name not in mechanism.task.coordinates]
        if missing:
            reason = f'cannot point, {missing[0]} is not among the coordinates'
            raise MechanismError(mechanism.name, 'task', reason)
        self.mechanism = mechanism
        self.settings = chosen = settings or LoopSettings()
        self._reference = reference or Circle()
        self.plant = plant or plant_named(chosen.engine, mechanism, chosen.plant, chosen.seed)
        self.supervisor = Supervisor(mechanism, chosen.control)
        self.monitor = Monitor(mechanism, chosen.monitor, self.supervisor.kernel.advance)
        self._book = FaultBook()
        self._now = 0.0

    def inject(self, words: str) -> None:
        """Break or mend parts, in the words of the fault injection topic, and report it.

        ``words`` are ``[silent] MODE NAME``, as in ``stuck theta_4`` or ``ok all``. FailureError
        if they do not follow the grammar, or there is no such part.
        """
        command = fault_command(self.mechanism, words)
        self.plant.apply(command)
        book = self._book.after(command)
        if book == self._book:
            return
        self._book = book
        reports = [
            Report(('drive', target), target, mode, OK if mode == 'none' else ERROR, self._now)
            for target, mode in book.reports
        ]
        self.supervisor.reports(reports, self._now)

    def clear(self) -> ClearOutcome:
        """Release the failures that are neither reported nor seen any more.

        Returns
        -------
        ClearOutcome
        """
        seen = self.monitor.forget(self.settings.control.report_timeout)
        return self.supervisor.clear(self._now, seen)

    def _listen(self, seen: PlantState, output: Output) -> None:
        """Look for failures that nobody reports, after the command; act on them if that is set."""
        monitor, supervisor, stamp = self.monitor, self.supervisor, round(1e9 * self._now)
        monitor.detector.command(stamp, output.rates)
        estimate = output.estimate
        monitor.observe(
            Sighting(stamp, seen.measured_values, seen.efforts), output.failures, estimate.pose,
            lambda: strut_rows(estimate.configuration), output.state in MOVING,
        )
        reports = [detected(one, self._now) for one in monitor.to_report]
        if reports and supervisor.reports(reports, self._now):
            self.plant.command(supervisor.step(self._now).rates)
            monitor.detector.command(stamp, supervisor.output.rates)
        supervisor.add_probe_rates(monitor.rates)

    def _convert(self) -> None:
        """Engage the brakes and let go the struts that the controller asks for."""
        converter = self.supervisor.converter
        for name in converter.engaged:
            self.inject(f'{"position" if name in converter.brakes else "hard"} {name}')

    def forked(self, seed: int) -> ClosedLoop:
        """Return a copy that goes on from here by itself, with sensor noise of ``seed``."""
        twin = copy.deepcopy(self)
        twin.plant.reseed(seed)
        return twin

    def run(self, duration: float) -> Trace:
        """Let ``duration`` seconds, rounded to whole periods, pass and return what happened."""
        count = max(1, round(duration / self.settings.period))
        task = self.mechanism.task
        time, error = np.zeros(count), np.zeros((count, 6))
        efforts = np.zeros((count, len(self.mechanism.actuators)))
        rates = np.zeros_like(efforts)
        states = []
        for k in range(count):
            self._now += self.settings.period
            now = self._now
            seen = self.plant.step(self.settings.period)
            angle = self._reference.angle(now)
            rate = self._reference.rate(now + self.settings.lead)
            twist = self.settings.pointing.velocity(seen.pose, self.mechanism.origin, angle, rate)
            self.supervisor.task_velocity(twist[task.rows], now)
            self.supervisor.joint_reading(seen.measured_values, now)
            output = self.supervisor.step(now)
            self.plant.command(output.rates)
            self.supervisor.secondary.consider(output, now)
            if self.settings.monitor.detect != 'off':
                self._listen(seen, output)
                output = self.supervisor.output
            shown = self.supervisor.converter.observe(output, now)
            if shown and self.supervisor.reports([shown], now):
                output = self.supervisor.step(now)
                self.plant.command(output.rates)
            if self.supervisor.converter.consider(output, now):
                self._convert()
            time[k] = now
            error[k] = platform_error(seen.pose, self.mechanism.origin, angle)
            efforts[k], rates[k] = seen.efforts, output.rates
            states.append(output.state)
        scale = np.ones(6)
        scale[3:] = 1.0 / self.mechanism.characteristic_length
        major = (error * scale)[:, task.rows[task.major_rows]]
        return Trace(time, error[:, :2], major, efforts, rates, tuple(states))


def detected(suspicion: Suspicion, now: float) -> Report:
    """Return the report that a ``suspicion`` of detection makes to the ledger ``now`` (s)."""
    source = (DETECTION, suspicion.name)
    return Report(source, suspicion.name, suspicion.mode, ERROR, now)


def _rms(vectors: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
