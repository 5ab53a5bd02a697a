# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""An input with a watchdog: the newest value that was fit to use, and how fresh it is."""

from __future__ import annotations

from math import inf, isfinite

from fault_tolerance.control.notices import Notice
from fault_tolerance.mechanism.arrays import FloatArray


class WatchedInput:
    """Keeps the newest usable value of one input.

    Parameters
    ----------
    name : str
        What it is, for notices: ``'joint state'``.
    timeout : float
        Seconds without a value after which the input is stale.
    ordered : bool
        Whether a value stamped earlier than the last one is left aside.
    """

    def __init__(self, name: str, timeout: float, *, ordered: bool) -> None:
        self._name = name
        self._key = name.replace(' ', '_')
        self._timeout = timeout
        self._ordered = ordered
        self._received = -inf
        self._stamp = -inf
        self.value: FloatArray | None = None

    def offer(self, value: FloatArray, now: float, stamp: float | None) -> Notice | None:
        """Take ``value``, or return why it is too old to be taken.

        Parameters
        ----------
        value : array
        now : float
            Time of receipt, seconds.
        stamp : float or None
            When it was measured or asked for; None: now. A stamp ahead of ``now`` counts as now.
        """
        given = now if stamp is None or not isfinite(stamp) else min(stamp, now)
        if now - given > self._timeout:
            text = f'{self._name} is {now - given:.3f} s old on arrival; ignored'
            return Notice(f'stale_{self._key}', text)
        if self._ordered and given < self._stamp:
            text = f'{self._name} is {self._stamp - given:.3f} s older than the last; ignored'
            return Notice(f'old_{self._key}', text)
        self.value, self._received, self._stamp = value, now, given
        return None

    def has_ceased(self, now: float) -> bool:
        """Return whether there have been values, but the last is older than the timeout."""
        return self.value is not None and now - self._received > self._timeout

    def restart_clock(self) -> None:
        """Take the values to have ceased until the next one: the clock was set back."""
        self._received = self._stamp = -inf
