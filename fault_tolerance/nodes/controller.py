# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``fault_tolerance``: joint states, task velocity and failure reports in, rates out.

A command follows every joint state, and every failure report that changes anything, inside the
callback that received it; no timer is in the path, and nothing is told before the command has
gone out. All computation is the `Supervisor`'s; what can wait is done when no message is waiting.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from fault_tolerance.compiled.activation import activate
from fault_tolerance.control.notices import Notice
from fault_tolerance.control.recovery import State
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.commanding import CommandPublisher
from fault_tolerance.nodes.health import ERROR, OK, WARN, Health
from fault_tolerance.nodes.idle import IdleTime, Job
from fault_tolerance.nodes.inputs import InputReader
from fault_tolerance.nodes.parameter_tables import CONTROLLER
from fault_tolerance.nodes.parameters import declared_values, settings_from
from fault_tolerance.nodes.publishing import MetricsPublisher
from fault_tolerance.nodes.report_reader import ReportReader
from fault_tolerance.nodes.scheduling import scheduled_real_time
from fault_tolerance.nodes.services import OperatorServices
from fault_tolerance.nodes.spinning import run
from fault_tolerance.nodes.telling import Teller
from fault_tolerance.nodes.timeline import TimeLine

NAME = 'fault_tolerance'
WATCHDOG_PERIOD = 0.01
"""Seconds; what does not arrive is noticed this much after its timeout at the latest."""

METRICS_PERIOD = 0.2
COLLECTION_PERIOD = 5.0
"""Seconds between two collections of garbage, made in idle time if there is any."""

LATE = 3.0 * WATCHDOG_PERIOD
"""Seconds between two watchdog periods after which messages may be waiting unread."""

STALL = 0.15
"""Seconds between two watchdog periods that count as a stall."""

# One may wait while another is worked on; older ones are of no use.
_NEWEST = QoSProfile(depth=2, reliability=ReliabilityPolicy.BEST_EFFORT)
_LEVELS = {State.NOMINAL: OK, State.DEGRADED: OK, State.STOPPED: ERROR}


class Controller(Node):
    """The shell around a `Supervisor`.

    Parameters
    ----------
    remark : str, optional
        Something to tell at the start.
    """

    def __init__(self, remark: str = '') -> None:
        super().__init__(NAME)
        values = declared_values(self, CONTROLLER, _settings)
        mechanism = mechanism_named(values['mechanism'])
        self._supervisor = Supervisor(mechanism, _settings(values))
        self._stepped = False
        self._line = TimeLine(self.get_clock())
        self._ticked = self._line.now()
        self._excused = False

        prefix = values['hardware_id_prefix'].strip('/') or self.get_namespace().strip('/')
        identity = f'{prefix}/{NAME}' if prefix else NAME
        self._health = Health(self, self._line, 'controller', identity, self._present)
        self._inputs = InputReader(mechanism, values['base_frame'], self._line, self._health)
        self._reader = ReportReader(mechanism, prefix, self._line, self._health)
        self._commands = CommandPublisher(
            self, mechanism, values['base_frame'], self._line
        )
        metrics = MetricsPublisher(self, mechanism, prefix)
        self._teller = Teller(self, self._supervisor, metrics)
        self._anticipating = Job(self._supervisor.anticipate)
        self._collecting = Job(_collect)
        self.idle = IdleTime(
            self._teller.changes, self._teller.measures, self._anticipating, self._collecting
        )
        self._joint_states = self.create_subscription(
            JointState, 'joint_states', self._on_joint_state, _NEWEST
        )
        self._velocities = self.create_subscription(
            TwistStamped, '~/task_velocity', self._on_task_velocity, 10
        )
        self.create_subscription(
            DiagnosticArray, values['diagnostics_topic'], self._on_diagnostics, 100, raw=True
        )
        self._operating = OperatorServices(self, self._supervisor, self._line, self._on_operated)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(WATCHDOG_PERIOD, self._on_watchdog, clock=steady)
        self.create_timer(METRICS_PERIOD, self._on_metrics_due, clock=steady)
        self.create_timer(COLLECTION_PERIOD, self._on_collection_due, clock=steady)
        self._line.call_on_jump(self._on_jump)
        self._health.remark(_real_time_notice(values['realtime_priority']))
        if remark:
            self.get_logger().info(remark)

    def farewell(self) -> None:
        """Bring the drives to rest."""
        self._commands.rest()

    def _on_joint_state(self, message: JointState) -> None:
        now = self._line.now()
        self.idle.activity += 1
        taken = self._inputs.joint_values(message, self._supervisor.failures.lost)
        if taken is None:
            return
        notice = self._supervisor.joint_reading(taken.values, now, taken.stamp)
        if notice is None:
            self._cycle(now)
            self.idle.regular_message(now)
            self._anticipating.due = True
        self._health.remark(notice)

    def _on_task_velocity(self, message: TwistStamped) -> None:
        self.idle.activity += 1
        taken = self._inputs.task_velocity(message)
        if taken is not None:
            notice = self._supervisor.task_velocity(taken.values, self._line.now(), taken.stamp)
            self._health.remark(notice)

    def _on_diagnostics(self, raw: bytes) -> None:
        self.idle.activity += 1
        self._reader.put(raw)
        self._read_reports()

    def _read_reports(self) -> None:
        for batch in self._reader.batches():
            now = self._line.now()
            update = self._supervisor.reports(batch.reports, now)
            if update.changed:
                self._cycle(now)
                self._teller.report_stamp = batch.stamp
                self._health.count(f'failures_{self._supervisor.assessed_by}')
            for notice in update.notices:
                self._health.remark(notice)
            if update.changed or any(not notice.rejected for notice in update.notices):
                self._reader.forget_repeats()

    def _on_jump(self, now: float) -> None:
        self._supervisor.forget_times(now)
        self._cycle(now)

    def _on_watchdog(self) -> None:
        self.idle.activity += 1
        now = self._line.now()
        late = now - self._ticked
        if late > STALL:
            self._health.count('stalls')
        self._ticked = now
        self._read_reports()
        # Being late itself, it does not know what is late: what has come meanwhile is read first.
        self._excused = late > LATE and not self._excused
        # With joint states coming there is nothing to do; without, it may be time to stop. To
        # set anything moving is not the business of a timer.
        if not (self._stepped or self._excused):
            output = self._supervisor.step(now)
            if self._commands.moving and not output.rates.any():
                self._commands.send(output.rates, output.achieved)
            self._teller.note(output)
        self._stepped = False
        self._teller.no_longer_wait()

    def _cycle(self, now: float) -> None:
        """Compute and send a command; what has changed is told when no message is waiting."""
        command = self._supervisor.command(now)
        self._commands.send(command.rates, command.achieved)
        # Who hears it may have been woken on this processor, and waits until it is free.
        os.sched_yield()
        output = self._supervisor.settled()
        if output.rates is not command.rates:
            self._commands.send(output.rates, output.achieved)
        self._stepped = True
        self._teller.note(output)
        for notice in output.notices:
            self._health.remark(notice)

    def _on_metrics_due(self) -> None:
        self.idle.activity += 1
        self._teller.next_metrics()
        self._commands.look_for_listeners()

    def _on_collection_due(self) -> None:
        self.idle.activity += 1
        if self._collecting.due:
            self._collecting.do()
        self._collecting.due = True

    def _present(self) -> tuple[int, str]:
        """Return level and text of the node's own status."""
        state = self._supervisor.output.state
        if self.count_publishers(self._velocities.topic_name) > 1:
            text = 'several nodes publish task velocities: the last one wins'
            self._health.warn_once('several_commanders', text)
        if state is not State.WAITING:
            return _LEVELS.get(state, WARN), state.value
        topic = self._joint_states.topic_name
        count = self.count_publishers(topic)
        text = f'no joint state yet on {topic} ({count} publishers; any reliability will do)'
        if not self._teller.discovering:
            self._health.warn_once('waiting', text)
        return WARN, text

    def _on_operated(self) -> None:
        self._reader.forget_repeats()
        if not self._supervisor.failures:
            self._health.settle('latched')
        self._cycle(self._line.now())


def _settings(values: dict[str, Any]) -> Settings:
    return Settings(**settings_from(Settings, values), clock=time.perf_counter)


def _collect() -> bool:
    gc.collect()
    return False


def _real_time_notice(priority: int) -> Notice | None:
    """Ask for real-time scheduling; return the warning that it was not granted, if so."""
    refused = scheduled_real_time(priority)
    return Notice('real_time', refused, rejected=False) if refused else None


def main(args: list[str] | None = None) -> int:
    """Run the node; return the exit code."""
    try:
        slowly = activate(lambda text: print(f'{NAME}: {text}', file=sys.stderr, flush=True))
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    return run(NAME, lambda: Controller(slowly), args)


if __name__ == '__main__':
    sys.exit(main())
