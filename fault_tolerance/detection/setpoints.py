# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How far the commands have moved the setpoints between two moments."""

from __future__ import annotations

from collections import deque

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray

KEPT = 1_000_000_000
"""Nanoseconds for which a command is kept that is in force no more: longer than readings take."""


class Setpoints:
    """The integral of rate commands, each in force from its stamp to that of the next.

    Stamps are whole nanoseconds, so that a recording gives the same numbers as the live machine.

    Parameters
    ----------
    count : int
        How many drives there are.
    delay : int
        Nanoseconds from a command to its effect.
    """

    def __init__(self, count: int, delay: int = 0) -> None:
        self._delay = delay
        self._still = np.zeros(count)
        # Both in the order in which they come into force.
        self._coming: deque[tuple[int, FloatArray]] = deque()
        self._begun: deque[tuple[int, FloatArray]] = deque()

    def command(self, stamp: int, rates: FloatArray) -> None:
        """Take a command ``rates`` (N,), m/s, that was sent at ``stamp`` (ns)."""
        start = stamp + self._delay
        for commands in (self._coming, self._begun):
            # Where the clock was set back, what was to come later does not.
            while commands and commands[-1][0] >= start:
                commands.pop()
        self._coming.append((start, rates))
        self._let_begin(stamp)
        while len(self._begun) > 1 and self._begun[1][0] <= stamp - KEPT:
            self._begun.popleft()

    def moved(self, begin: int, end: int) -> FloatArray:
        """Return by how much the setpoints moved (N,) from ``begin`` to ``end`` (ns), metres."""
        self._let_begin(end)
        total, until = self._still, end
        for start, rates in reversed(self._begun):
            if start < until:
                total = total + (until - max(start, begin)) * 1e-9 * rates
                until = max(start, begin)
            if start <= begin:
                break
        return total

    def _let_begin(self, end: int) -> None:
        while self._coming and self._coming[0][0] < end:
            self._begun.append(self._coming.popleft())
