# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A watchdog for one input: the newest value that was fit to use, and when it will be stale."""

from __future__ import annotations

from math import inf, isfinite

from fault_tolerance.control.notices import Notice
from fault_tolerance.mechanism.arrays import FloatArray


class InputWatchdog:
    """Keeps the newest usable value of the input ``name``.

    The input is stale after ``timeout`` seconds without a value.
    """

    def __init__(self, name: str, timeout: float) -> None:
        self._name, self._lacking = name, f'no {name}'
        self.timeout = timeout
        self._stamp = -inf
        self.value: FloatArray | None = None
        """The newest usable value; None before there was any."""
        self.deadline = inf
        """When it will be stale, seconds; infinite before there was any."""

    def offer(self, value: FloatArray, now: float, stamp: float | None) -> Notice | None:
        """Take ``value``, received at ``now`` (s), or return why it is too old.

        ``stamp`` (s) is when it was measured or asked for; None and what is ahead count as now.
        """
        given = now if stamp is None or not isfinite(stamp) else min(stamp, now)
        if now - given > self.timeout:
            return self._too_old('stale', f'{now - given:.3f} s old on arrival')
        self.value, self._stamp, self.deadline = value, given, now + self.timeout
        return None

    @property
    def missing(self) -> str:
        """Why there is no value in force; for where there is none."""
        if self.value is None:
            return f'{self._lacking} yet'
        if self.deadline == -inf:
            return f'waiting for a {self._name} after the clock was set back'
        return f'{self._lacking} for {self.timeout:g} s'

    def restart_clock(self) -> None:
        """Let the value be stale until the next one: the clock was set back."""
        self._stamp = -inf
        if self.value is not None:
            self.deadline = -inf

    def _too_old(self, reason: str, words: str) -> Notice:
        key = self._name.replace(' ', '_')
        return Notice(f'{reason}_{key}', f'{self._name} is {words}; ignored')
