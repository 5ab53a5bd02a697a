# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A closed loop whose messages are written down as a recorder would, by hand and without ROS."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from fault_tolerance.analysis.bags import write_bag
from fault_tolerance.analysis.recorded_data import Sample
from fault_tolerance.closed_loop import detected
from fault_tolerance.control.failure_reports import ERROR, part_names, report_of
from fault_tolerance.control.joint_states import JointStateReader
from fault_tolerance.control.state_machine import MOVING
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.detection.monitor import Monitor
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.sighting import Sighting
from fault_tolerance.detection.suspicion import DETECTION
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.simulation.engines import plant_named
from fault_tolerance.simulation.faults import fault_command
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.pointing import PointingLoop
from fault_tolerance.simulation.reference import Circle

STORE = get_typestore(Stores.ROS2_JAZZY)
BEGIN = 1_700_000_000_000_000_000
PERIOD = 10_000_000
LATENCY = 400_000
"""Nanoseconds from a joint state to its command."""


def make(kind: str, **fields: Any) -> Any:
    return STORE.types[kind](**fields)


def header(stamp: int, frame: str = '') -> Any:
    time = make('builtin_interfaces/msg/Time', sec=stamp // 10**9, nanosec=stamp % 10**9)
    return make('std_msgs/msg/Header', stamp=time, frame_id=frame)


def sample(topic: str, message: Any, time: int) -> Sample:
    kind = message.__msgtype__
    return Sample(topic, kind, time, bytes(STORE.serialize_cdr(message, kind)))


def joint_state(stamp: int, names: Any, position: Any, velocity: Any, effort: Any,
                frame: str = '') -> Any:
    return make('sensor_msgs/msg/JointState', header=header(stamp, frame), name=list(names),
                position=np.array(position, float), velocity=np.array(velocity, float),
                effort=np.array(effort, float))


def diagnostics(stamp: int, *statuses: tuple[str, str, int, dict[str, str]]) -> Any:
    return make('diagnostic_msgs/msg/DiagnosticArray', header=header(stamp), status=[
        make('diagnostic_msgs/msg/DiagnosticStatus', level=level, name=name, message='',
             hardware_id=part, values=[
                 make('diagnostic_msgs/msg/KeyValue', key=key, value=value)
                 for key, value in values.items()])
        for name, part, level, values in statuses])


class RecordedLoop:
    """The controller's way through its messages, and what a recorder would have of them.

    The same order as in the nodes: step, publish, command, observe. ``namespace`` is empty or
    has a leading slash. With ``parts`` every joint has a message of its own,
    but for those in ``mute``.
    """

    def __init__(self, name='mirror_4_strut', namespace='', detect='advise', answers=True,
                 parts=False) -> None:
        self.mechanism = mechanism_named(name)
        self.namespace, self._answers, self._parts = namespace, answers, parts
        self._plant = plant_named('elastic', self.mechanism, PlantSettings(), 1)
        self.supervisor = Supervisor(self.mechanism)
        self.monitor = Monitor(
            self.mechanism, MonitorSettings(detect), self.supervisor.kernel.advance)
        self._reader = JointStateReader(self.mechanism)
        self._reference, self._pointing = Circle(1e-3, 1.0), PointingLoop()
        self._now = BEGIN
        self._rng = np.random.default_rng(3)
        self.mute: set[str] = set()
        self.samples: list[Sample] = []
        self.evidence: list[dict[str, float]] = []
        self.found: list[dict[str, str]] = []

    @property
    def detector(self):
        return self.monitor.detector

    def write(self, file: Path, without: tuple[str, ...] = ()) -> Path:
        write_bag(file, [one for one in self.samples if not one.topic.endswith(without or ('?',))])
        return file

    def break_silently(self, words: str) -> None:
        self._plant.apply(fault_command(self.mechanism, f'silent {words}'))

    def report(self, mode: str, part: str) -> None:
        """Report a failure between two joint states; the controller answers at once."""
        now = self._now + PERIOD // 2
        message = diagnostics(now, ('drive', part, ERROR, {'failure_mode': mode}))
        # Taken down late: after the joint state that came next.
        self._take('/diagnostics', message, now + PERIOD)
        names = part_names(self.mechanism)
        found = report_of('drive', part, ERROR, mode, 1e-9 * now, prefix='', names=names)
        if self.supervisor.reports([found], 1e-9 * now):
            self._cycle(now)

    def clear(self) -> None:
        """Clear, as the operator does, between two joint states."""
        now = self._now + PERIOD // 2
        self.supervisor.clear(1e-9 * now, self.monitor.forget(3.0))
        self._cycle(now)
        self._tell(now + LATENCY)

    def probe(self) -> str:
        """Return what a probe has found."""
        assert self.monitor.prober.request() == ''
        while self.monitor.prober.probing:
            self._step()
        return self.monitor.prober.finding

    def run(self, seconds: float) -> None:
        for _ in range(round(1e9 * seconds / PERIOD)):
            self._step()

    def _step(self) -> None:
        self._now += PERIOD
        seen = self._plant.step(1e-9 * PERIOD)
        names, mechanism = list(self.mechanism.joint_state_names), self.mechanism
        read = np.array([
            mechanism.readings_from_values(seen.measured_values),
            mechanism.rates_from_readings(seen.measured_rates),
            mechanism.rates_from_readings(seen.efforts)])
        count = 1 if self._parts else len(names)
        parts = [slice(k, k + count) for k in range(0, len(names), count)]
        parts = [part for part in parts if not self.mute.intersection(names[part])]
        messages = [joint_state(self._now + 1000 * k, names[part], *read[:, part])
                    for k, part in enumerate(parts)]
        for message in messages:
            self._take('joint_states', message, self._now + 100_000)
        # The watchdog, now and then: nothing new, and not recorded.
        if self._rng.random() < 0.3:
            self.supervisor.step(1e-9 * (self._now - 1000))
        angle = self._reference.angle(1e-9 * (self._now - BEGIN))
        rate = self._reference.rate(1e-9 * (self._now - BEGIN) + 0.006)
        twist = self._pointing.velocity(seen.pose, mechanism.origin, angle, rate)
        now = self._now + LATENCY
        self.supervisor.task_velocity(twist[mechanism.task.rows], 1e-9 * now)
        failed = self.supervisor.failures.parts
        *_, (values, _) = (
            self._reader.readings(one.name, one.position.tolist(), failed, 1e-9 * now)
            for one in messages)
        stamp = self._now + 1000 * (len(messages) - 1)
        assert self.supervisor.joint_reading(values, 1e-9 * now, 1e-9 * stamp) is None
        self._cycle(now, answers=True)
        output = self.supervisor.output
        estimate = output.estimate
        found = self.monitor.observe(
            Sighting(stamp, estimate.readings,
                     self._reader.efforts(message.name, message.effort.tolist())),
            output.failures, estimate.pose, lambda: strut_rows(estimate.configuration),
            output.state in MOVING)
        self.evidence.append({str(one): odds for one, odds in self.detector.evidence.items()})
        if found:
            suspicion = self.detector.suspicions[-1]
            prefix = f'{self.namespace[1:]}/' if self.namespace else ''
            values = suspicion.values(acting=self.monitor.settings.detect == 'act')
            self.found.append({'hardware_id': prefix + suspicion.name, **values})
            self._take('/diagnostics', diagnostics(now, (
                DETECTION, prefix + suspicion.name, ERROR, values)), now + 2 * LATENCY)
        reports = [detected(one, 1e-9 * now) for one in self.monitor.to_report]
        if reports and self.supervisor.reports(reports, 1e-9 * now):
            self._cycle(now + LATENCY)
        self.supervisor.add_probe_rates(self.monitor.rates)
        if round((self._now - BEGIN) / PERIOD) % 20 == 0:
            self._tell(now + LATENCY)

    def _cycle(self, now: int, *, answers: bool = False) -> None:
        output, mechanism = self.supervisor.step(1e-9 * now), self.mechanism
        rates = output.command.rates
        self._plant.command(rates)
        sent = mechanism.rates_from_readings(rates)
        layout = make('std_msgs/msg/MultiArrayLayout', dim=[], data_offset=0)
        self._take('velocity_controller/commands',
                   make('std_msgs/msg/Float64MultiArray', layout=layout, data=sent), now)
        self.detector.command(now, rates)
        answered = mechanism.readings_from_values(output.estimate.readings)
        self._take('fault_tolerance/joint_commands', joint_state(
            now, mechanism.joint_state_names, answered if answers and self._answers else [],
            sent, [], 'probe' if self.monitor.prober.straining else ''), now + 50_000)

    def _tell(self, now: int) -> None:
        prefix = f'{self.namespace[1:]}/' if self.namespace else ''
        output = self.supervisor.output
        values = {
            'state': output.state.value,
            'failures': ', '.join(map(str, output.failures.failures)),
            'suspected': '; '.join(
                ', '.join(map(str, one.candidates)) for one in self.detector.suspicions),
        }
        self._take('fault_tolerance/metrics', diagnostics(now, (
            'fault_tolerance: mechanism', prefix + self.mechanism.name, 0, values)), now)
        self._take('fault_tolerance/state',
                   make('std_msgs/msg/String', data=output.state.value), now)

    def _take(self, topic: str, message: Any, time: int) -> None:
        full = topic if topic.startswith('/') else f'{self.namespace}/{topic}'
        self.samples.append(sample(full, message, time))
