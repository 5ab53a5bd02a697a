# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The failure modes of a strut or an actuator, and the words for them.

What a mode does to J and T is in kinematics/differential.py, for control in kernel/jacobians.py.
"""

from __future__ import annotations

from enum import Enum
from typing import Literal

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
        return _MILDEST_FIRST.index(self)


_MILDEST_FIRST = (FailureMode.NONE, FailureMode.TORQUE, FailureMode.POSITION, FailureMode.HARD)

HEALTH_WORDS = ('none', 'ok', 'healthy', 'clear')
_ALIASES = {
    FailureMode.POSITION: ('position', 'stuck', 'locked'),
    FailureMode.TORQUE: ('torque', 'free', 'unactuated'),
    FailureMode.HARD: ('hard', 'lost', 'broken'),
    FailureMode.NONE: HEALTH_WORDS,
}
_WORDS = {word: mode for mode, words in _ALIASES.items() for word in words}

Misbehaviour = Literal['frozen', 'biased', 'weak', 'reversed', 'runaway']

MISBEHAVIOURS: dict[str, Misbehaviour] = {
    'frozen': 'frozen',
    'encoder': 'frozen',
    'biased': 'biased',
    'weak': 'weak',
    'reversed': 'reversed',
    'runaway': 'runaway',
}
"""Words for what else an encoder or a drive may do, none of them a mode of failure: only the
simulator is told so (simulation/faults.py)."""


def mode_words() -> tuple[str, ...]:
    """Return every word that names a mode."""
    return tuple(_WORDS)


def mode_from_word(word: str) -> FailureMode:
    """Return the mode that ``word`` names, in any case; FailureError if it names none."""
    mode = _WORDS.get(word.strip().lower())
    if mode is None:
        raise FailureError(word, 'unknown failure mode', mode_words())
    return mode
