# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where the mirror is to point: step, circle, raster, Lissajous figures and routes.

A reference is a rotation vector of the platform, of which the two components about the base x
and y axes are given (radians); the third is zero. Each kind has its angle and the exact time
derivative of it, which a pointing loop feeds forward. Frequencies are in hertz.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from math import cos, isfinite, pi, sin
from typing import Protocol

import numpy as np

from fault_tolerance.errors import ArrayError
from fault_tolerance.mechanism.arrays import FloatArray


class Reference(Protocol):
    """What every reference offers; ``t`` is in seconds, of any sign."""

    def angle(self, t: float) -> FloatArray:
        """Return the rotation vector's x and y components (2,) at ``t``, radians."""
        ...

    def rate(self, t: float) -> FloatArray:
        """Return the time derivative (2,) of `angle` at ``t``, rad/s."""
        ...


@dataclass(frozen=True)
class Step:
    """At rest at zero, then at ``amplitude`` (about x and y, radians) from ``start`` (s) on.

    The rate is zero throughout: a jump has no feedforward.
    """

    amplitude: tuple[float, float] = (1e-3, 0.0)
    start: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        object.__setattr__(self, 'amplitude', _pair('amplitude', self.amplitude))
        _finite('start', self.start)

    def angle(self, t: float) -> FloatArray:
        """Return the angle (2,) at ``t``, radians."""
        return np.array(self.amplitude if t >= self.start else (0.0, 0.0))

    def rate(self, t: float) -> FloatArray:
        """Return zeros (2,) at every ``t``."""
        return np.zeros(2)


@dataclass(frozen=True)
class Circle:
    """``amplitude * (cos 2 pi f t, sin 2 pi f t)``; a negative frequency turns the other way."""

    amplitude: float = 1e-3
    frequency: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _finite('amplitude', self.amplitude)
        _finite('frequency', self.frequency)

    def angle(self, t: float) -> FloatArray:
        """Return the angle (2,) at ``t``, radians."""
        phase = 2.0 * pi * self.frequency * t
        return self.amplitude * np.array([cos(phase), sin(phase)])

    def rate(self, t: float) -> FloatArray:
        """Return the rate (2,) at ``t``, rad/s."""
        speed = 2.0 * pi * self.frequency
        phase = speed * t
        return self.amplitude * speed * np.array([-sin(phase), cos(phase)])


@dataclass(frozen=True)
class Raster:
    """Lines to and fro: a fast triangle wave about x, a slow one about y.

    Both start at zero and rise. At a turn the rate jumps; it is the one after the turn there.

    Attributes
    ----------
    amplitude : tuple of float
        Half the length of a line, and half the height of the field, radians.
    frequency : float
        Of the fast wave, hertz: two lines a period.
    lines : int
        Lines from the bottom of the field to its top; it is then scanned downwards.
    """

    amplitude: tuple[float, float] = (1e-3, 1e-3)
    frequency: float = 1.0
    lines: int = 8

    def __post_init__(self) -> None:
        """Check the numbers."""
        object.__setattr__(self, 'amplitude', _pair('amplitude', self.amplitude))
        _finite('frequency', self.frequency)
        if isinstance(self.lines, bool) or not isinstance(self.lines, int) or self.lines < 1:
            raise ArrayError('lines', f'{self.lines!r} is not a positive whole number')

    def angle(self, t: float) -> FloatArray:
        """Return the angle (2,) at ``t``, radians."""
        fast, slow = self.amplitude
        cycles = self.frequency * t
        return np.array([fast * _triangle(cycles), slow * _triangle(cycles / self.lines)])

    def rate(self, t: float) -> FloatArray:
        """Return the rate (2,) at ``t``, rad/s."""
        fast, slow = self.amplitude
        cycles = self.frequency * t
        slow_frequency = self.frequency / self.lines
        return np.array(
            [
                fast * self.frequency * _triangle_slope(cycles),
                slow * slow_frequency * _triangle_slope(cycles / self.lines),
            ]
        )


@dataclass(frozen=True)
class Lissajous:
    """``(a_x sin(2 pi f_x t + phase), a_y sin 2 pi f_y t)``, radians and hertz."""

    amplitude: tuple[float, float] = (1e-3, 1e-3)
    frequency: tuple[float, float] = (3.0, 2.0)
    phase: float = pi / 2.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        object.__setattr__(self, 'amplitude', _pair('amplitude', self.amplitude))
        object.__setattr__(self, 'frequency', _pair('frequency', self.frequency))
        _finite('phase', self.phase)

    def angle(self, t: float) -> FloatArray:
        """Return the angle (2,) at ``t``, radians."""
        (a_x, a_y), (f_x, f_y) = self.amplitude, self.frequency
        return np.array(
            [a_x * sin(2.0 * pi * f_x * t + self.phase), a_y * sin(2.0 * pi * f_y * t)]
        )

    def rate(self, t: float) -> FloatArray:
        """Return the rate (2,) at ``t``, rad/s."""
        (a_x, a_y), (f_x, f_y) = self.amplitude, self.frequency
        x_speed, y_speed = 2.0 * pi * f_x, 2.0 * pi * f_y
        return np.array(
            [a_x * x_speed * cos(x_speed * t + self.phase), a_y * y_speed * cos(y_speed * t)]
        )


@dataclass(frozen=True)
class Route:
    """Straight lines from angle to angle, at rest before the first and after the last.

    Attributes
    ----------
    times : tuple of float
        When each is reached, seconds, rising.
    angles : tuple of tuple of float
        About x and y, radians.
    """

    times: tuple[float, ...] = (0.0,)
    angles: tuple[tuple[float, float], ...] = ((0.0, 0.0),)

    def __post_init__(self) -> None:
        """Check the numbers."""
        times = tuple(_finite('times', one) for one in self.times)
        angles = tuple(_pair('angles', one) for one in self.angles)
        if not times or len(times) != len(angles):
            raise ArrayError('times', f'{len(times)} times for {len(angles)} angles')
        if any(then <= now for now, then in pairwise(times)):
            raise ArrayError('times', 'do not rise')
        object.__setattr__(self, 'times', times)
        object.__setattr__(self, 'angles', angles)

    def angle(self, t: float) -> FloatArray:
        """Return the angle (2,) at ``t``, radians."""
        return np.array([np.interp(t, self.times, one) for one in zip(*self.angles, strict=True)])

    def rate(self, t: float) -> FloatArray:
        """Return the rate (2,) at ``t``, rad/s; between two lines that of the next."""
        place = bisect_right(self.times, t)
        if not 0 < place < len(self.times):
            return np.zeros(2)
        lasts = self.times[place] - self.times[place - 1]
        return np.subtract(self.angles[place], self.angles[place - 1]) / lasts


_KINDS: dict[
    str, type[Step] | type[Circle] | type[Raster] | type[Lissajous] | type[Route]
] = {
    'step': Step,
    'circle': Circle,
    'raster': Raster,
    'lissajous': Lissajous,
    'route': Route,
}

REFERENCE_KINDS = tuple(_KINDS)
"""The words `reference` understands."""


def reference(
    kind: str, **parameters: float | Sequence[float] | Sequence[Sequence[float]]
) -> Reference:
    """Return the reference of the ``kind`` named, with ``parameters`` for its attributes.

    Raises `ArrayError` if the kind or a parameter is unknown, or a value is unusable.
    """
    if kind not in _KINDS:
        raise ArrayError('reference', f'{kind!r} is not one of {" ".join(REFERENCE_KINDS)}')
    known = [entry.name for entry in fields(_KINDS[kind])]
    for name in parameters:
        if name not in known:
            raise ArrayError(name, f'is no parameter of {kind}; it has {" ".join(known)}')
    built: Reference = _KINDS[kind](**parameters)  # type: ignore[arg-type]
    return built


def _triangle(cycles: float) -> float:
    """Return a triangle wave of period 1 between -1 and 1, zero and rising at 0."""
    return 1.0 - 4.0 * abs((cycles + 0.25) % 1.0 - 0.5)


def _triangle_slope(cycles: float) -> float:
    return 4.0 if (cycles + 0.25) % 1.0 < 0.5 else -4.0


def _finite(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise ArrayError(name, f'{value!r} is not a finite number')
    return float(value)


def _pair(name: str, values: Sequence[float]) -> tuple[float, float]:
    try:
        first, second = values
    except (TypeError, ValueError):
        raise ArrayError(name, f'{values!r} is not a pair of numbers') from None
    return _finite(name, first), _finite(name, second)
