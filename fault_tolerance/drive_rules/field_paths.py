# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

r"""Where in a message a value stands: names, and which element of a list belongs to which drive.

A path is names with dots between them. A name may have brackets that choose elements of a list::

    data[3]  data[{drive}]                  by index, from 0
    values[names={drive}]                   beside its equal in another list of the same object
    status[.hardware_id={drive}]            by a field of the elements themselves
    status[.name~motor {drive}\b]            the same, by a regular expression found in it

``{drive}`` stands for what messages call the drive. A path may end at a whole diagnostic status,
which is then read as text: a line ``key=value`` for its message, its level and each of its values.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fault_tolerance.errors import FaultToleranceError

DRIVE = '{drive}'
"""What stands for the drive in topics and paths."""

Value = bool | int | float | str

LONGEST_TEXT = 2000
"""Characters of a text in a message that are looked at."""

_STEP = re.compile(r'([A-Za-z]\w*)(?:\[(.*)\])?', re.DOTALL)
_INDEX = re.compile(r'\d+')
_BESIDE = re.compile(r'([A-Za-z]\w*)=(.+)', re.DOTALL)
_INSIDE = re.compile(r'\.([A-Za-z]\w*)([=~])(.+)', re.DOTALL)


class FieldError(FaultToleranceError, ValueError):
    """A path cannot be read, or does not fit a message: ``reason``."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


@dataclass(frozen=True)
class Step:
    """One name of a path, and which elements of what it names are meant."""

    name: str
    how: str = ''
    """Empty: all of it; else index, beside, inside or like."""
    key: str = ''
    """The list beside it, or the field of its elements."""
    wanted: str = ''

    def __str__(self) -> str:
        """Return it as it is written."""
        if not self.how:
            return self.name
        sign = {'index': '', 'beside': '=', 'inside': '=', 'like': '~'}[self.how]
        dot = '.' if self.how in ('inside', 'like') else ''
        return f'{self.name}[{dot}{self.key}{sign}{self.wanted}]'

    def chosen(self, owner: object) -> Iterator[tuple[str, Any]]:
        """Yield name and object of each element meant, in ``owner``; FieldError if it lacks it."""
        found = _attribute(owner, self.name)
        if not self.how:
            yield '', found
        elif self.how == 'index':
            place = int(self.wanted)
            if place < _length(found, self.name):
                yield '', found[place]
        elif self.how == 'beside':
            names = _attribute(owner, self.key)
            for place in range(min(_length(names, self.key), _length(found, self.name))):
                if str(names[place]) == self.wanted:
                    yield '', found[place]
        else:
            for place in range(_length(found, self.name)):
                text = str(_attribute(found[place], self.key))[:LONGEST_TEXT]
                if text == self.wanted if self.how == 'inside' else re.search(self.wanted, text):
                    yield text, found[place]


@dataclass(frozen=True)
class FieldPath:
    """A path through a message, see the head of this module."""

    steps: tuple[Step, ...]

    def __str__(self) -> str:
        """Return it as it is written."""
        return '.'.join(map(str, self.steps))

    @property
    def is_per_drive(self) -> bool:
        """Whether it leads elsewhere for every drive."""
        return any(DRIVE in step.wanted for step in self.steps)

    def of_drive(self, drive: str) -> FieldPath:
        """Return the path for the drive that messages call ``drive``.

        FieldError if that is no index where one is needed.
        """
        steps = []
        for step in self.steps:
            word = re.escape(drive) if step.how == 'like' else drive
            steps.append(replace(step, wanted=step.wanted.replace(DRIVE, word)))
            if step.how == 'index' and not _INDEX.fullmatch(steps[-1].wanted):
                raise FieldError(f'{drive!r} is not an index from 0 on')
            if step.how == 'like':
                _require_expression(steps[-1].wanted)
        return FieldPath(tuple(steps))

    def values(self, message: object) -> Iterator[tuple[str, Value]]:
        """Yield every value that the path leads to in ``message``, none where it has no such one.

        Each comes with the texts that chose it, which tell it from others. FieldError where a
        field is not there, or holds neither a number nor a text.
        """
        found: list[tuple[str, Any]] = [('', message)]
        for step in self.steps:
            found = [
                (f'{before}/{name}' if name else before, one)
                for before, owner in found for name, one in step.chosen(owner)
            ]
        for name, one in found:
            yield name, plain_value(one, str(self))


def field_path(text: str) -> FieldPath:
    """Return the path that ``text`` writes; FieldError if it does not."""
    return FieldPath(tuple(_step(part) for part in _parts(text)))


def plain_value(value: Any, name: str) -> Value:
    """Return ``value`` of a message as a plain number or text; FieldError about ``name``."""
    if isinstance(value, (bytes, bytearray)) and len(value) == 1:
        return value[0]
    if hasattr(value, 'item') and not hasattr(value, '__len__'):
        value = value.item()
    if isinstance(value, str):
        return value[:LONGEST_TEXT]
    if isinstance(value, (bool, int, float)):
        return value
    if hasattr(value, 'message') and hasattr(value, 'values'):
        return _status_text(value)
    raise FieldError(f'{name} is a {type(value).__name__}, neither a number nor a text')


def _status_text(status: Any) -> str:
    """Return a diagnostic status as lines, so that one expression can look at all of it."""
    pairs = [('message', status.message), ('level', plain_value(status.level, 'level'))]
    pairs += [(pair.key, pair.value) for pair in status.values]
    lines = (' '.join(f'{key}={value}'.split()) for key, value in pairs)
    return '\n'.join(lines)[:LONGEST_TEXT]


def _parts(text: str) -> list[str]:
    """Return what stands between the dots that are not in brackets."""
    parts, depth = [''], 0
    for letter in text:
        depth += (letter == '[') - (letter == ']')
        if letter == '.' and depth == 0:
            parts.append('')
        else:
            parts[-1] += letter
    return parts


def _step(text: str) -> Step:
    match = _STEP.fullmatch(text)
    if match is None:
        raise FieldError(f'{text!r} is not a name, or a name with [...] behind it')
    name, inner = match.groups()
    if inner is None:
        return Step(name)
    if _INDEX.fullmatch(inner) or inner == DRIVE:
        return Step(name, 'index', '', inner)
    if beside := _BESIDE.fullmatch(inner):
        return Step(name, 'beside', *beside.groups())
    if inside := _INSIDE.fullmatch(inner):
        key, sign, wanted = inside.groups()
        if sign == '~':
            _require_expression(wanted.replace(DRIVE, '1'))
        return Step(name, 'inside' if sign == '=' else 'like', key, wanted)
    raise FieldError(
        f'[{inner}] is none of [3], [{DRIVE}], [names=WORD], [.key=WORD], [.key~EXPRESSION]'
    )


def _require_expression(text: str) -> None:
    try:
        re.compile(text)
    except re.error as error:
        raise FieldError(f'{text!r} is not a regular expression: {error}') from None


def _attribute(owner: object, name: str) -> Any:
    try:
        return getattr(owner, name)
    except AttributeError:
        raise FieldError(f'there is no field {name!r} in a {type(owner).__name__}') from None


def _length(found: object, name: str) -> int:
    if isinstance(found, (str, bytes)) or not (
        isinstance(found, Sequence) or hasattr(found, '__len__')
    ):
        raise FieldError(f'{name} is not a list')
    return len(found)
