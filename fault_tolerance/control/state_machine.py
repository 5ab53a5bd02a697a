# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The state of the controller: the most severe condition wins, and a stop stays.

The conditions are found elsewhere: those about inputs in `Supervisor.step`, those about readings
as the obstacle of an `Estimate`, those about the command as the obstacle of a `RateCommand`.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

Reason = object
"""Why a condition holds: anything that is true and whose `str` says it; a string as a rule.

Words that take time to find are an object that finds them when they are asked for.
"""


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
    """The state of one cycle, and the reason for it."""

    state: State
    reason: Reason


class StateMachine:
    """Decides on the state: the most severe condition wins.

    Waiting, hold, degraded and nominal follow the conditions of the cycle. Stopped is left only
    by `release`.
    """

    def __init__(self) -> None:
        self.stop: Reason = ''
        """Why motion has been stopped; empty if it has not."""

    def decide(
        self, stop: Reason, hold: Reason, waiting: Reason, degraded: Reason, nominal: Reason
    ) -> Decision:
        """Return the state under the conditions of one cycle; a false one does not hold.

        Parameters
        ----------
        stop : Reason
            Motion must end until someone has looked.
        hold : Reason
            Motion must pause.
        waiting : Reason
            There is nothing to go by yet.
        degraded : Reason
            Failures are present and tolerated.
        nominal : Reason
            What is to be said when none of these holds.
        """
        # The present reason is of more use than the first one, which may no longer hold.
        self.stop = stop or self.stop
        if self.stop:
            return Decision(State.STOPPED, self.stop)
        if hold:
            return Decision(State.HOLD, hold)
        if waiting:
            return Decision(State.WAITING, waiting)
        if degraded:
            return Decision(State.DEGRADED, degraded)
        return Decision(State.NOMINAL, nominal)

    def release(self) -> bool:
        """Lift the stop, and return whether there was one.

        It comes back with the next decision if its reason still holds.
        """
        stopped = bool(self.stop)
        self.stop = ''
        return stopped
