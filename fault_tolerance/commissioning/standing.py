# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What a machine at rest shows: names of joint states, strokes, and loops that close or not."""

from __future__ import annotations

from collections.abc import Collection
from difflib import SequenceMatcher

import numpy as np

from fault_tolerance.commissioning.findings import Finding, listed, quantity
from fault_tolerance.commissioning.unit_factors import plausible_units
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import Configuration, fitted_configuration
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import OVERSHOOT

MISFIT = 2e-4
"""Characteristic lengths by which readings may contradict each other at home."""

GEOMETRY = 5e-3
"""Share of the way from home that may be added: geometry is seldom better known."""

_NEAR_MISS = 0.5


def name_findings(mechanism: Mechanism, present: Collection[str]) -> list[Finding]:
    """Return which joints of ``mechanism`` a joint state with the names ``present`` lacks."""
    spare = sorted(set(present) - set(mechanism.joint_state_names))
    findings = []
    for actuator in mechanism.actuators:
        wanted = actuator.joint_state_name
        if wanted in present:
            continue
        alike = sorted(spare, key=lambda name: -_likeness(name, wanted))
        near = [name for name in alike if _likeness(name, wanted) >= _NEAR_MISS][:3]
        others = f'; there is {listed(near)}' if near else \
            f'; there are {listed(spare[:12])}' if spare else '; there are no others'
        text = f'`joint_state_name` of {actuator.name}: no joint state is called {wanted}{others}'
        findings.append(Finding('joint_state_name', (actuator.name,), text, given=wanted,
                                probable=near[0] if near else None))
    return findings


def _likeness(name: str, wanted: str) -> float:
    first, second = name.lower(), wanted.lower()
    if first.endswith(second) or second.endswith(first):
        return 1.0
    return SequenceMatcher(None, first, second).ratio()


def stroke_findings(mechanism: Mechanism, values: FloatArray) -> list[Finding]:
    """Return which joint ``values`` (N,) of ``mechanism`` at rest are outside their strokes."""
    findings = []
    for index, actuator in enumerate(mechanism.actuators):
        low, high = actuator.position
        margin = OVERSHOOT * (high - low)
        value = float(values[index])
        if not np.isfinite(margin) or low - margin <= value <= high + margin:
            continue
        turning = actuator.kind == 'revolute'
        reading = actuator.sign * value + actuator.home
        for unit, factor in plausible_units(turning):
            meant = actuator.sign * (reading / factor - actuator.home)
            # Home has to be more than nothing, or any large reading would be a small one.
            if abs(actuator.home) > high - low and low - margin <= meant <= high + margin:
                text = (
                    f'{actuator.name} reads {reading:.6g}: in {unit} that would be within its '
                    f'stroke, near `home` ({actuator.home:g})'
                )
                findings.append(Finding('unit', (actuator.name,), text, given=1.0,
                                        probable=factor))
                break
        else:
            text = (
                f'`home` of {actuator.name}: it reads {reading:.6g}, that is '
                f'{quantity(value, turning)} from home and outside its stroke; if the machine '
                f'is at home now, `home` is {reading:.6g}'
            )
            findings.append(Finding('home', (actuator.name,), text, given=actuator.home,
                                    probable=reading))
    return findings


def home_findings(mechanism: Mechanism, values: FloatArray, noise: FloatArray) -> list[Finding]:
    """Return which `home` may be wrong, as the loops do not close at the readings.

    Parameters
    ----------
    mechanism : Mechanism
    values : (N,) array
        Joint values read at rest.
    noise : (N,) array
        Their standard deviation.
    """
    if not mechanism.struts:
        return []
    scale = mechanism.rate_scale
    length = mechanism.characteristic_length
    allowed = MISFIT * length + 6.0 * float((noise * scale).max())
    far = float(np.abs(values * scale).max())
    found = fitted_configuration(mechanism, values)
    if _fits(found, allowed + GEOMETRY * far):
        return []
    suspects: dict[str, float] = {}
    for index, actuator in enumerate(mechanism.actuators):
        without = values.copy()
        without[index] = np.nan
        rest = fitted_configuration(mechanism, without)
        others = float(np.abs(np.delete(values * scale, index)).max(initial=0.0))
        meant = float(rest.actuator_values[index])
        shift = actuator.sign * (float(values[index]) - meant)
        if _fits(rest, allowed + GEOMETRY * others) and abs(shift) * scale[index] > allowed:
            # To the digits that count.
            digits = 2 - int(np.floor(np.log10(allowed / scale[index])))
            suspects[actuator.name] = round(actuator.home + shift, digits) + 0.0
    contradiction = quantity(found.largest_misfit, False)
    if not suspects:
        text = (
            f'the loops do not close at the readings, they contradict each other by '
            f'{contradiction}: more than one `home` is wrong, or the geometry'
        )
        return [Finding('home', mechanism.actuator_names, text)]
    chosen = tuple(suspects)
    each = [f'{name} ({home:.6g})' for name, home in suspects.items()]
    one = 'the `home` of ' if len(chosen) == 1 else 'one `home` (which one cannot be told): of '
    text = (
        f'the readings contradict each other by {contradiction}: the loops would close with '
        f'another value for {one}{listed(each, "or")}'
    )
    if any(mechanism.actuators[mechanism.actuator_index(name)].encoder == 'motor'
           for name in chosen):
        text = f'{text}; or the drives strain each other where they rest'
    given = {name: mechanism.actuators[mechanism.actuator_index(name)].home for name in chosen}
    return [Finding('home', chosen, text, given=given, probable=suspects)]


def _fits(found: Configuration, allowed: float) -> bool:
    return found.converged and found.largest_misfit <= allowed
