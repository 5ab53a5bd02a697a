# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Units that tables and data sheets are written in, and numbers that are in the wrong ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, pi

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.arrays import FloatArray

_LENGTHS = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3, 'um': 1e-6}
_ANGLES = {'rad': 1.0, 'deg': pi / 180.0, 'mrad': 1e-3}

_LARGEST, _SMALLEST = 20.0, 2e-3
"""Metres, of a whole machine."""

_LARGEST_STROKE, _FASTEST = 4.0 * pi, 60.0
"""Of a crank: rad and rad/s; servo motors with a gear turn at 10 rad/s."""


@dataclass(frozen=True)
class Units:
    """The units of numbers: their names, and what converts them to metres and radians."""

    length: str = 'm'
    angle: str = 'rad'

    @property
    def metres(self) -> float:
        """How many metres one unit of length is."""
        return _LENGTHS[self.length]

    @property
    def radians(self) -> float:
        """How many radians one unit of angle is."""
        return _ANGLES[self.angle]

    def __str__(self) -> str:
        return f'{self.length},{self.angle}'


def units_named(text: str) -> Units:
    """Return the units that ``text``, such as mm,deg or only mm, names.

    ValueError if it does not.
    """
    words = [word.strip() for word in text.split(',')]
    lengths = [word for word in words if word in _LENGTHS]
    angles = [word for word in words if word in _ANGLES]
    if len(lengths) > 1 or len(angles) > 1 or len(lengths) + len(angles) != len(words):
        raise ValueError(f'{text!r} is not of the form mm,deg: one of {", ".join(_LENGTHS)}, '
                         f'and one of {", ".join(_ANGLES)}')
    return Units(*(lengths or ['m']), *(angles or ['rad']))


def require_plausible_size(points: FloatArray, units: Units, source: str) -> None:
    """Refuse ``points`` (k, 3), metres, that lie too far apart or together for a machine.

    ``units`` are those they were given in, ``source`` what errors call where. MechanismError
    with the likely cause.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if size > _LARGEST:
        wrong, likely = 'large', {'m': 'mm', 'cm': 'mm'}
    elif size < _SMALLEST:
        wrong, likely = 'small', {'mm': 'm', 'um': 'mm', 'cm': 'm'}
    else:
        return
    reason = f'the machine would be {size:.3g} m {wrong}'
    if units.length in likely:
        reason += f': are the numbers in {likely[units.length]}? (--units {likely[units.length]},'
        reason += f'{units.angle}; '
    else:
        reason += ' ('
    raise MechanismError(source, '', f'{reason}--any-size if this is right)')


def require_plausible_turns(
    numbers: Sequence[tuple[str, float]], rates: Sequence[tuple[str, float]], units: Units,
    source: str,
) -> None:
    """Refuse angles, radians, and rates, rad/s, that are too large for a drive that turns.

    ``numbers`` and ``rates`` come with where they stand in ``source``, and were given in
    ``units``. MechanismError with the likely cause.
    """
    for (where, value), most, unit in (
        *((one, _LARGEST_STROKE, 'rad') for one in numbers),
        *((one, _FASTEST, 'rad/s') for one in rates),
    ):
        if most < abs(value) < np.inf:
            turns = f'{abs(degrees(value)) / 360.0:.3g} turns'
            per = ' per second' if unit == 'rad/s' else ''
            reason = f'{value:g} {unit} are {turns}{per}'
            if units.angle == 'rad':
                reason += f': are the numbers in degrees? (--units {units.length},deg; '
            else:
                reason += ' ('
            raise MechanismError(source, where, f'{reason}--any-size if this is right)')
