# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The words for what can happen to a strut or an actuator."""

from __future__ import annotations

from enum import Enum

from fault_tolerance.errors import FailureError


class FailureMode(str, Enum):
    """The three failures of a strut or actuator, and none."""

    POSITION = 'position'
    TORQUE = 'torque'
    HARD = 'hard'
    NONE = 'none'

    @property
    def severity(self) -> int:
        """Which of two modes of one actuator counts: hard over position over torque."""
        return _SEVERITY[self]


_SEVERITY = {
    FailureMode.NONE: 0,
    FailureMode.TORQUE: 1,
    FailureMode.POSITION: 2,
    FailureMode.HARD: 3,
}

_WORDS = {
    'position': FailureMode.POSITION,
    'stuck': FailureMode.POSITION,
    'locked': FailureMode.POSITION,
    'torque': FailureMode.TORQUE,
    'free': FailureMode.TORQUE,
    'unactuated': FailureMode.TORQUE,
    'hard': FailureMode.HARD,
    'lost': FailureMode.HARD,
    'broken': FailureMode.HARD,
    'none': FailureMode.NONE,
    'ok': FailureMode.NONE,
    'healthy': FailureMode.NONE,
    'clear': FailureMode.NONE,
}


def mode_words() -> tuple[str, ...]:
    """Return every word that names a mode."""
    return tuple(_WORDS)


def mode_from_word(word: str) -> FailureMode:
    """Return the mode that ``word`` names, in any case and with any of its aliases.

    Raises
    ------
    FailureError
        If it names none.
    """
    mode = _WORDS.get(word.strip().lower())
    if mode is None:
        raise FailureError(word, 'unknown failure mode', mode_words())
    return mode
