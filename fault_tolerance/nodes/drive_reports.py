# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``drive_reports``: what drives say, as failure reports, by rules in a file."""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from fault_tolerance.control.failure_reports import ERROR, OK, WARN
from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.drive_rules.drive_watch import DriveReport, DriveWatch
from fault_tolerance.drive_rules.rule_files import rules_named
from fault_tolerance.drive_rules.rules import Rule
from fault_tolerance.kinematics.failures import FailureMode
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.drive_resets import DriveResets
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.message_types import message_type
from fault_tolerance.nodes.messages import (
    FAILURE_MODE_KEY,
    diagnostics_to_msg,
    status_name,
    status_to_msg,
)
from fault_tolerance.nodes.parameter_tables import DRIVE_REPORTS
from fault_tolerance.nodes.parameters import declared_values
from fault_tolerance.nodes.spinning import run
from fault_tolerance.nodes.timeline import TimeLine
from fault_tolerance.nodes.usage import exit_code

NAME = 'drive_reports'
_LOOK_PERIOD = 0.1
_REPORT_EVERY = 10
_PATIENCE = 5.0
"""Seconds after which a topic or a drive that has said nothing is worth a line."""


class DriveReports(Node):
    """ROS interface of a `DriveWatch`.

    Reports are published on change, at 1 Hz, and to new subscribers.
    """

    def __init__(self) -> None:
        super().__init__(NAME)
        values = declared_values(self, DRIVE_REPORTS)
        mechanism = mechanism_named(values['mechanism'])
        self._watch = DriveWatch(rules_named(values['rules']), mechanism)
        self._namespace = self.get_namespace().strip('/')
        timeline = TimeLine(self.get_clock())
        self._resets = DriveResets(self, self._watch, values['reset_timeout'])
        self._health = Health(self, timeline, 'rules', self._namespace, self._present)
        self._reports = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._subscribers = self._looks = 0
        self._missing = self._resets.missing
        for kind in self._missing:
            self.get_logger().error(f'there is no service type {kind} here: it resets nothing')
        self._silent: dict[str, str] = {}
        self._heard: set[str] = set()
        self._complained: set[tuple[str, str]] = set()
        self._listen()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_LOOK_PERIOD, self._on_timer, clock=steady)

    def _listen(self) -> None:
        """Subscribe to every topic whose type is there."""
        for name in self._watch.unwatched:
            self.get_logger().warning(f'no rule is about {name}: its drive is never reported')
        kinds: dict[str, type | None] = {}
        for topic, rule in self._watch.topics.items():
            if rule.kind not in kinds:
                kinds[rule.kind] = message_type(rule.kind)
                if kinds[rule.kind] is None:
                    self._missing.append(rule.kind)
                    self.get_logger().error(
                        f'there is no message type {rule.kind} here: rules that need it, '
                        f'{rule.name} for one, say nothing'
                    )
            kind = kinds[rule.kind]
            if kind is not None:
                self._silent[topic] = rule.name
                self.create_subscription(
                    kind, topic, partial(self._on_message, topic), _quality(rule)
                )

    def _on_message(self, topic: str, message: Any) -> None:
        taken = self._watch.take(topic, message)
        if taken.changed:
            self._report()
        self._silent.pop(topic, None)
        self._heard.add(topic)
        for name, reason in taken.complaints:
            self._health.count('rejected_messages')
            if (name, reason) not in self._complained:
                self._complained.add((name, reason))
                text = f'{topic} does not fit the rule {name}: {clean(reason)}'
                self._health.warn(Notice('field', text))

    def _on_timer(self) -> None:
        """Report once a second, and at once to a new subscriber; answer for resets."""
        self._resets.look()
        count = self._reports.get_subscription_count()
        self._looks += 1
        if count > self._subscribers or self._looks % _REPORT_EVERY == 0:
            self._report()
        self._subscribers = count
        if self._looks == round(_PATIENCE / _LOOK_PERIOD):
            self._look_for_silence()

    def _look_for_silence(self) -> None:
        """Tell of topics nobody publishes on, and of drives that are in no message."""
        for topic, name in self._silent.items():
            self.get_logger().warning(f'nothing on {topic} yet: the rule {name} waits for it')
        for topic in sorted(self._heard):
            parts = self._watch.unseen(topic)
            if parts:
                text = f'{topic} says nothing of {", ".join(dict.fromkeys(parts))}'
                self.get_logger().warning(f'{text}: check the drive names in the rule file')

    def _present(self) -> tuple[int, str]:
        unseen = {part for topic in self._heard for part in self._watch.unseen(topic)}
        concerns = {
            'no type': self._missing, 'waiting for': self._silent,
            'nothing of': sorted(unseen), 'not well yet:': self._watch.idle,
        }
        texts = [f'{what} {", ".join(names)}' for what, names in concerns.items() if names]
        return (WARN, '; '.join(texts)) if texts else (OK, 'watching')

    def _report(self) -> None:
        statuses = [self._status(one) for one in self._watch.reports()]
        if statuses:
            stamp = self.get_clock().now().to_msg()
            self._reports.publish(diagnostics_to_msg(stamp, statuses))

    def _status(self, report: DriveReport) -> DiagnosticStatus:
        name = report.actuator
        return status_to_msg(
            status_name(self, f'{name} ({report.rule})'),
            f'{self._namespace}/{name}' if self._namespace else name,
            OK if report.mode == FailureMode.NONE.value else ERROR,
            clean(report.message), {FAILURE_MODE_KEY: report.mode},
        )


def _quality(rule: Rule) -> QoSProfile:
    lossy = rule.best_effort
    reliability = ReliabilityPolicy.BEST_EFFORT if lossy else ReliabilityPolicy.RELIABLE
    return QoSProfile(depth=10, reliability=reliability)


def main(args: list[str] | None = None) -> int:
    """Run the node with command line ``args``; return the exit code of the process."""
    code = exit_code(NAME, __doc__, DRIVE_REPORTS, args)
    if code is not None:
        return code
    return run(NAME, DriveReports, args)


if __name__ == '__main__':
    sys.exit(main())
