# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Typed reading of a parsed YAML document, with errors that say where and why."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from math import isnan
from pathlib import Path
from typing import Any

import yaml

from fault_tolerance.errors import ArrayError, MechanismError

# YAML 1.1 reads 1e-3 (no dot) and -.5 as text; people write them as numbers.
_NUMBER_AS_TEXT = re.compile(r'[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+|[-+]\.\d+')
_ELEMENT = re.compile(r'<([A-Za-z]\w*)')
_XML = {'robot': 'a URDF', 'mujoco': 'an MJCF', 'mujocoinclude': 'an MJCF', 'sdf': 'an SDF'}
_LARGEST_FILE = 16 * 1024 * 1024
_MERGE = 'tag:yaml.org,2002:merge'


class _Loader(yaml.SafeLoader):
    """A safe loader that refuses a key given twice (plain YAML keeps the last one silently)."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return the mapping that ``node`` stands for; a doubled key is an error with its line."""
        seen = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                continue  # refused by the base class
            if key_node.value in seen:
                line = key_node.start_mark.line + 1
                raise yaml.YAMLError(f'line {line}: the key {key_node.value!r} is given twice')
            seen.add(key_node.value)
        return super().construct_mapping(node, deep)

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Put in what ``<<`` refers to: each key once, own ones first, then those named first.

        PyYAML would not do: its versions disagree on which of several sources counts, and merges
        of merges take time that grows exponentially.
        """
        merged: dict[object, tuple[yaml.Node, yaml.Node]] = {}
        own = {}
        # Empty in the meantime: a mapping may refer to itself.
        pairs, node.value = node.value, []
        for key_node, value_node in pairs:
            if key_node.tag != _MERGE:
                own[_identity(key_node)] = (key_node, value_node)
                continue
            several = isinstance(value_node, yaml.SequenceNode)
            for source in value_node.value if several else [value_node]:
                if not isinstance(source, yaml.MappingNode):
                    line = source.start_mark.line + 1
                    raise yaml.YAMLError(f'line {line}: << does not refer to keys and values')
                self.flatten_mapping(source)
                for pair in source.value:
                    merged.setdefault(_identity(pair[0]), pair)
        node.value = list((merged | own).values())
        super().flatten_mapping(node)


def _identity(key_node: yaml.Node) -> object:
    return key_node.value if isinstance(key_node, yaml.ScalarNode) else id(key_node)


class Section:
    """The mapping ``content`` at ``path`` of the document ``source``, read key by key, by type.

    Every method takes a ``key`` of the mapping, and raises `MechanismError` that says where in the
    document it stands and what is wrong with it.
    """

    def __init__(self, source: str, path: str, content: object) -> None:
        self.source = source
        self.path = path
        if not isinstance(content, dict):
            raise self.error('', f'is {_described(content)}, expected keys and values')
        self._content: dict[object, object] = content
        self._read: set[object] = set()

    def error(self, key: object, reason: str) -> MechanismError:
        """Return the error that ``key`` of this mapping is wrong, and the ``reason``."""
        return MechanismError(self.source, self.where(key), reason)

    @contextmanager
    def located(self) -> Iterator[None]:
        """Yield once, and let errors about what is made inside say where in the document it is."""
        try:
            yield
        except ArrayError as error:
            # Arrays of a joint are named as in 'axis of hinge_1'.
            raise self.error(error.name.partition(' of ')[0], error.reason) from None
        except MechanismError as error:
            raise self.error(error.key, error.reason) from None

    def where(self, key: object) -> str:
        """Return the full path of ``key``."""
        text = str(key)
        # A line break in a key must not make two lines of an error.
        return '.'.join(part for part in (self.path, text if text.isprintable() else ascii(text))
                        if part)

    def has(self, key: object) -> bool:
        """Return whether ``key`` is given (and not null)."""
        return self._content.get(key) is not None

    def get(self, key: object) -> object:
        """Return what is given at ``key``; it must be given."""
        self._read.add(key)
        value = self._content.get(key)
        if value is None:
            raise self.error(key, 'is missing')
        return value

    def text(self, key: object) -> str:
        """Return the name at ``key``: one line that is not empty."""
        value = self.get(key)
        if not _is_name(value):
            raise self.error(key, f'is {_described(value)}, expected a name{_quotes(value)}')
        return str(value)

    def number(self, key: object, default: float | None = None) -> float:
        """Return the number at ``key``, or ``default``; infinities are numbers, NaN is none."""
        if default is not None and not self.has(key):
            self._read.add(key)
            return default
        return self.as_number(key, self.get(key))

    def flag(self, key: object) -> bool:
        """Return true or false as given at ``key``, false if not given."""
        if not self.has(key):
            self._read.add(key)
            return False
        value = self.get(key)
        if not isinstance(value, bool):
            raise self.error(key, f'is {_described(value)}, expected true or false')
        return value

    def items(self, key: object) -> list[object]:
        """Return the list at ``key``."""
        value = self.get(key)
        if not isinstance(value, list):
            raise self.error(key, f'is {_described(value)}, expected a list')
        return value

    def numbers(self, key: object, count: int) -> list[float]:
        """Return the list of ``count`` numbers at ``key``."""
        return self.as_numbers(key, self.get(key), count)

    def matrix(self, key: object) -> list[list[float]]:
        """Return the rows of numbers at ``key``, all of one length."""
        rows: list[list[float]] = []
        for index, row in enumerate(self.items(key)):
            if not isinstance(row, list):
                raise self.error(f'{key}[{index}]', f'is {_described(row)}, expected a row')
            rows.append(self.as_numbers(f'{key}[{index}]', row, len(row)))
            if len(row) != len(rows[0]):
                reason = f'has {len(row)} numbers, the first row {len(rows[0])}'
                raise self.error(f'{key}[{index}]', reason)
        if not rows or not rows[0]:
            raise self.error(key, 'is empty')
        return rows

    def names(self, key: object) -> tuple[str, ...]:
        """Return the list of names at ``key``."""
        values = self.items(key)
        for index, value in enumerate(values):
            if not _is_name(value):
                reason = f'is {_described(value)}, expected a name{_quotes(value)}'
                raise self.error(f'{key}[{index}]', reason)
        return tuple(str(value) for value in values)

    def sections(self, key: object) -> Iterator[Section]:
        """Yield the mappings of the list at ``key``, known by their names where they have one."""
        for index, value in enumerate(self.items(key)):
            name = value.get('name') if isinstance(value, dict) else None
            label = name if _is_name(name) else f'[{index}]'
            yield Section(self.source, self.where(f'{key}.{label}'), value)

    def section(self, key: object) -> Section:
        """Return the mapping at ``key``."""
        return Section(self.source, self.where(key), self.get(key))

    def keys(self) -> tuple[object, ...]:
        """Return every key given."""
        return tuple(self._content)

    def close(self) -> None:
        """Raise if a key was given that nobody read."""
        unknown = [str(key) for key in self._content if key not in self._read]
        if unknown:
            raise self.error(unknown[0], 'is not a known key here')

    def as_number(self, key: object, value: object) -> float:
        """Return ``value``, found at ``key``, as a number."""
        if isinstance(value, str) and _NUMBER_AS_TEXT.fullmatch(value):
            value = float(value)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.error(key, f'is {_described(value)}, expected a number')
        try:
            number = float(value)
        except OverflowError:
            raise self.error(key, 'is too large') from None
        if isnan(number):
            raise self.error(key, 'is NaN')
        return number

    def as_numbers(self, key: object, value: object, count: int) -> list[float]:
        """Return ``value``, found at ``key``, as a list of ``count`` numbers."""
        if not isinstance(value, list) or len(value) != count:
            raise self.error(key, f'is {_described(value)}, expected {count} numbers')
        return [self.as_number(f'{key}[{index}]', item) for index, item in enumerate(value)]


def file_text(path: str | Path, what: str) -> str:
    """Return the text in the file ``path``, which is to be ``what``.

    MechanismError, one line with the path, if it cannot be read.
    """
    source = str(path)
    try:
        if Path(path).stat().st_size > _LARGEST_FILE:
            raise MechanismError(source, '', f'is too large to be {what}')
        return Path(path).read_text(encoding='utf-8')
    except OSError as error:
        reason = f'cannot be read ({error.strerror or error})'
        raise MechanismError(source, '', reason) from None
    except UnicodeDecodeError:
        raise MechanismError(source, '', 'is not UTF-8 text') from None


def parsed(text: str, source: str) -> Section:
    """Return the YAML document ``text`` of ``source``; MechanismError if it is none."""
    if text.lstrip()[:1] == '<':
        root = _ELEMENT.search(text)
        kind = _XML.get(root[1] if root else '', 'XML')
        raise MechanismError(source, '', f'is {kind}; a mechanism file is YAML (docs/adapting.md)')
    try:
        content = yaml.load(text, Loader=_Loader)
    except (yaml.YAMLError, ValueError) as error:
        raise MechanismError(source, '', f'is not YAML: {_one_line(error)}') from None
    except RecursionError:
        raise MechanismError(source, '', 'is not YAML: nested too deeply') from None
    return Section(source, '', content)


def _quotes(value: object) -> str:
    """Return what to do where YAML has read a name as something else."""
    return f' (write "{value}" in quotes)' if isinstance(value, (int, float)) else ''


def _is_name(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip()) and value.isprintable()


def _one_line(error: Exception) -> str:
    mark, problem = getattr(error, 'problem_mark', None), getattr(error, 'problem', None)
    if mark is not None and problem:
        return f'line {mark.line + 1}: {problem}'
    return ' '.join(str(error).split())


def _described(value: object) -> str:
    if value is None:
        return 'empty'
    if isinstance(value, dict):
        return 'a mapping'
    if isinstance(value, list):
        return f'a list of {len(value)}'
    shown = repr(value)
    return shown if len(shown) <= 40 else shown[:37] + '...'
