# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How far the commands have moved the setpoints between two moments."""

from __future__ import annotations

from collections import deque

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray

LONGEST = 64
"""Commands kept: those of the longest delay, and more."""


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
        self._commands: deque[tuple[int, FloatArray]] = deque(maxlen=LONGEST)

    def command(self, stamp: int, rates: FloatArray) -> None:
        """Take a command ``rates`` (N,), m/s, that was sent at ``stamp`` (ns)."""
        self._commands.append((stamp + self._delay, rates))

    def moved(self, begin: int, end: int) -> FloatArray:
        """Return by how much the setpoints moved (N,) from ``begin`` to ``end`` (ns), metres."""
        total, until = self._still, end
        for start, rates in reversed(self._commands):
            if start < until:
                total = total + (until - max(start, begin)) * 1e-9 * rates
                until = max(start, begin)
            if start <= begin:
                break
        return total
