# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What a value says about a drive: cases in their order, of which the first that holds counts."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isfinite
from typing import Literal, get_args

from fault_tolerance.drive_rules.field_paths import Value

Says = Literal['well', 'nothing', 'stuck', 'free', 'lost', 'when_off', 'worse', 'stop']

SAYS: tuple[Says, ...] = get_args(Says)

MEANING: dict[Says, str] = {
    'well': 'it follows its commands, again',
    'nothing': 'nothing changes',
    'stuck': 'it does not move',
    'free': 'it is moved by the others',
    'lost': 'its strut is off the platform',
    'when_off': 'no power: stuck or free, see when_off',
    'worse': 'unknown: the worse of stuck and free',
    'stop': 'nobody knows what has failed: the machine stops',
}


# Words that YAML makes true and false of, where they are not in quotes.
_TRUE, _FALSE = ('true', 'on', 'yes'), ('false', 'off', 'no')


@dataclass(frozen=True)
class Case:
    """One case of a rule; without any condition it holds for every value.

    Attributes
    ----------
    says : Says
    text : str
        What a person is told.
    once_enabled : bool
        Whether it says nothing until the drive was well for the first time: what a drive goes
        through while it starts is no failure.
    values : tuple
        Numbers or texts, one of which it has to be.
    mask : int or None
        Bits of a number that are compared with ``values``; None: all of it.
    bits : int or None
        Bits of which one at least has to be set.
    within : pair of float or None
        Lowest and highest number.
    expression : Pattern or None
        Has to be found in the text.
    """

    says: Says
    text: str = ''
    once_enabled: bool = False
    values: tuple[Value, ...] = ()
    mask: int | None = None
    bits: int | None = None
    within: tuple[float, float] | None = None
    expression: re.Pattern[str] | None = None

    def holds(self, value: Value) -> bool:
        """Return whether it holds for ``value``."""
        if self.expression is not None:
            return self.expression.search(str(value)) is not None
        if self.bits is not None:
            whole = _whole(value)
            return whole is not None and bool(whole & self.bits)
        if self.within is not None:
            number = number_of(value)
            return number is not None and self.within[0] <= number <= self.within[1]
        return not self.values or any(self._is(value, one) for one in self.values)

    def _is(self, value: Value, wanted: Value) -> bool:
        if isinstance(wanted, str):
            return str(value).strip().casefold() == wanted.casefold()
        number = number_of(value)
        if number is not None and self.mask is not None:
            whole = _whole(value)
            return whole is not None and whole & self.mask == wanted
        return number == wanted

    def __str__(self) -> str:
        """Return the condition in words."""
        if self.expression is not None:
            condition = f'matches {self.expression.pattern!r}'
        elif self.bits is not None:
            condition = f'has a bit of {self.bits:#x}'
        elif self.within is not None:
            condition = f'is from {self.within[0]:g} to {self.within[1]:g}'
        elif self.values:
            some = ' or '.join(map(self._written, self.values))
            condition = f'is {some}' + (f' (of {self.mask:#x})' if self.mask is not None else '')
        else:
            condition = 'is anything else'
        return condition + (', once it has been well' if self.once_enabled else '')

    def _written(self, value: Value) -> str:
        masked = self.mask is not None and isinstance(value, int)
        return f'{value:#04x}' if masked else str(value)


def number_of(value: Value) -> float | None:
    """Return ``value`` as a number; None if it is a text that is none, or not finite."""
    if isinstance(value, str):
        word = value.strip().casefold()
        if word in _TRUE or word in _FALSE:
            return float(word in _TRUE)
        try:
            return float(int(word, 0))
        except ValueError:
            pass
        try:
            value = float(word)
        except ValueError:
            return None
    return float(value) if isfinite(value) else None


def shown(value: Value) -> str:
    """Return ``value`` for people: whole numbers with their bits, texts in one line."""
    whole = _whole(value)
    if isinstance(value, (str, bool)) or whole is None or whole != value:
        return ' '.join(str(value).split())
    return f'{whole} ({whole:#x})'


def _whole(value: Value) -> int | None:
    number = number_of(value)
    return int(number) if number is not None and number == int(number) else None
