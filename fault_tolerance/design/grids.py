# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Grids of poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, isfinite, pi

import numpy as np

from fault_tolerance.errors import FaultToleranceError, MechanismError
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import FARTHEST

MOST_POSES = 20_000_000


@dataclass(frozen=True)
class Axis:
    """``count`` places of a task coordinate from ``low`` to ``high``, radians or metres."""

    name: str
    low: float
    high: float
    count: int

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (isfinite(self.low) and isfinite(self.high) and self.low < self.high):
            raise FaultToleranceError(f'{self.name}: {self.low:g} to {self.high:g} is no range')
        if self.count < 2:
            raise FaultToleranceError(f'{self.name}: {self.count} places, at least 2')

    @property
    def unit(self) -> str:
        """Its unit, ``rad`` or ``m``."""
        return 'rad' if self.name.startswith('w') else 'm'

    @property
    def step(self) -> float:
        """The distance of two places."""
        return (self.high - self.low) / (self.count - 1)

    @cached_property
    def places(self) -> FloatArray:
        """All places, (count,)."""
        return frozen(np.linspace(self.low, self.high, self.count))


def axis_from_text(text: str) -> Axis:
    """Return the axis that ``text``, ``NAME=LOW:HIGH:COUNT``, describes.

    FaultToleranceError if it does not.
    """
    name, _, rest = text.partition('=')
    parts = rest.split(':')
    try:
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        raise FaultToleranceError(f'{text!r} is not NAME=LOW:HIGH:COUNT') from None
    if not name or len(parts) != 3:
        raise FaultToleranceError(f'{text!r} is not NAME=LOW:HIGH:COUNT')
    return Axis(name, low, high, count)


@dataclass(frozen=True)
class Grid:
    """Poses at every combination of the places of one to three ``axes``."""

    axes: tuple[Axis, ...]

    def __post_init__(self) -> None:
        """Check the axes."""
        if not 1 <= len(self.axes) <= 3:
            raise FaultToleranceError(f'a map is over 1 to 3 coordinates, not {len(self.axes)}')
        if len(set(self.names)) < len(self.axes):
            raise FaultToleranceError('a coordinate is named twice')
        count = int(np.prod([axis.count for axis in self.axes], dtype=float))
        if count > MOST_POSES:
            raise FaultToleranceError(f'{count} poses, at most {MOST_POSES}')

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates."""
        return tuple(axis.name for axis in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """How many places each axis has."""
        return tuple(axis.count for axis in self.axes)

    @property
    def unit(self) -> str:
        """The unit of its volume, as in ``rad^2 m``."""
        units = [axis.unit for axis in self.axes]
        counts = [(unit, units.count(unit)) for unit in dict.fromkeys(units)]
        return ' '.join(f'{unit}^{count}' if count > 1 else unit for unit, count in counts)

    @cached_property
    def poses(self) -> FloatArray:
        """Coordinates (B, k) of all poses, the last axis fastest."""
        return frozen(_product([axis.places for axis in self.axes]))

    @cached_property
    def centres(self) -> FloatArray:
        """Coordinates (c, k) of the middles of the cells between the places."""
        return frozen(_product([(axis.places[1:] + axis.places[:-1]) / 2 for axis in self.axes]))

    @cached_property
    def weights(self) -> FloatArray:
        """The volume that each pose stands for, over the grid: halves at its edges."""
        result = np.ones(())
        for axis in self.axes:
            weight = np.full(axis.count, axis.step)
            weight[[0, -1]] /= 2.0
            result = np.multiply.outer(result, weight)
        return frozen(result)

    def required_of(self, mechanism: Mechanism) -> Grid:
        """Return this grid if its coordinates are of the task of ``mechanism``.

        MechanismError if they are not, or too far away.
        """
        for axis in self.axes:
            if axis.name not in mechanism.task.coordinates:
                valid = ', '.join(mechanism.task.coordinates)
                reason = f'{axis.name!r} is not a task coordinate; valid: {valid}'
                raise MechanismError(mechanism.name, 'over', reason)
            if max(abs(axis.low), abs(axis.high)) > FARTHEST:
                reason = f'{axis.name} is farther than any joint goes ({FARTHEST:g})'
                raise MechanismError(mechanism.name, 'over', reason)
        turns = [max(abs(axis.low), abs(axis.high)) for axis in self.axes if axis.unit == 'rad']
        if float(np.linalg.norm(turns)) > pi:
            reason = 'a rotation vector is at most pi long, also in the corners of the map'
            raise MechanismError(mechanism.name, 'over', reason)
        return self


def grid_around(start: Mapping[str, float], goal: Mapping[str, float]) -> Grid:
    """Return a grid around the poses ``start`` and ``goal``, half their distance larger all round.

    Over the coordinates that either names. FaultToleranceError if they are the same.
    """
    names = list(dict.fromkeys([*start, *goal]))
    ends = {name: sorted((start.get(name, 0.0), goal.get(name, 0.0))) for name in names}
    count = {1: 201, 2: 41}.get(len(names), 21)
    axes = []
    for name, (low, high) in ends.items():
        kind = [one for one in names if one[:1] == name[:1]]
        room = max(ends[one][1] - ends[one][0] for one in kind) / 2.0
        if not room > 0.0:
            raise FaultToleranceError(f'{name} is the same at both ends: give --over')
        # Both ends are places of it.
        parts = max(1, round((count - 1) * (high - low) / (high - low + 2.0 * room)))
        step = (high - low) / parts if high > low else 2.0 * room / (count - 1)
        more = ceil(room / step - 1e-9)
        parts = parts if high > low else 0
        axes.append(Axis(name, low - more * step, high + more * step, parts + 2 * more + 1))
    return Grid(tuple(axes))


def _product(places: Sequence[FloatArray]) -> FloatArray:
    grids = np.meshgrid(*places, indexing='ij')
    return np.stack([grid.ravel() for grid in grids], axis=1)
