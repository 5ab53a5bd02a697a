# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""One time line for everything: monotonic seconds, on which the stamps of messages are placed.

Timeouts must not depend on a wall clock that somebody sets, nor on a simulated one that is paused.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.clock import JumpThreshold, ROSClock
from rclpy.duration import Duration

# Reading two clocks one after the other is not exact; smaller differences are no news.
_JITTER = 1e-3


class TimeLine:
    """Monotonic seconds.

    Parameters
    ----------
    clock : ROSClock
        The one that stamps are read from.
    """

    def __init__(self, clock: ROSClock) -> None:
        self._clock = clock
        self._offset = 0.0
        self._jumps: list[object] = []
        self._simulated = clock.ros_time_is_active
        threshold = JumpThreshold(min_forward=None, min_backward=None, on_clock_change=True)
        self._jumps.append(
            clock.create_jump_callback(threshold, post_callback=self._on_clock_change)
        )

    def call_on_jump(self, callback: Callable[[float], None]) -> None:
        """Call ``callback`` with the present whenever the clock is set back or exchanged.

        Only simulated time does that: what happens to a wall clock is passed over.
        """
        threshold = JumpThreshold(
            min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True
        )
        self._jumps.append(
            self._clock.create_jump_callback(
                threshold, post_callback=lambda _: callback(self.now())
            )
        )

    @staticmethod
    def now() -> float:
        """Return the present."""
        return time.monotonic()

    def stamp(self) -> Time:
        """Return the present as stamps have it."""
        return self._clock.now().to_msg()

    def wall(self) -> int:
        """Return the present as stamps have it, nanoseconds."""
        # To ask the clock takes long; unless time is simulated it shows the system's.
        return int(self._clock.now().nanoseconds) if self._simulated else time.time_ns()

    def _on_clock_change(self, _: object) -> None:
        self._simulated = self._clock.ros_time_is_active

    def placed(self, stamp: Time) -> float | None:
        """Return where a stamp lies, or None for zero, which says nothing."""
        sec, nanosec = stamp.sec, stamp.nanosec
        if not (sec or nanosec):
            return None
        wall = self._clock.now().nanoseconds * 1e-9 if self._simulated else time.time()
        offset = wall - time.monotonic()
        if abs(offset - self._offset) > _JITTER:
            self._offset = offset
        return float(sec + nanosec * 1e-9 - self._offset)
