# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""One time line, monotonic seconds, for timeouts and for the stamps of messages.

Timeouts must depend neither on a wall clock that may be set, nor on a simulated one that may stop.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.clock import JumpThreshold, ROSClock
from rclpy.duration import Duration

# Two clocks cannot be read at the same instant: smaller changes of their offset are jitter.
_JITTER = 1e-3


class TimeLine:
    """Monotonic time in seconds, and ROS time converted to it.

    Parameters
    ----------
    clock : ROSClock
        The clock that stamps are read from.
    """

    def __init__(self, clock: ROSClock) -> None:
        self._clock = clock
        self._offset = 0.0
        self._simulated = clock.ros_time_is_active
        threshold = JumpThreshold(min_forward=None, min_backward=None, on_clock_change=True)
        # A jump callback lives as long as its handle.
        self._handles: list[object] = [
            clock.create_jump_callback(threshold, post_callback=self._on_clock_change)
        ]

    def call_on_jump(self, callback: Callable[[float], None]) -> None:
        """Have a ``callback`` called with the present when the clock is set back or exchanged.

        Only simulated time does that; wall clock changes are ignored.
        """
        threshold = JumpThreshold(
            min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True
        )
        self._handles.append(
            self._clock.create_jump_callback(
                threshold, post_callback=lambda _: callback(self.now())
            )
        )

    now = staticmethod(time.monotonic)
    """Return the present, monotonic seconds."""

    def stamp(self) -> Time:
        """Return the present as a stamp."""
        return self._clock.now().to_msg()

    def monotonic(self, stamp: Time) -> float | None:
        """Convert a ``stamp``, any object with ``sec`` and ``nanosec``, by its age.

        Returns monotonic seconds; None for a zero stamp, which means "not stamped".
        """
        sec, nanosec = stamp.sec, stamp.nanosec
        if not (sec or nanosec):
            return None
        # rclpy's clock is slow; without simulated time it shows the system clock.
        wall = self._clock.now().nanoseconds * 1e-9 if self._simulated else time.time()
        offset = wall - time.monotonic()
        if abs(offset - self._offset) > _JITTER:
            self._offset = offset
        return float(sec + nanosec * 1e-9 - self._offset)

    def _on_clock_change(self, _: object) -> None:
        self._simulated = self._clock.ros_time_is_active
