# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Ratios of travel read to travel commanded, recognised as mistaken units and gears."""

from __future__ import annotations

from math import log, pi

_LENGTHS = {
    1e2: 'centimetres', 1e3: 'millimetres', 1e6: 'micrometres', 1e9: 'nanometres',
    1 / 0.0254: 'inches',
}
_ANGLES = {
    180 / pi: 'degrees', 60 * 180 / pi: 'minutes of arc', 3600 * 180 / pi: 'seconds of arc',
    1e3: 'milliradians', 1e6: 'microradians', 1 / (2 * pi): 'turns',
}
_LARGEST_GEAR = 500
_FINE = 0.05
_COUNTS = tuple(2**power for power in range(8, 33)) + tuple(
    base * 10**power for base in (1, 2, 4, 5) for power in range(3, 7)
)
"""Counts a turn that encoders have: binary ones, and lines times four."""


def unit_in_words(ratio: float, turning: bool, tolerance: float = 0.03) -> str:
    """Return what mistake makes a reading move ``ratio`` times as far as it was told.

    Parameters
    ----------
    ratio : float
        Travel read over travel commanded, positive.
    turning : bool
        Whether the drive turns (radians) or slides (metres).
    tolerance : float
        Share by which the ratio may be off.

    Returns
    -------
    str
        Such as ``the reading is in millimetres``; empty where no such mistake is known.
    """
    named = _ANGLES if turning else _LENGTHS
    base = 'radians' if turning else 'metres'
    known = {
        factor: f'the reading is in {unit} where {base} are wanted'
        for factor, unit in named.items()
    } | {
        1.0 / factor: f'the drive takes {unit} a second where it is told {base} a second'
        for factor, unit in named.items()
    }
    nearest = min(known, key=lambda factor: abs(log(ratio / factor)))
    if _near(ratio, nearest, tolerance):
        return known[nearest]
    if not turning and _near(ratio, 2 * pi, tolerance):
        return 'a factor of 2 pi: a screw whose turns are taken for radians'
    if turning:
        for counts in _COUNTS:
            if _near(ratio, counts / (2 * pi), min(tolerance, 0.01)):
                return f'the reading is in counts, {counts} a turn'
    return _gear_in_words(ratio, tolerance)


def _gear_in_words(ratio: float, tolerance: float) -> str:
    """Return the whole gear ratio that a ratio is near to."""
    size = max(ratio, 1.0 / ratio)
    whole = round(size)
    if tolerance > _FINE or not 2 <= whole <= _LARGEST_GEAR:
        return ''
    # Between large whole numbers anything would be near to one.
    if not _near(size, whole, min(tolerance, 0.2 / whole)):
        return ''
    return f'a gear of {whole}:1 between what is commanded and what is read'


def _near(value: float, wanted: float, tolerance: float) -> bool:
    return abs(log(value / wanted)) <= tolerance


def plausible_units(turning: bool) -> list[tuple[str, float]]:
    """Return units that readings are taken in by mistake, and how many make a metre or a radian.

    ``turning`` says whether it is a radian.
    """
    return [(unit, factor) for factor, unit in (_ANGLES if turning else _LENGTHS).items()]
