# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Units that tables and data sheets are written in, and numbers that are in the wrong ones."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, pi

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator

_LENGTHS = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3, 'um': 1e-6}
_ANGLES = {'rad': 1.0, 'deg': pi / 180.0, 'mrad': 1e-3}

_LARGEST, _SMALLEST = 20.0, 2e-3
"""Metres, of a whole machine."""

_ESCAPE = '--any-size if this is right)'

_LONGEST_STROKE = 3.0
"""Of a drive that slides, in sizes of the machine."""

_LARGEST_TURN, _LARGEST_READING, _FASTEST = 1.01 * pi, 6.0 * pi, 60.0
"""Of a crank, either way: rad, rad, rad/s. Servo motors with a gear turn at 10 rad/s."""


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


def require_plausible(mechanism: Mechanism, units: Units, source: str) -> None:
    """Refuse a ``mechanism`` whose size, strokes or speeds no machine has.

    ``units`` are those its numbers were given in, ``source`` is what errors call where.
    MechanismError with the likely cause.
    """
    points = [joint.point for strut in mechanism.struts for joint in strut.joints]
    size = float(np.linalg.norm(np.ptp(np.array(points), axis=0)))
    if not _SMALLEST <= size <= _LARGEST:
        small = size < _SMALLEST
        likely = {'mm': 'm', 'um': 'mm', 'cm': 'm'} if small else {'m': 'mm', 'cm': 'mm'}
        other = likely.get(units.length)
        cause = ' ('
        if other:
            cause = f': are the numbers in {other}? (--units {other},{units.angle}; '
        reason = f'the machine would be {size:.3g} m {"small" if small else "large"}{cause}'
        raise MechanismError(source, '', f'{reason}{_ESCAPE}')
    for drive in mechanism.actuators:
        stroke = max((abs(end) for end in drive.position if isfinite(end)), default=0.0)
        if drive.kind == 'revolute':
            _require_plausible_turns(drive, stroke, units, source)
        elif stroke > _LONGEST_STROKE * size:
            reason = (f'a stroke of {stroke:.3g} m in a machine of {size:.3g} m: are all numbers '
                      f'in the same units? ({_ESCAPE}')
            raise MechanismError(source, drive.name, reason)


def _require_plausible_turns(drive: Actuator, stroke: float, units: Units, source: str) -> None:
    rate = drive.velocity if isfinite(drive.velocity) else 0.0
    for what, value, most, unit in (
        ('a stroke of', stroke, _LARGEST_TURN, 'rad'),
        ('home at', abs(drive.home), _LARGEST_READING, 'rad'),
        ('a rate of', rate, _FASTEST, 'rad/s'),
    ):
        if value > most:
            likely = f': are the numbers in degrees? (--units {units.length},deg; '
            cause = likely if units.angle == 'rad' else ' ('
            raise MechanismError(source, drive.name, f'{what} {value:.4g} {unit}{cause}{_ESCAPE}')
