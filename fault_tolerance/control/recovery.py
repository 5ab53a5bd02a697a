# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The state of the controller: the most severe condition wins, and a stop stays."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple


class State(str, Enum):
    """What the controller is doing, mildest first."""

    NOMINAL = 'nominal'
    DEGRADED = 'degraded'
    WAITING = 'waiting'
    HOLD = 'hold'
    STOPPED = 'stopped'


_MOVING = (State.NOMINAL, State.DEGRADED)


@dataclass(frozen=True)
class Conditions:
    """What holds in one cycle, each as the reason for it; empty: it does not hold.

    Attributes
    ----------
    stop : str
        Motion must end until someone has looked.
    hold : str
        Motion must pause.
    waiting : str
        There is nothing to go by yet.
    degraded : str
        Failures are present and tolerated.
    nominal : str
        What is to be said when none of these holds.
    """

    stop: str = ''
    hold: str = ''
    waiting: str = ''
    degraded: str = ''
    nominal: str = ''


class Decision(NamedTuple):
    """The state of one cycle and the reason for it, a sentence."""

    state: State
    reason: str

    @property
    def moves(self) -> bool:
        """Whether the mechanism may move."""
        return self.state in _MOVING


class StateMachine:
    """Decides on the state: the most severe condition wins, and a stop stays.

    Waiting, hold, degraded and nominal follow the conditions of the cycle. Stopped is left only
    by `release`.
    """

    def __init__(self) -> None:
        self._stop = ''

    @property
    def stop(self) -> str:
        """Why motion has been stopped; empty if it has not."""
        return self._stop

    def decide(self, conditions: Conditions) -> Decision:
        """Return the state under ``conditions``."""
        # The reason at hand is of more use than the first one, which may be history.
        self._stop = conditions.stop or self._stop
        by_severity = (
            (State.STOPPED, self._stop),
            (State.HOLD, conditions.hold),
            (State.WAITING, conditions.waiting),
            (State.DEGRADED, conditions.degraded),
        )
        for state, reason in by_severity:
            if reason:
                return Decision(state, reason)
        return Decision(State.NOMINAL, conditions.nominal)

    def release(self) -> bool:
        """Lift the stop; it returns with the next decision if its reason still holds.

        Returns
        -------
        bool
            Whether there was one.
        """
        stopped = bool(self._stop)
        self._stop = ''
        return stopped
