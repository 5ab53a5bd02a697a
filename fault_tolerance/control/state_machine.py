# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Priority of the states; the conditions are evaluated in `Supervisor.step`."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from fault_tolerance.control.estimate import Estimate

Reason = str | Estimate
"""Why a condition holds, as `str` of it says; the empty string if it does not hold.

An `Estimate` builds its text lazily in `__str__`: the verdict in words takes a millisecond.
"""

NO_FAILURE = 'no failure'
"""The reason of the nominal state."""


class State(str, Enum):
    """What the controller is doing, mildest first."""

    NOMINAL = 'nominal'
    DEGRADED = 'degraded'
    WAITING = 'waiting'
    HOLD = 'hold'
    STOPPED = 'stopped'


MOVING = (State.NOMINAL, State.DEGRADED)
"""The states in which the mechanism may move."""


class Decision(NamedTuple):
    """The state of one step, and the reason for it."""

    state: State
    reason: Reason


class StateMachine:
    """Decides on the state: the most severe condition wins.

    Waiting, hold, degraded and nominal follow the conditions of the step. Stopped is left only
    by `release`.
    """

    def __init__(self) -> None:
        self.stop: Reason = ''
        """Why motion has been stopped; empty if it has not."""

    def decide(self, stop: Reason, hold: Reason, waiting: Reason, degraded: Reason) -> Decision:
        """Return the state under the conditions of one step, each a reason, or empty.

        ``stop``: motion must end until `release`; ``hold``: motion must pause; ``waiting``: there
        has been no reading yet; ``degraded``: failures are present and tolerated.
        """
        # Keep the newest reason; the first may no longer hold.
        self.stop = stop or self.stop
        if self.stop:
            return Decision(State.STOPPED, self.stop)
        if hold:
            return Decision(State.HOLD, hold)
        if waiting:
            return Decision(State.WAITING, waiting)
        if degraded:
            return Decision(State.DEGRADED, degraded)
        return Decision(State.NOMINAL, NO_FAILURE)

    def release(self) -> bool:
        """Lift the stop, and return whether there was one.

        It comes back with the next decision if its reason still holds.
        """
        stopped = bool(self.stop)
        self.stop = ''
        return stopped
