# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What is allowed in a mechanism file and is probably a mistake, a line each, with its cause."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import combinations
from math import isfinite

import numpy as np
import yaml

from fault_tolerance.analysis.scene import joint_groups, joint_letter
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import posed_configuration
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Strut

FACTOR = 30.0
"""Lengths that differ by more are suspected of being in other units."""

_LARGEST = 30.0
# Sizes of a strut that a drive does not travel; strokes a second that it does not cross.
_LONG, _HASTE = 8.0, 500.0
# Degrees between a slider and its leg, and the share of a stroke that counts as its end.
_ALIGNED, _END = 3.0, 0.01
_SAME_PLACE = 1e-6
_UNITS = ((1e6, 'micrometres'), (1e3, 'millimetres'))
_SIXTIES = re.compile(r'[-+]?[1-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?')


def hints(mechanism: Mechanism) -> list[str]:
    """Return what looks like a mistake in ``mechanism``, a line each."""
    return [
        *_sizes(mechanism), *_same_places(mechanism), *_sliders(mechanism), *_strokes(mechanism),
        *_park(mechanism),
    ]


def text_hints(text: str) -> list[str]:
    """Return what looks like a mistake in the YAML ``text`` of a mechanism file, a line each."""
    return [
        f'line {token.start_mark.line + 1}: {token.value} is {yaml.safe_load(token.value):g}: '
        'YAML counts in sixties at a colon'
        for token in yaml.scan(text, Loader=yaml.SafeLoader)
        if isinstance(token, yaml.ScalarToken) and token.plain and _SIXTIES.fullmatch(token.value)
    ]


def _sizes(mechanism: Mechanism) -> Iterator[str]:
    """Compare lengths with each other and with the characteristic length."""
    length = mechanism.characteristic_length
    sizes = {strut.name: _size(strut, mechanism.origin) for strut in mechanism.struts}
    sizes = {name: size for name, size in sizes.items() if size > 0.0}
    if not sizes:
        return
    usual = float(np.median(list(sizes.values())))
    for name, size in sizes.items():
        if not usual / FACTOR <= size <= usual * FACTOR:
            cause = _cause(size, usual)
            yield f'{name} measures {size:.3g} m, the other struts {usual:.3g} m: {cause}'
    if usual > _LARGEST:
        yield f'struts of {usual:.3g} m: {_cause(usual, 0.5)} (everything is in metres)'
    elif not length / FACTOR <= usual <= length * FACTOR:
        yield (
            f'struts of {usual:.3g} m, and a characteristic_length of {length:.3g}: is it in '
            'other units, or left out (then it is 1)?'
        )
    for actuator in mechanism.actuators:
        stroke = actuator.position[1] - actuator.position[0]
        if actuator.kind == 'prismatic':
            for what, size in ('a stroke of', stroke), ('its home at', abs(actuator.home)):
                if isfinite(size) and size > _LONG * usual:
                    yield (
                        f'{actuator.name} has {what} {size:.3g} m, the struts measure '
                        f'{usual:.3g} m: {_cause(size, usual)}'
                    )
            if isfinite(actuator.velocity) and actuator.velocity > _HASTE * stroke:
                yield (
                    f'{actuator.name} crosses its stroke in '
                    f'{1e3 * stroke / actuator.velocity:.2g} ms: millimetres a second?'
                )
        if actuator.kind == 'revolute' and isfinite(stroke) and stroke > 8.0 * np.pi:
            yield f'{actuator.name} turns by {stroke:.3g} rad: degrees?'


def _park(mechanism: Mechanism) -> Iterator[str]:
    """Tell why the whole mechanism could not be parked."""
    try:
        values = posed_configuration(mechanism, mechanism.park).actuator_values
    except FaultToleranceError as error:
        yield f'park: {error}'
        return
    low, high = mechanism.position_limits.T
    beyond = np.flatnonzero((values < low) | (values > high))
    if beyond.size:
        names = ', '.join(mechanism.actuator_names[place] for place in beyond)
        yield f'park is beyond the stroke of {names}'


def _size(strut: Strut, origin: FloatArray) -> float:
    """Return the largest distance of a strut's axes from the platform's origin."""
    points = [joint.point for joint in strut.joints if joint.kind == 'revolute']
    return max((float(np.linalg.norm(point - origin)) for point in points), default=0.0)


def _cause(size: float, usual: float) -> str:
    """Return in which units ``size`` may be given, where ``usual`` would be expected."""
    ratio = max(size / usual, usual / size)
    unit = min(_UNITS, key=lambda one: abs(np.log(ratio / one[0])))[1]
    return f'{unit} among metres?' if size > usual else f'metres among {unit}?'


def _same_places(mechanism: Mechanism) -> Iterator[str]:
    balls = [
        (strut.name, name, joints[0].point)
        for strut in mechanism.struts for name, joints in joint_groups(strut)
        if joint_letter(joints) == 'S'
    ]
    for (strut, one, here), (other_strut, other, there) in combinations(balls, 2):
        near = np.linalg.norm(here - there) < _SAME_PLACE * mechanism.characteristic_length
        if near and strut != other_strut:
            yield f'{one} and {other} are at the same point: is one strut a copy of the other?'


def _sliders(mechanism: Mechanism) -> Iterator[str]:
    """Compare sliders with the way from the joint before them to the joint behind them."""
    for strut in mechanism.struts:
        groups = joint_groups(strut)
        for (_, before), (name, slider), (_, behind) in zip(
            groups, groups[1:], groups[2:], strict=False
        ):
            if slider[0].kind != 'prismatic' or 'prismatic' in (before[0].kind, behind[0].kind):
                continue
            way = behind[0].point - before[0].point
            distance = float(np.linalg.norm(way))
            if distance < _SAME_PLACE * mechanism.characteristic_length:
                continue
            share = abs(float(slider[0].axis @ way)) / distance
            angle = float(np.degrees(np.arccos(min(share, 1.0))))
            if angle > _ALIGNED:
                yield (
                    f'{name} is {angle:.0f} degrees off its leg, from the joint before it to the '
                    'one behind it: is its axis that of another leg?'
                )


def _strokes(mechanism: Mechanism) -> Iterator[str]:
    for actuator in mechanism.actuators:
        low, high = actuator.position
        stroke = high - low
        if not isfinite(stroke) or min(-low, high) > _END * stroke:
            continue
        text = f'{actuator.name} is at the end of its stroke [{low:g}, {high:g}] at home'
        if actuator.home and low <= actuator.home <= high:
            counted = f'[{low - actuator.home:g}, {high - actuator.home:g}]'
            yield f'{text}: if these are readings, from home ({actuator.home:g}) it is {counted}'
        else:
            yield f'{text}: limits count from home, not from the end'
