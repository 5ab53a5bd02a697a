# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Work for the time between messages, so that no command waits for it.

A node notes here what is due; the loop that spins it (`fault_tolerance.nodes.spinning`) does it
when no message is waiting. Work that takes long is only begun when the next regular message is
not about to come.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

SHARE = 0.7
"""Share of the time between two regular messages that may have passed when a job is done."""

LONGEST_PERIOD = 1.0
"""Seconds; messages further apart are not regular."""

_SMOOTHING = 0.1
_QUIET = 2.5
_SHORTEST_QUIET = 0.004


class Job:
    """One kind of work.

    Parameters
    ----------
    work : callable
        Does a piece of it; returns whether there is more.
    urgent : bool
        Whether it is done even if the next message may have to wait for it.
    """

    def __init__(self, work: Callable[[], bool], *, urgent: bool = False) -> None:
        self.due = False
        self.urgent = urgent
        self.cost = 0.0
        self._work = work

    def do(self) -> None:
        """Do a piece of it, and learn how long that takes."""
        begin = monotonic()
        # Should it fail, it is not tried again and again.
        self.due = False
        self.due = self._work()
        taken = monotonic() - begin
        self.cost = max(taken, self.cost + _SMOOTHING * (taken - self.cost))


class IdleTime:
    """Chooses what to do between messages.

    Parameters
    ----------
    jobs : Job
        The most important one first.
    """

    def __init__(self, *jobs: Job) -> None:
        self.activity = 0
        """Counts callbacks: unchanged over a turn of the executor, nothing was waiting."""
        self._jobs = jobs
        self._arrived = 0.0
        self._period = LONGEST_PERIOD

    def regular_message(self, now: float) -> None:
        """Note that a message of the regular kind has arrived."""
        between = now - self._arrived
        self._arrived = now
        if between < LONGEST_PERIOD:
            self._period += _SMOOTHING * (between - self._period)

    def next_job(self) -> Job | None:
        """Return what may be done now, or None."""
        passed = left = -1.0
        for job in self._jobs:
            if not job.due:
                continue
            if job.urgent:
                return job
            if left < 0.0:
                passed = monotonic() - self._arrived
                left = max(SHARE * self._period - passed, 0.0)
            quiet = passed > max(_QUIET * self._period, _SHORTEST_QUIET)
            if quiet or job.cost < left:
                return job
        return None
