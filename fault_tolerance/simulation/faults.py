# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What can be broken in the simulated mechanism, in words, and what its drives report of it.

The words are those of the fault injection topic: ``[silent] MODE NAME``, mode and name in either
order. A mode is a mode of failure (``position``, ``torque``, ``hard``, their aliases), a
misbehaviour of a drive (``weak``, ``reversed``, ``runaway``) or of an encoder (``frozen``,
``biased``), or ``ok``; a name is that of an actuator or a strut, or ``all``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fault_tolerance.errors import FailureError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.failure_modes import (
    MISBEHAVIOURS,
    Misbehaviour,
    mode_from_word,
    mode_words,
)

FaultMode = Literal['position', 'torque', 'hard', 'none'] | Misbehaviour

FAULT_WORDS: dict[str, FaultMode] = {
    **{word: mode_from_word(word).value for word in mode_words()}, **MISBEHAVIOURS,
}
"""Every word for something to be wrong (or for nothing), and the mode it means."""

ENCODER_FAULTS: tuple[FaultMode, ...] = ('frozen', 'biased')
"""The modes that are of an actuator's encoder; it may have one besides a fault of its drive."""

SILENT = 'silent'
EVERYTHING = 'all'
_SHOWN_CHARACTERS = 40

# The drives of the first four are better left alone. No failure stands for the last: a drive that
# moves by itself cannot be told to stand still, and the controller stops at a mode it does not
# know.
_REPORTED: dict[FaultMode, str] = {
    'frozen': 'position',
    'biased': 'position',
    'weak': 'position',
    'reversed': 'position',
    'runaway': 'runaway',
}
_MILDEST_FIRST = ('none', 'torque', 'position', 'hard', 'runaway')


def reported_mode(fault: FaultMode) -> str:
    """Return the ``failure_mode`` that a drive reports of a ``fault``."""
    return _REPORTED.get(fault, fault)


@dataclass(frozen=True)
class FaultCommand:
    """One order to break or repair parts of the simulated mechanism.

    Attributes
    ----------
    mode : str
        What to do to them, a value of `FAULT_WORDS`; 'none' repairs.
    targets : tuple of str
        Struts for 'hard', actuators and struts for 'none', actuators for all else.
    silent : bool
        Whether the drives do not report it.
    """

    mode: FaultMode
    targets: tuple[str, ...]
    silent: bool = False


@dataclass(frozen=True)
class FaultBook:
    """What the simulated drives know is wrong: pairs of name and mode, each in order of time.

    ``drives`` are faults of actuators and struts, ``encoders`` those of actuators' encoders. A
    drive reports a fault that is not silent, and reports 'none' once such a fault is repaired. It
    knows nothing of silent faults, neither when they come nor when they go. A name that is missing
    has never reported anything.
    """

    drives: tuple[tuple[str, FaultMode], ...] = ()
    encoders: tuple[tuple[str, FaultMode], ...] = ()

    @property
    def faults(self) -> tuple[tuple[str, FaultMode], ...]:
        """Pairs of name and mode, one for each name: the gravest of its drive and its encoder."""
        gravest: dict[str, FaultMode] = {}
        for name, fault in (*self.drives, *self.encoders):
            gravest[name] = max(gravest.get(name, fault), fault, key=_gravity)
        return tuple(gravest.items())

    @property
    def reports(self) -> tuple[tuple[str, str], ...]:
        """The same with the modes that are reported (`reported_mode`)."""
        return tuple((name, reported_mode(fault)) for name, fault in self.faults)

    def after(self, command: FaultCommand) -> FaultBook:
        """Return the book after ``command``; equal to this one if no report changes."""
        drives, encoders = dict(self.drives), dict(self.encoders)
        concerned = encoders if command.mode in ENCODER_FAULTS else drives
        for target in command.targets:
            if command.mode == 'none':
                for known in (drives, encoders):
                    known.update({target: 'none'} if target in known else {})
            elif not command.silent:
                concerned[target] = command.mode
        return FaultBook(tuple(drives.items()), tuple(encoders.items()))


def _gravity(fault: FaultMode) -> int:
    return _MILDEST_FIRST.index(reported_mode(fault))


def fault_command(mechanism: Mechanism, text: str) -> FaultCommand:
    """Return what ``text``, ``[silent] MODE NAME`` or ``[silent] NAME MODE``, orders.

    `hard` of an actuator means its strut, any other mode of a strut all its actuators; `ok` of an
    actuator repairs drive and encoder and re-attaches its strut, `ok` of a strut repairs the strut
    and all actuators in it.

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
