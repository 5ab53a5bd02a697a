# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Detection in the controller node: what it hears, and what it tells.

It works on what goes over the topics, stamps included, so a recording of them gives the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from fault_tolerance.analysis.topics import PROBE
from fault_tolerance.closed_loop import detected
from fault_tolerance.control.failure_reports import ERROR, WARN
from fault_tolerance.control.joint_states import JointStateReader
from fault_tolerance.control.notices import Notice
from fault_tolerance.control.state_machine import MOVING
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.detection.monitor import Monitor
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.prober import AT_REST
from fault_tolerance.detection.sighting import Sighting
from fault_tolerance.detection.suspicion import DETECTION, Suspicion
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.late_service import Answer, LateService
from fault_tolerance.nodes.messages import (
    FAILURE_MODE_KEY,
    diagnostics_to_msg,
    joint_state_to_msg,
    nanoseconds_from_msg,
    pose_from_msg,
    status_to_msg,
)
from fault_tolerance.nodes.parameters import settings_from
from fault_tolerance.nodes.serialised_joint_states import SerialisedJointState
from fault_tolerance.nodes.timeline import TimeLine

PERIOD = 1.0
"""Seconds between two publications of what is suspected."""


class SilentFailures:
    """Feeds a `Monitor`, publishes its suspicions, and answers ``~/probe``.

    Parameters
    ----------
    node : Node
    supervisor : Supervisor
        Whose readings and commands are listened to.
    values : dict
        The parameters of the node by name.
    prefix : str
        Begins the hardware ids, if there is one.
    timeline : TimeLine
    health : Health
        Counts and logs what contradicts reports.
    cycle : callable
        Publishes a command at once; called with the present (seconds).
    """

    def __init__(
        self,
        node: Node,
        supervisor: Supervisor,
        values: dict[str, Any],
        prefix: str,
        timeline: TimeLine,
        health: Health,
        cycle: Callable[[float], None],
    ) -> None:
        self._node, self._supervisor, self._timeline = node, supervisor, timeline
        self._health, self._cycle = health, cycle
        self._mechanism = mechanism = supervisor.mechanism
        settings, pose_topic = settings_from(MonitorSettings, values), values['pose_topic']
        self._clock = node.get_clock()
        self._prefix = f'{prefix}/' if prefix else ''
        self._joints = JointStateReader(mechanism)
        self.monitor = Monitor(mechanism, settings)
        self._pose: FloatArray | None = None
        self._failures = FailureSet()
        self._acted: set[Suspicion] = set()
        self._commands = node.create_publisher(JointState, '~/joint_commands', 10)
        self._diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._service = LateService(node, '~/probe', self._probe)
        if pose_topic:
            node.create_subscription(
                PoseStamped, pose_topic, self._on_pose, qos_profile_sensor_data
            )
        node.create_timer(PERIOD, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def _listening(self) -> bool:
        return self.monitor.settings.detect != 'off'

    def go_on_with(self, settings: MonitorSettings) -> None:
        """Have the ``settings`` count from now on; switched off or on, detection begins anew."""
        if 'off' in {self.monitor.settings.detect, settings.detect}:
            self._service.answer(False, 'detection is off')
            self._supervisor.add_probe_rates(None)
            self.monitor = Monitor(self._mechanism, settings)
        else:
            self.monitor.settings = settings

    def command(self, rates: FloatArray, answered: FloatArray | None = None) -> None:
        """Take the ``rates`` (N,) just published, in the mechanism's units; publish them named.

        ``answered`` (N,) are the readings they answer, from home; None: something else.
        """
        now = self._clock.now()
        self.monitor.detector.command(now.nanoseconds, rates)
        if self.monitor.prober.straining and not rates.any():
            # A hold, perhaps for want of readings: there may be none to end it by.
            self.monitor.prober.interrupt()
            self.monitor.rates = None
            self._supervisor.add_probe_rates(None)
        if self._commands.get_subscription_count():
            mechanism, none = self._mechanism, np.zeros(0)
            self._commands.publish(joint_state_to_msg(
                now.to_msg(), mechanism.joint_state_names,
                none if answered is None else mechanism.readings_from_values(answered),
                mechanism.rates_from_readings(rates), none,
                PROBE if self.monitor.prober.straining else '',
            ))

    def observe(self, message: SerialisedJointState) -> None:
        """Take a joint state, the ``message``, after the command that answers it."""
        if not self._listening:
            return
        output = self._supervisor.output
        self.monitor.detector.advance = self._supervisor.kernel.advance
        estimate, monitor = output.estimate, self.monitor
        sighting = Sighting(
            nanoseconds_from_msg(message) or self._clock.now().nanoseconds,
            estimate.readings,
            self._joints.efforts(message.layout.names, message.efforts), self._pose,
        )
        self._pose, self._failures = None, output.failures
        before = monitor.detector.suspicions
        monitor.observe(
            sighting, output.failures, estimate.pose,
            lambda: strut_rows(estimate.configuration), output.state in MOVING,
        )
        if monitor.to_report:
            self._act(monitor.to_report)
        if monitor.detector.suspicions != before:
            self._tell_changes(before)
        if self._service.awaited and not monitor.prober.probing:
            self._service.answer(True, monitor.prober.finding)
        self._supervisor.add_probe_rates(monitor.rates)

    def look(self) -> None:
        """Answer those who wait for a probe where nothing moves: there may be no more readings."""
        prober, state = self.monitor.prober, self._supervisor.output.state
        if self._service.awaited and state not in MOVING:
            begun = prober.straining or not prober.probing
            prober.interrupt()
            self._service.answer(begun, prober.finding if begun else f'{AT_REST}: {state.value}')

    def suspected(self) -> str:
        """Return the candidates of every suspicion, as text."""
        return self.monitor.suspected

    def values(self) -> dict[str, str]:
        """Return what belongs into the metrics, texts by key."""
        return self.monitor.values()

    def forget(self) -> tuple[str, ...]:
        """Drop what has been found; return what is still seen, in the words of the ledger."""
        return self.monitor.forget(self._supervisor.settings.report_timeout)

    def _act(self, suspicions: Sequence[Suspicion]) -> None:
        """Handle what has been found, or seen again, as any report."""
        now = self._timeline.now()
        self._acted = self._acted.intersection(self.monitor.detector.suspicions).union(suspicions)
        if self._supervisor.reports([detected(one, now) for one in suspicions], now):
            self._cycle(now)
            self._health.count('reconfigurations')

    def _tell_changes(self, before: Sequence[Suspicion]) -> None:
        """Log and publish what is new since ``before``, and what has healed."""
        present, logger = self.monitor.detector.suspicions, self._node.get_logger()
        for one in present:
            if one not in before:
                logger.warning(f'detection: {one}')
                if one.moves_though_stuck(self._failures):
                    text = f'{one.name}: {one.obstacle(self._failures)}'
                    self._health.warn(Notice('inconsistent', text, rejected=False))
        for one in before:
            if one not in present:
                logger.info(f'detection: {one.name} follows its commands again')
        self._publish()

    def _on_pose(self, message: PoseStamped) -> None:
        try:
            self._pose = pose_from_msg(message)
        except ValueError:
            self._pose = None

    def _probe(self) -> Answer | None:
        prober, state = self.monitor.prober, self._supervisor.output.state
        if prober.probing:
            return None
        if state not in MOVING:
            return False, f'{AT_REST}: {state.value}'
        refusal = prober.request()
        return (False, refusal) if refusal else None

    def _publish(self) -> None:
        """Publish every suspicion, and what is about to become one."""
        detector = self.monitor.detector
        found = [self._status(one) for one in detector.suspicions]
        if detector.forming is not None:
            found.append(self._status(detector.forming))
        if found:
            self._diagnostics.publish(diagnostics_to_msg(self._clock.now().to_msg(), found))

    def _status(self, suspicion: Suspicion) -> Any:
        # What is not acted on must not look like a report: others may listen.
        values = suspicion.values(acting=suspicion in self._acted)
        if self.monitor.settings.detect == 'act':
            values['not_acted_on'] = suspicion.obstacle(self._failures)
        return status_to_msg(
            DETECTION, f'{self._prefix}{suspicion.name}',
            ERROR if FAILURE_MODE_KEY in values else WARN, str(suspicion), values,
        )
