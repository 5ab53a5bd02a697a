# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What a first motion has found: which entry of the file is wrong, and what it should be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

Level = Literal['wrong', 'warning', 'unknown']
"""Something to put right; something to know; something this machine does not show."""

Entry = Literal[
    'joint_state_name', 'home', 'actuators', 'sign', 'encoder',
    'unit', 'polarity', 'drive', 'delay', 'return',
]
"""The first five are keys of a mechanism file, the others are matters of drives and drivers."""


@dataclass(frozen=True)
class Finding:
    """One thing found.

    Attributes
    ----------
    entry : str
        A key of the mechanism file, or what of the drive.
    actuators : tuple of str
        Whose; several where it may be any of them.
    text : str
        One line for a person.
    level : str
        ``wrong``, ``warning`` or ``unknown``.
    given, probable : object
        What the file has and what it should probably have: a number, a word, a list of names, or
        by actuator where there are several; for units the factor read.
    """

    entry: Entry
    actuators: tuple[str, ...]
    text: str
    level: Level = 'wrong'
    given: Any = None
    probable: Any = None

    def as_data(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            'entry': self.entry, 'actuators': list(self.actuators), 'level': self.level,
            'given': self.given, 'probable': self.probable, 'text': self.text,
        }


def wrong(findings: Sequence[Finding]) -> bool:
    """Return whether any of the ``findings`` is something to put right."""
    return any(one.level == 'wrong' for one in findings)


def listed(names: Sequence[str], last: str = 'and') -> str:
    """Return ``names`` as in a sentence, with the word ``last`` before the last one."""
    if len(names) < 2:
        return ''.join(names)
    return f'{", ".join(names[:-1])} {last} {names[-1]}'


def quantity(value: float, turning: bool) -> str:
    """Return ``value`` with its unit: metres, or radians where it is ``turning``."""
    base = 'rad' if turning else 'm'
    size = abs(value)
    if size == 0.0:
        return f'0 {base}'
    for factor, prefix in ((1.0, ''), (1e-3, 'm'), (1e-6, 'µ')):
        if size >= 0.9995 * factor:
            return f'{value / factor:.3g} {prefix}{base}'
    return f'{value / 1e-9:.3g} n{base}'
