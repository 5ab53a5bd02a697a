# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What can be broken in the simulated mechanism, in words, and what its drives report of it.

The words are those of the fault injection topic:
``[silent] <position|torque|hard|ok> <actuator|strut|all>``, mode and name in either order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fault_tolerance.errors import FailureError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.failure_modes import mode_from_word, mode_words

FaultMode = Literal['position', 'torque', 'hard', 'none']

FAULT_WORDS: dict[str, FaultMode] = {word: mode_from_word(word).value for word in mode_words()}
"""Every word for a mode of failure (or for none), and the mode it means."""

SILENT = 'silent'
EVERYTHING = 'all'
_SHOWN_CHARACTERS = 40


@dataclass(frozen=True)
class FaultCommand:
    """One order to break or repair parts of the simulated mechanism.

    Attributes
    ----------
    mode : {'position', 'torque', 'hard', 'none'}
        What to do to them; 'none' repairs.
    targets : tuple of str
        Actuators for 'position' and 'torque', struts for 'hard', both for 'none'.
    silent : bool
        Whether the drives do not report it.
    """

    mode: FaultMode
    targets: tuple[str, ...]
    silent: bool = False


@dataclass(frozen=True)
class FaultBook:
    """What the simulated drives report: ``reports`` holds pairs of name and mode, oldest first.

    A drive reports a fault that is not silent, and reports 'none' once such a fault is repaired.
    It knows nothing of silent faults, neither when they come nor when they go. A name that is
    missing in ``reports`` has never reported anything.
    """

    reports: tuple[tuple[str, FaultMode], ...] = ()

    def after(self, command: FaultCommand) -> FaultBook:
        """Return the book after ``command``; equal to this one if no report changes."""
        reports = dict(self.reports)
        for target in command.targets:
            mends = command.mode == 'none'
            if (mends and target in reports) or not (mends or command.silent):
                reports[target] = command.mode
        return FaultBook(tuple(reports.items()))


def fault_command(mechanism: Mechanism, text: str) -> FaultCommand:
    """Return what ``text``, ``[silent] MODE NAME`` or ``[silent] NAME MODE``, orders.

    `position` and `torque` of a strut mean all its actuators, `hard` of an actuator means its
    strut; `ok` of an actuator repairs the actuator and re-attaches its strut, `ok` of a strut
    repairs the strut and all actuators in it.

    Raises `FailureError`, which lists the valid words, if the text does not follow the grammar,
    a word is unknown, or ``mechanism`` has no such part.
    """
    mode, name, silent = fault_words(text, _names(mechanism))
    return FaultCommand(mode, _targets(mechanism, mode, name), silent)


def fault_words(text: str, names: tuple[str, ...] = ()) -> tuple[FaultMode, str, bool]:
    """Return mode, name, and whether it is silent, of a fault command for any mechanism.

    The name in ``text`` is not checked; known ``names`` make better errors. Raises `FailureError`,
    which lists the valid words, if the text does not follow the grammar.
    """
    words = text.split()
    silent = bool(words) and words[0].lower() == SILENT
    words = words[1:] if silent else words
    if len(words) != 2:
        expected = 'expected [silent] and two words, a mode and a name'
        raise FailureError(_shortened(text), expected, (*FAULT_WORDS, *names))
    mode_word, name = words
    name_first = name.lower() in FAULT_WORDS or mode_word in names
    if mode_word.lower() not in FAULT_WORDS and name_first:
        name, mode_word = words
    if mode_word.lower() not in FAULT_WORDS:
        raise FailureError(_shortened(mode_word), 'unknown mode', tuple(FAULT_WORDS))
    return FAULT_WORDS[mode_word.lower()], name, silent


def _targets(mechanism: Mechanism, mode: FaultMode, name: str) -> tuple[str, ...]:
    """Return the names of all that ``name`` means for ``mode``."""
    if name not in _names(mechanism):
        raise FailureError(_shortened(name), 'unknown actuator or strut', _names(mechanism))
    if name == EVERYTHING:
        actuators, struts = mechanism.actuator_names, mechanism.strut_names
    elif name in mechanism.strut_names:
        actuators, struts = mechanism.actuators_of(name), (name,)
    else:
        strut = mechanism.strut_of(name)
        actuators, struts = (name,), (strut,) if strut else ()
    if mode == 'none':
        return (*actuators, *struts)
    targets = struts if mode == 'hard' else actuators
    if not targets:
        missing = 'no strut can be lost' if mode == 'hard' else 'no actuator in the strut'
        valid = mechanism.strut_names if mode == 'hard' else mechanism.actuator_names
        raise FailureError(_shortened(name), missing, valid)
    return targets


def _names(mechanism: Mechanism) -> tuple[str, ...]:
    return (*mechanism.actuator_names, *mechanism.strut_names, EVERYTHING)


def _shortened(word: str) -> str:
    """Return ``word`` fit for a message, whatever was sent."""
    return word if len(word) <= _SHOWN_CHARACTERS else word[:_SHOWN_CHARACTERS] + '...'
