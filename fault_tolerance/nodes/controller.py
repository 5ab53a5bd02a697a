# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``fault_tolerance``: joint states, task velocity and failure reports in, rates out.

Every joint state, and every failure report that changes anything, is answered by a command within
the callback that received it. The `Supervisor` computes; the rest comes after it (`Deferred`).
"""

from __future__ import annotations

import os
import signal
import sys
from functools import partial

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.belief_publisher import BeliefPublisher
from fault_tolerance.nodes.command_publisher import CommandPublisher
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.input_subscriber import InputSubscriber
from fault_tolerance.nodes.kernel_startup import KernelStartup
from fault_tolerance.nodes.live_settings import LiveSettings
from fault_tolerance.nodes.parameter_tables import CONTROLLER
from fault_tolerance.nodes.report_subscriber import Batch, ReportSubscriber
from fault_tolerance.nodes.scheduling import set_realtime_priority
from fault_tolerance.nodes.serialised_joint_states import SerialisedJointState
from fault_tolerance.nodes.services import OperatorServices
from fault_tolerance.nodes.silent_failures import SilentFailures
from fault_tolerance.nodes.spinning import Deferred, run
from fault_tolerance.nodes.status_publisher import StatusPublisher
from fault_tolerance.nodes.timeline import TimeLine
from fault_tolerance.nodes.usage import exit_code

NAME = 'fault_tolerance'
WATCHDOG_PERIOD = 0.01
LATE = 3.0 * WATCHDOG_PERIOD  # after which messages may be pending unread
STALL = 0.15
"""Seconds between two watchdog ticks from which a stall is counted."""


class Controller(Node):
    """ROS interface of a `Supervisor`; ``startup`` gives the kernel that computes commands."""

    def __init__(self, startup: KernelStartup) -> None:
        super().__init__(NAME)
        live = LiveSettings(self)
        values = live.values
        mechanism, frame = mechanism_named(values['mechanism']), values['base_frame']
        prefix = values['hardware_id_prefix'].strip('/') or self.get_namespace().strip('/')
        self.deferred = Deferred()
        self._timeline = timeline = TimeLine(self.get_clock())
        supervisor = Supervisor(mechanism, live.settings, startup.kernel)
        self._supervisor, self._startup = supervisor, startup
        self._health = Health(self, timeline, 'controller', prefix, self._own_status)
        self._commands = CommandPublisher(self, mechanism, frame, timeline)
        self._belief = BeliefPublisher(
            self, supervisor, frame, values['marker_exaggeration'], self.deferred
        )
        shared = timeline, self._health
        self._silent = SilentFailures(self, supervisor, values, prefix, *shared, self._cycle)
        self._inputs = InputSubscriber(
            self, supervisor, frame, *shared, partial(self._cycle, answers=True),
            self._on_answered, self.deferred,
        )
        live.keep(supervisor, self._silent)
        self._status = StatusPublisher(
            self, supervisor, prefix, self.deferred, self._health, self._silent.suspected,
            self._silent.values, self._inputs.missing_joint_states,
        )
        self._reports = ReportSubscriber(
            self, mechanism, values['diagnostics_topic'], prefix, *shared, self._on_reports
        )
        self._operator = OperatorServices(
            self, supervisor, *shared, live.values, self._on_operator_request,
            self._silent.forget,
        )
        self._stepped = self._excused = False
        self._ticked = timeline.now()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(WATCHDOG_PERIOD, self._on_watchdog, clock=steady)
        timeline.call_on_jump(self._on_clock_jump)
        self._health.warn(set_realtime_priority(values['realtime_priority']))
        if startup.remark:
            self.get_logger().warning(startup.remark)

    def _cycle(self, now: float, *, answers: bool = False) -> None:
        """Compute and publish one command; say whether it ``answers`` a joint state."""
        output = self._supervisor.step(now)
        self._commands.publish(output.command.rates, output.command.twist)
        # Yield: whoever takes the command may be queued on this CPU.
        os.sched_yield()
        self._stepped = True
        self._silent.command(output.command.rates, output.estimate.readings if answers else None)
        if self._supervisor.kernel.compiled:  # else it takes 80 ms, and the next command waits
            self._supervisor.secondary.consider(output, now)
        for notice in self._supervisor.watch(self._silent.monitor.internal_force):
            self._health.warn(notice)
        self._status.update(output, now)

    def _on_answered(self, message: SerialisedJointState) -> None:
        self._belief.observe(message)
        self._silent.observe(message)

    def _on_reports(self, batch: Batch) -> None:
        now = self._timeline.now()
        update = self._supervisor.reports(batch.reports, now)
        if update.changed:
            self._cycle(now)
            self._status.report_stamp = f'{batch.stamp.sec}.{batch.stamp.nanosec:09d}'
            self._health.count('reconfigurations')
        for notice in update.notices:
            self._health.warn(notice)
        if update.changed or any(not notice.rejected for notice in update.notices):
            self._reports.forget_repeats()

    def _on_operator_request(self) -> None:
        self._reports.forget_repeats()
        if not self._supervisor.failures:
            self._health.resolve('latched')
        self._cycle(self._timeline.now())

    def _on_clock_jump(self, now: float) -> None:
        self._supervisor.restart_clock(now)
        self._cycle(now)

    def _on_watchdog(self) -> None:
        """Stop the drives when inputs cease. This timer never starts motion."""
        now = self._timeline.now()
        late, self._ticked = now - self._ticked, now
        if late > STALL:
            self._health.count('stalls')
        self._startup.exchange(self._supervisor, self.get_logger())
        self._reports.read()
        # After a late tick, read pending messages before declaring inputs stale.
        self._excused = late > LATE and not self._excused
        if not (self._stepped or self._excused):
            output = self._supervisor.step(now)
            if self._commands.moving and not output.rates.any():
                self._commands.publish(output.rates, output.achieved)
                self._silent.command(output.rates)
            self._status.update(output, now)
        self._stepped = False
        # Last: whatever goes wrong in an answer, drives whose inputs cease have been stopped.
        self._silent.look()
        self._operator.look()
        self._supervisor.rehearse(self._reports.rehearsal().reports, now)

    def _own_status(self) -> tuple[int, str]:
        """Return level and text of the node's own diagnostic status."""
        self._inputs.check_publishers()
        self._commands.check_publishers(self._health)
        return self._status.present()

    def on_shutdown(self) -> None:
        """Stop the drives."""
        self._commands.stop()


def main(args: list[str] | None = None) -> int:
    """Run the node with command line ``args``; return the exit code of the process."""
    code = exit_code('controller', __doc__, CONTROLLER, args)
    if code is not None:
        return code
    try:
        startup = KernelStartup()
    except KeyboardInterrupt:  # before `run` handles signals
        return 128 + signal.SIGINT
    try:
        return run(NAME, lambda: Controller(startup), args)
    finally:
        startup.end()


if __name__ == '__main__':
    sys.exit(main())
