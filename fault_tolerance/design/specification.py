# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What is to be designed: a mechanism file, which of its numbers are free, and what for."""

from __future__ import annotations

import re
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from math import cos, isfinite, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from fault_tolerance.design.grids import Grid, axis_from_text
from fault_tolerance.design.objectives import MEASURES, Objective
from fault_tolerance.errors import FaultToleranceError, MechanismError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.catalogue import mechanism_path
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.files import mechanism_from_document, mechanism_from_file
from fault_tolerance.mechanism.reading import Section, parsed

_STEP = re.compile(r'([^\[\]]*)((?:\[\d+\])*)')
_VECTORS = ('axis', 'point')


@dataclass(frozen=True)
class FreeNumber:
    """A number that may be anything within its range, wherever it stands in the file."""

    paths: tuple[str, ...]
    """Such as ``struts.strut_1.joints.ball_1.point[0]``; with a leading minus its negative."""
    low: float
    high: float


@dataclass(frozen=True)
class Symmetry:
    """A strut that is another one, turned about the z axis of the base."""

    source: str
    target: str
    turn: float
    """Radians."""


@dataclass(frozen=True, eq=False)
class Specification:
    """A design to be made."""

    name: str
    file: Path
    """Of the mechanism to begin with."""
    document: dict[str, Any]
    """What is in it."""
    free: tuple[FreeNumber, ...]
    symmetry: tuple[Symmetry, ...]
    aim: bool
    """Whether sliding drives point from the joint below to the one above."""
    objectives: tuple[Objective, ...]
    grid: Grid | None
    """The poses at which the objectives count; None: home."""
    distance: float
    """Metres that struts keep from each other at home."""
    strokes: bool
    """Whether all poses have to be within strokes."""
    population: int
    generations: int
    polish: int
    """How many of the best designs tried are polished."""
    seed: int
    tradeoff: int
    """How many designs between two objectives are wanted; 0: none."""

    def __repr__(self) -> str:
        return f'Specification({self.name!r}, {len(self.free)} free numbers)'

    def documented(self, values: FloatArray) -> dict[str, Any]:
        """Return the mechanism file with the free numbers at ``values``."""
        document = deepcopy(self.document)
        for one, value in zip(self.free, values, strict=True):
            for path in one.paths:
                sign = -1.0 if path.startswith('-') else 1.0
                holder, key = _place(document, path.removeprefix('-'))
                holder[key] = sign * float(value)
        struts = {strut['name']: strut for strut in document.get('struts', ())}
        for pair in self.symmetry:
            _turn(struts[pair.source], struts[pair.target], pair.turn)
        if self.aim:
            for strut in struts.values():
                _aim(strut)
        return document

    def mechanism(self, values: FloatArray) -> Mechanism:
        """Return the mechanism with the free numbers at ``values``.

        MechanismError if there is no such mechanism.
        """
        return mechanism_from_document(self.documented(values), self.name)

    @property
    def start(self) -> FloatArray:
        """The free numbers as they are in the file."""
        found = []
        for one in self.free:
            path = one.paths[0]
            holder, key = _place(self.document, path.removeprefix('-'))
            found.append(float(holder[key]) * (-1.0 if path.startswith('-') else 1.0))
        return np.array(found)


def specification_from_file(path: Path) -> Specification:
    """Return the design that the file ``path`` asks for.

    MechanismError if it cannot be understood: one line with file, key and reason.
    """
    source = str(path)
    try:
        text = path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise MechanismError(source, '', f'cannot be read ({reason})') from None
    top = parsed(text, source)
    name = top.text('design')
    beside = path.parent / top.text('mechanism')
    file = beside if beside.is_file() else mechanism_path(top.text('mechanism'))
    mechanism_from_file(file)  # complains where it is wrong
    document = yaml.safe_load(file.read_text(encoding='utf-8'))
    free = tuple(_free(section, document) for section in top.sections('free'))
    symmetry = tuple(_symmetry(section, document) for section in top.sections('symmetry')) \
        if top.has('symmetry') else ()
    objectives = tuple(_objective(section) for section in top.sections('objectives'))
    for key, found in (('free', free), ('objectives', objectives)):
        if not found:
            raise top.error(key, 'is empty')
    limits = top.section('constraints') if top.has('constraints') else Section(source, '', {})
    specification = Specification(
        name, file, document, free, symmetry, top.flag('aim'), objectives,
        _grid(top) if top.has('over') else None,
        limits.number('distance', 0.0), limits.flag('strokes'),
        _count(top, 'population', 40), _count(top, 'generations', 100), _count(top, 'polish', 4),
        _count(top, 'seed', 1), _count(top, 'tradeoff', 0) if top.has('tradeoff') else 0,
    )
    if specification.tradeoff and len(objectives) != 2:
        raise top.error('tradeoff', f'is between two objectives, not {len(objectives)}')
    limits.close()
    top.close()
    if specification.grid is not None:
        specification.grid.required_of(mechanism_from_file(file))
    return specification


def _count(top: Section, key: str, default: int) -> int:
    number = top.number(key, default)
    if not isfinite(number) or number < 1 or number != int(number):
        raise top.error(key, f'is {number:g}, expected a whole number from 1 on')
    return int(number)


def _grid(top: Section) -> Grid:
    try:
        return Grid(tuple(axis_from_text(text) for text in top.names('over')))
    except FaultToleranceError as error:
        if isinstance(error, MechanismError):
            raise
        raise top.error('over', str(error)) from None


def _free(section: Section, document: dict[str, Any]) -> FreeNumber:
    several = isinstance(section.get('path'), list)
    paths = section.names('path') if several else (section.text('path'),)
    low, high = section.numbers('range', 2)
    section.close()
    if not (isfinite(low) and isfinite(high) and low < high):
        raise section.error('range', f'[{low:g}, {high:g}] is not an interval')
    for path in paths:
        try:
            holder, key = _place(document, path.removeprefix('-'))
            value = holder[key]
        except (KeyError, IndexError, TypeError):
            raise section.error('path', f'{path!r} is not in the mechanism file') from None
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise section.error('path', f'{path!r} is not a number')
    return FreeNumber(paths, low, high)


def _symmetry(section: Section, document: dict[str, Any]) -> Symmetry:
    names = [strut.get('name') for strut in document.get('struts', ())]
    source, target = section.text('from'), section.text('to')
    for key, name in (('from', source), ('to', target)):
        if name not in names:
            raise section.error(key, f'{name!r} is not a strut')
    turn = section.number('turn')
    section.close()
    return Symmetry(source, target, radians(turn))


def _objective(section: Section) -> Objective:
    measure = section.text('measure')
    if measure not in MEASURES:
        raise section.error('measure', f'{measure!r} is not one of {", ".join(MEASURES)}')
    count = _count(section, 'failures', 1)
    if count > 3:
        raise section.error('failures', f'is {count}, at most 3')
    scale = section.number('scale', 0.0)
    if scale < 0.0 or not isfinite(scale):
        raise section.error('scale', f'is {scale:g}, expected a positive number')
    section.close()
    return Objective(measure, count, scale)


def _place(document: Any, path: str) -> tuple[Any, Any]:
    """Return the list or mapping in ``document`` that holds what is at ``path``, and its key."""
    steps = list(_steps(path))
    for step in steps[:-1]:
        document = _inside(document, step)
    last = steps[-1]
    return document, last


def _steps(path: str) -> Iterator[str | int]:
    for part in path.split('.'):
        found = _STEP.fullmatch(part)
        if found is None:
            raise KeyError(path)
        if found[1]:
            yield found[1]
        for number in re.findall(r'\d+', found[2]):
            yield int(number)


def _inside(holder: Any, step: str | int) -> Any:
    """Return what is at ``step`` in ``holder``; in lists of mappings by name."""
    if isinstance(holder, list) and isinstance(step, str):
        return next((one for one in holder if one.get('name') == step), None)
    return holder[step]


def _turn(source: dict[str, Any], target: dict[str, Any], angle: float) -> None:
    """Give the joints of ``target`` the geometry of ``source``, turned about the z axis."""
    turned = np.array([[cos(angle), -sin(angle), 0], [sin(angle), cos(angle), 0], [0, 0, 1]])
    for one, other in zip(source['joints'], target['joints'], strict=True):
        for key in _VECTORS:
            if key in one:
                other[key] = [float(value) for value in turned @ one[key]]
        if 'axes' in one:
            other['axes'] = [[float(value) for value in turned @ axis] for axis in one['axes']]


def _aim(strut: dict[str, Any]) -> None:
    """Direct the sliding drive of ``strut`` from the joint below to the one above."""
    joints = strut['joints']
    for below, drive, above in zip(joints, joints[1:], joints[2:], strict=False):
        if drive['type'] == 'prismatic' and 'point' in below and 'point' in above:
            drive['axis'] = [b - a for a, b in zip(below['point'], above['point'], strict=True)]
