# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Tables of legs, one leg a line, as CSV: read, and written."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from math import inf, isfinite, isnan
from pathlib import Path

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.leg_types import LEG_TYPES, NEEDS, Leg
from fault_tolerance.machines.units import Units
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.parts import Actuator

_VECTORS = ('base', 'platform', 'hinge', 'slide', 'knee')
_DRIVE = ('home', 'sign', 'low', 'high', 'rate')
_LARGEST = 1e9
"""Metres."""

COLUMNS = (
    'name', 'type', *(f'{vector}_{axis}' for vector in _VECTORS for axis in 'xyz'), *_DRIVE,
)
"""All columns there are."""


def legs_from_table(path: Path, kind: str, units: Units) -> list[Leg]:
    """Return the legs that the CSV file ``path`` lists, in metres and radians.

    Parameters
    ----------
    path : Path
        The first line names the columns (`COLUMNS`, in any case, with blanks or underscores).
        Lines that begin with # do not count. Columns are separated by commas, by semicolons (with
        decimal commas or points) or by tabs.
    kind : str
        The type of legs of which the table does not say it.
    units : Units
        Of the table.

    Returns
    -------
    list of Leg

    Raises
    ------
    MechanismError
        With file, line and column of what is wrong.
    """
    source = str(path)
    legs = [_leg(row, number, kind, units) for number, row in enumerate(_rows(path), start=1)]
    if not legs:
        raise MechanismError(source, '', 'lists no leg')
    return legs


class _Row:
    """One line of a table, read column by column."""

    def __init__(self, source: str, line: int, cells: Mapping[str, str], comma: bool) -> None:
        self._source, self._line, self._cells, self._comma = source, line, cells, comma

    def error(self, column: str, reason: str) -> MechanismError:
        return MechanismError(self._source, f'line {self._line}: {column}', reason)

    def text(self, column: str) -> str:
        """Return what is in a column; empty where there is no such column."""
        return self._cells.get(column, '')

    def number(self, column: str, default: float | None = None) -> float:
        text = self.text(column)
        if not text:
            if default is not None:
                return default
            missing = 'is empty' if column in self._cells else 'the table has no such column'
            raise self.error(column, missing)
        try:
            number = float(text.replace(',', '.') if self._comma else text)
        except ValueError:
            raise self.error(column, f'{text!r} is not a number') from None
        if isnan(number):
            raise self.error(column, 'is NaN')
        return number

    def vector(self, name: str, factor: float) -> FloatArray:
        numbers = np.array([factor * self.number(f'{name}_{axis}') for axis in 'xyz'])
        if not (np.abs(numbers) <= _LARGEST).all():
            raise self.error(name, 'is not finite, or is out of all proportion')
        return numbers


def _rows(path: Path) -> Iterator[_Row]:
    source = str(path)
    try:
        lines = path.read_text(encoding='utf-8-sig').splitlines()
    except OSError as error:
        reason = f'cannot be read ({error.strerror or error})'
        raise MechanismError(source, '', reason) from None
    except UnicodeDecodeError:
        raise MechanismError(source, '', 'is not UTF-8 text') from None
    used = [(number, line) for number, line in enumerate(lines, start=1)
            if line.strip(' ,;\t') and not line.lstrip().startswith('#')]
    if not used:
        raise MechanismError(source, '', 'is empty')
    first = used[0][1]
    mark = max(',;\t', key=first.count)
    names = [name.strip().lower().replace(' ', '_')
             for name in next(csv.reader([first], delimiter=mark))]
    for place, name in enumerate(names):
        if name not in COLUMNS:
            reason = f'{name!r} is not a column; the first line names them: {", ".join(COLUMNS)}'
            raise MechanismError(source, f'line {used[0][0]}', reason)
        if name in names[:place]:
            raise MechanismError(source, f'line {used[0][0]}', f'the column {name!r} comes twice')
    for line, text in used[1:]:
        cells = [cell.strip() for cell in next(csv.reader([text], delimiter=mark))]
        if len(cells) > len(names) and any(cells[len(names):]):
            reason = f'has {len(cells)} cells, the first line {len(names)}'
            if mark == ',':
                reason += ' (decimal commas need semicolons between cells)'
            raise MechanismError(source, f'line {line}', reason)
        yield _Row(source, line, dict(zip(names, cells, strict=False)), mark == ';')


def _leg(row: _Row, number: int, kind: str, units: Units) -> Leg:
    kind = (row.text('type') or kind).upper()
    if kind not in LEG_TYPES:
        raise row.error('type', f'{kind!r} is not one of {", ".join(LEG_TYPES)}')
    given = {name for name in ('hinge', 'slide', 'knee') if row.text(f'{name}_x')}
    for name in sorted(given.difference(NEEDS[kind])):
        raise row.error(name, f'is not for legs of type {kind}')
    extra: dict[str, FloatArray] = {
        name: row.vector(name, units.metres if name == 'knee' else 1.0) for name in NEEDS[kind]
    }
    factor = units.metres if 'P' in kind else units.radians
    sign = row.number('sign', 1.0)
    if sign not in (-1.0, 1.0):
        raise row.error('sign', f'{sign:g} is neither 1 nor -1')
    name = row.text('name') or f'leg_{number}'
    try:
        drive = Actuator(
            name,
            position=(factor * row.number('low', -inf), factor * row.number('high', inf)),
            velocity=factor * row.number('rate', inf),
            home=factor * row.number('home', 0.0), sign=int(sign),
        )
    except MechanismError as error:
        column = {'position': 'low, high', 'velocity': 'rate'}.get(error.key, error.key)
        raise row.error(column, error.reason) from None
    base, platform = (row.vector(name, units.metres) for name in ('base', 'platform'))
    return Leg(kind, base, platform, drive, **extra)


def leg_table(
    legs: Sequence[Leg], units: Units, remarks: Sequence[str] = (), digits: int = 15
) -> str:
    """Return ``legs`` as a CSV table in ``units``, below ``remarks``, a line each.

    Numbers have so many significant ``digits``.
    """
    text = StringIO()
    text.writelines(f'# {line}\n' for line in remarks)
    rows = [_cells(leg, units, digits) for leg in legs]
    used = [column for column in COLUMNS if any(row.get(column) for row in rows)]
    writer = csv.DictWriter(text, used, restval='', lineterminator='\n')
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _cells(leg: Leg, units: Units, digits: int) -> dict[str, str]:
    drive, factor = leg.drive, units.radians if leg.turns else units.metres
    size = max(float(np.abs(point).max()) for point in leg.points)
    cells = {'name': drive.name, 'type': leg.kind}
    for name in _VECTORS:
        vector = getattr(leg, name)
        if vector is not None:
            directed = name in ('hinge', 'slide')
            scale = 1.0 if directed else units.metres
            nothing = 1e-15 * (float(np.abs(vector).max()) if directed else size)
            cells |= {
                f'{name}_{axis}': f'{value / scale if abs(value) > nothing else 0:.{digits}g}'
                for axis, value in zip('xyz', vector, strict=True)
            }
    numbers = {'low': drive.position[0], 'high': drive.position[1], 'rate': drive.velocity}
    if drive.home or drive.sign < 0:
        numbers['home'] = drive.home
        cells['sign'] = str(drive.sign)
    return cells | {
        name: f'{value / factor:.{digits}g}' for name, value in numbers.items() if isfinite(value)
    }
