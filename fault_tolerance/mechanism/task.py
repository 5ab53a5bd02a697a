# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The task: which components of the platform's twist matter, and which matter most."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import IntArray, frozen

COORDINATES = ('wx', 'wy', 'wz', 'vx', 'vy', 'vz')
"""Names of the components of a platform twist, in their order."""


@dataclass(frozen=True)
class Task:
    """What the platform is for."""

    coordinates: tuple[str, ...]
    """The l task coordinates, a selection of `COORDINATES`, in the user's order."""
    major: tuple[str, ...] = ()
    """Those that must be kept (major degrees of freedom); the others are secondary."""

    def __post_init__(self) -> None:
        """Check the names; by default every coordinate is major."""
        if not self.coordinates:
            raise MechanismError('task', 'coordinates', 'is empty')
        for key, names in (('coordinates', self.coordinates), ('major', self.major)):
            for name in names:
                if name not in COORDINATES:
                    known = ' '.join(COORDINATES)
                    raise MechanismError('task', key, f'{name!r} is not one of {known}')
            if len(set(names)) != len(names):
                raise MechanismError('task', key, 'names a coordinate twice')
        for name in self.major:
            if name not in self.coordinates:
                raise MechanismError('task', 'major', f'{name!r} is not a task coordinate')
        if not self.major:
            object.__setattr__(self, 'major', self.coordinates)

    @cached_property
    def rows(self) -> IntArray:
        """The rows (l,) of a platform twist that the task consists of."""
        places = [COORDINATES.index(name) for name in self.coordinates]
        return frozen(np.array(places, dtype=np.intp))

    @cached_property
    def major_rows(self) -> IntArray:
        """The m rows of a task velocity that are major, in the task's order."""
        return self._rows_where(major=True)

    @cached_property
    def secondary_rows(self) -> IntArray:
        """The l - m rows of a task velocity that are secondary, in the task's order."""
        return self._rows_where(major=False)

    @property
    def by_priority(self) -> tuple[str, ...]:
        """The task coordinates, major ones first."""
        return tuple(self.coordinates[i] for i in (*self.major_rows, *self.secondary_rows))

    def _rows_where(self, *, major: bool) -> IntArray:
        chosen = [i for i, name in enumerate(self.coordinates) if (name in self.major) is major]
        return frozen(np.array(chosen, dtype=np.intp))
