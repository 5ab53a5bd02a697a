# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A node's own health: rejected inputs and warnings, counted, logged, on `/diagnostics`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from fault_tolerance.control.notices import Notice
from fault_tolerance.nodes.messages import diagnostics_to_msg, status_to_msg
from fault_tolerance.nodes.timeline import TimeLine

OK, WARN, ERROR = range(3)
PERIOD = 1.0
_LOG_EVERY = 1.0
# Seconds for which a warning stays on the diagnostics.
_SHOWN_FOR = 5.0


class Health:
    """Counts notices, logs each kind at most once a second, publishes them at 1 Hz.

    The name of the status is that of the node and a ``title``; its hardware id begins with
    ``prefix``, if there is one. ``present`` returns level and text of the present status.
    """

    def __init__(
        self, node: Node, timeline: TimeLine, title: str, prefix: str,
        present: Callable[[], tuple[int, str]],
    ) -> None:
        self._node = node
        self._timeline = timeline
        self._name = f'{node.get_name()}: {title}'
        self._hardware_id = f'{prefix}/{node.get_name()}' if prefix else node.get_name()
        self._present = present
        self._counts: Counter[str] = Counter()
        self._logged: dict[str, float] = {}
        self._shown: Notice | None = None
        self._shown_at = -_SHOWN_FOR
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        node.create_timer(PERIOD, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def warn(self, notice: Notice | None) -> None:
        """Count a ``notice``, if any, and log it unless one of its kind was in the last second."""
        if notice is None:
            return
        self._counts[f'{"rejected" if notice.rejected else "warned"}_{notice.reason}'] += 1
        if not notice.text:
            return
        now = self._timeline.now()
        self._shown, self._shown_at = notice, now
        if now - self._logged.get(notice.reason, -_LOG_EVERY) >= _LOG_EVERY:
            self._logged[notice.reason] = now
            self._node.get_logger().warning(notice.text)

    def warn_once(self, reason: str, text: str) -> None:
        """Count a warning under ``reason`` and log its ``text`` the first time only."""
        if not self._counts[f'warned_{reason}']:
            self.warn(Notice(reason, text, rejected=False))

    def resolve(self, reason: str) -> None:
        """Remove the warning of this ``reason`` from the status: its cause is gone."""
        if self._shown is not None and self._shown.reason == reason:
            self._shown = None

    def count(self, key: str) -> None:
        """Increment the counter ``key``."""
        self._counts[key] += 1

    def _publish(self) -> None:
        level, text = self._present()
        if self._shown is not None and self._timeline.now() - self._shown_at < _SHOWN_FOR:
            level, text = max(level, WARN), f'{text}; {self._shown.text}'
        counts = {key: str(number) for key, number in sorted(self._counts.items())}
        status = status_to_msg(self._name, self._hardware_id, level, text, counts)
        stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(diagnostics_to_msg(stamp, [status]))
