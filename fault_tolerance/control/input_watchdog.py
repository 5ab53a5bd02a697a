# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A watchdog for one input: the newest value that was fit to use, and when it will be stale."""

from __future__ import annotations

from math import inf, isfinite

from fault_tolerance.control.notices import Notice
from fault_tolerance.mechanism.arrays import FloatArray


class InputWatchdog:
    """Keeps the newest usable value of the input ``name``.

    The input is stale after ``timeout`` seconds without a value. If it is ``ordered``, a value
    stamped earlier than the last one is rejected.
    """

    def __init__(self, name: str, timeout: float, *, ordered: bool) -> None:
        self._name = name
        self._key = name.replace(' ', '_')
        self._timeout = timeout
        self._ordered = ordered
        self._stamp = -inf
        self.value: FloatArray | None = None
        """The newest usable value; None before there was any."""
        self.deadline = inf
        """When it will be stale, seconds; infinite before there was any."""

    def offer(self, value: FloatArray, now: float, stamp: float | None) -> Notice | None:
        """Take ``value``, received at ``now`` (s), or return why it is too old.

        ``stamp`` (s) is when it was measured or asked for; None and what is ahead count as now.
        """
        notice = self.late(now, stamp)
        if notice is None:
            self.take(value, now, stamp)
        return notice

    def late(self, now: float, stamp: float | None) -> Notice | None:
        """Return why what was measured at ``stamp`` (s, see `offer`) is too old ``now`` (s)."""
        given = _given(now, stamp)
        if now - given > self._timeout:
            text = f'{self._name} is {now - given:.3f} s old on arrival; ignored'
            return Notice(f'stale_{self._key}', text)
        if self._ordered and given < self._stamp:
            text = f'{self._name} is {self._stamp - given:.3f} s older than the last; ignored'
            return Notice(f'old_{self._key}', text)
        return None

    def take(self, value: FloatArray, now: float, stamp: float | None) -> None:
        """Take ``value``, which is not `late` ``now`` (s), measured at ``stamp`` (s)."""
        self.value, self._stamp = value, _given(now, stamp)
        self.deadline = now + self._timeout

    def restart_clock(self) -> None:
        """Let the value be stale until the next one: the clock was set back."""
        self._stamp = -inf
        if self.value is not None:
            self.deadline = -inf


def _given(now: float, stamp: float | None) -> float:
    return now if stamp is None or not isfinite(stamp) else min(stamp, now)
