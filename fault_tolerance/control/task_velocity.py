# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The task velocity that is asked for, and whether it is still in force."""

from __future__ import annotations

import numpy as np

from fault_tolerance.control.input_watchdog import InputWatchdog
from fault_tolerance.control.notices import Notice
from fault_tolerance.errors import ArrayError
from fault_tolerance.mechanism.arrays import FloatArray, frozen, frozen_array


class TaskVelocity(InputWatchdog):
    """Keeps the newest usable task velocity; without one that is fresh nothing is asked for.

    Parameters
    ----------
    count : int
        Task coordinates, l.
    timeout : float
        Seconds after which a velocity is stale.
    """

    def __init__(self, count: int, timeout: float) -> None:
        super().__init__('task velocity', timeout)
        self._still = frozen(np.zeros(count))

    def offer(self, value: FloatArray, now: float, stamp: float | None) -> Notice | None:
        """Take a velocity ``value`` (l,), or return why it cannot be used.

        ``now`` and ``stamp`` are seconds, as in `InputWatchdog.offer`.
        """
        try:
            taken = frozen_array(value, self._still.shape, 'task velocity', finite=False)
        except ArrayError as error:
            return Notice('length', str(error))
        if not np.isfinite(taken).all():
            return Notice('not_finite', 'task velocity holds a number that is not finite')
        return super().offer(taken, now, stamp)

    def nothing(self) -> tuple[FloatArray, str]:
        """Return zeros (l,), and why nothing is asked for."""
        return self._still, self.missing
