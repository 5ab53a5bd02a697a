# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A node's own health: what it left aside and why, counted, logged, and on `/diagnostics`."""

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
# A warning stays on the diagnostics for so long that somebody may see it.
_SHOWN_FOR = 5.0


class Health:
    """Counts what a node notices, logs each kind once a second at most, publishes it at 1 Hz.

    Parameters
    ----------
    node : Node
    line : TimeLine
    title : str
        What the node is, for the name of its status.
    hardware_id : str
    present : callable
        Returns the level and the text of the status as things stand.
    """

    def __init__(
        self,
        node: Node,
        line: TimeLine,
        title: str,
        hardware_id: str,
        present: Callable[[], tuple[int, str]],
    ) -> None:
        self._node = node
        self._line = line
        self._name = f'{node.get_name()}: {title}'
        self._hardware_id = hardware_id
        self._present = present
        self._counts: Counter[str] = Counter()
        self._logged: dict[str, float] = {}
        self._shown: Notice | None = None
        self._shown_at = -_SHOWN_FOR
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        node.create_timer(PERIOD, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def remark(self, notice: Notice | None) -> None:
        """Count a notice, if any; log it unless its like was logged within the last second."""
        if notice is None:
            return
        self._counts[f'{"rejected" if notice.rejected else "warned"}_{notice.reason}'] += 1
        if not notice.text:
            return
        now = self._line.now()
        self._shown, self._shown_at = notice, now
        if now - self._logged.get(notice.reason, -_LOG_EVERY) >= _LOG_EVERY:
            self._logged[notice.reason] = now
            self._node.get_logger().warning(notice.text)

    def warn_once(self, reason: str, text: str) -> None:
        """Count and log a warning the first time only."""
        if not self._counts[f'warned_{reason}']:
            self.remark(Notice(reason, text, rejected=False))

    def settle(self, reason: str) -> None:
        """Take what was noticed for this reason off the status: it has been dealt with."""
        if self._shown is not None and self._shown.reason == reason:
            self._shown = None

    def count(self, key: str) -> None:
        """Add one to a counter."""
        self._counts[key] += 1

    def _publish(self) -> None:
        level, text = self._present()
        if self._shown is not None and self._line.now() - self._shown_at < _SHOWN_FOR:
            level, text = max(level, WARN), f'{text}; {self._shown.text}'
        counts = {key: str(number) for key, number in sorted(self._counts.items())}
        status = status_to_msg(self._name, self._hardware_id, level, text, counts)
        stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(diagnostics_to_msg(stamp, [status]))
