# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A node's own health: rejected inputs and warnings, counted, logged, on `/diagnostics`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from fault_tolerance.control.failure_reports import WARN
from fault_tolerance.control.notices import Notice
from fault_tolerance.nodes.messages import diagnostics_to_msg, status_name, status_to_msg
from fault_tolerance.nodes.timeline import TimeLine

PERIOD = 1.0
_LOG_EVERY = 1.0
# Seconds for which a warning stays on the diagnostics.
_SHOWN_FOR = 5.0


class Health:
    """Counts notices, logs each kind at most once a second for a part, publishes them at 1 Hz.

    The name of the status is that of the node, with its namespace, and a ``title``; its hardware
    id begins with ``prefix``, if there is one. ``present`` returns level and text of the present
    status.
    """

    def __init__(
        self, node: Node, timeline: TimeLine, title: str, prefix: str,
        present: Callable[[], tuple[int, str]],
    ) -> None:
        self._node = node
        self._timeline = timeline
        self._name = status_name(node, title)
        self._hardware_id = f'{prefix}/{node.get_name()}' if prefix else node.get_name()
        self.present = present
        self._counts: Counter[str] = Counter()
        self._logged: dict[tuple[str, str], float] = {}
        self._shown: dict[tuple[str, str], tuple[float, str]] = {}
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        node.create_timer(PERIOD, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def warn(self, notice: Notice | None) -> None:
        """Count a ``notice``, if any; log it unless its like on this part was just logged."""
        if notice is None:
            return
        self._counts[f'{"rejected" if notice.rejected else "warned"}_{notice.reason}'] += 1
        if not notice.text:
            return
        now, like = self._timeline.now(), (notice.reason, notice.part)
        self._shown[like] = now, notice.text
        if now - self._logged.get(like, -_LOG_EVERY) >= _LOG_EVERY:
            self._logged[like] = now
            self._node.get_logger().warning(notice.text)

    def warn_once(self, reason: str, text: str, part: str = '') -> None:
        """Count and log a warning, for this ``reason`` and ``part`` the first ``text`` only."""
        if (reason, part) not in self._logged:
            self.warn(Notice(reason, text, False, part))

    def resolve(self, reason: str) -> None:
        """Remove the warnings of this ``reason`` from the status: their cause is gone."""
        for like in [like for like in self._shown if like[0] == reason]:
            del self._shown[like]

    def count(self, key: str) -> None:
        """Increment the counter ``key``."""
        self._counts[key] += 1

    def with_notices(self, level: int, text: str) -> tuple[int, str]:
        """Return ``level`` and ``text`` of a status with the notices of the last seconds."""
        since = self._timeline.now() - _SHOWN_FOR
        self._shown = {like: told for like, told in self._shown.items() if told[0] > since}
        for _, one in self._shown.values():
            level = max(level, WARN)
            if one not in text:
                text = f'{text}; {one}'
        return level, text

    def told(self) -> tuple[int, str]:
        """Return level and text of the node's status now."""
        return self.with_notices(*self.present())

    def _publish(self) -> None:
        level, text = self.told()
        counts = {key: str(number) for key, number in sorted(self._counts.items())}
        status = status_to_msg(self._name, self._hardware_id, level, text, counts)
        stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(diagnostics_to_msg(stamp, [status]))
