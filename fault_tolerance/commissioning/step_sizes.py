# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How far and how fast the drives of a machine are moved at first, and in which ways."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

import numpy as np

from fault_tolerance.commissioning.couplings import Couplings
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.description import Mechanism

STROKE_SHARE = 0.01
"""A step is at most this share of the whole stroke."""

LENGTH_SHARE = 2e-3
"""And this share of the characteristic length, or as many radians: a linear machine so far."""

LARGEST_SHARE = 0.1
"""Of the stroke, for a step that somebody asks for."""

SPEED_SHARE = 0.1
"""Of the velocity limit: the speed at the middle of a step is at most this."""

PULSE = 0.8
"""Seconds a step takes, unless the velocity limit wants more."""

FORCE = 5.0
"""Newtons (moments at the characteristic length) by which drives of known stiffness may strain
each other: what a small mirror bears, and little for anything larger."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What is going to be moved.

    Attributes
    ----------
    mechanism : Mechanism
    couplings : Couplings
    steps : (N,) array
        Travel of the drives, radians or metres.
    singly : (N,) array or None
        Travel of a drive that is moved alone, radians or metres; None where that must not be.
    pulse : float
        Seconds out, and seconds back.
    """

    mechanism: Mechanism
    couplings: Couplings
    steps: FloatArray
    singly: FloatArray | None
    pulse: float

    def __repr__(self) -> str:
        alone = 'none' if self.singly is None else 'each drive'
        return f'Plan({self.mechanism.name!r}, alone: {alone})'

    @property
    def together(self) -> FloatArray:
        """Motions of all drives at once (N, m), radians or metres; none without redundancy."""
        motions = self.couplings.together / self.mechanism.rate_scale[:, None]
        if not self.couplings.redundancy:
            return motions[:, :0]
        moved = np.abs(motions) / self.steps[:, None]
        return np.asarray(motions / moved.max(axis=0, initial=1e-300))

    @property
    def speeds(self) -> FloatArray:
        """Largest speed of each drive (N,), radians or metres a second."""
        return 2.0 * self.steps / self.pulse


def planned(
    mechanism: Mechanism,
    found: Couplings,
    given: Mapping[str, float] | None = None,
    strain: float | None = None,
) -> Plan:
    """Return the first motions of a machine.

    Parameters
    ----------
    mechanism : Mechanism
    found : Couplings
        Of its drives where it stands.
    given : mapping of str to float, optional
        Steps by actuator, metres or radians, in place of the default ones; '' is all of them.
    strain : float, optional
        Metres (radians times the characteristic length) by which drives may strain each other.
        By default `FORCE` over the largest stiffness, and none where that is not known.

    Raises
    ------
    FaultToleranceError
        For a step or strain that is not positive or too large, or of no actuator.
    """
    steps = _steps(mechanism, dict(given or {}))
    singly: FloatArray | None = steps
    if strain is not None and not (isfinite(strain) and strain > 0.0):
        raise FaultToleranceError(f'--strain: {strain} is not a positive number of metres')
    if found.redundancy:
        if strain is None and found.known_stiffness:
            stiffness = [one.stiffness for one in mechanism.actuators]
            strain = float(FORCE / (np.array(stiffness) / mechanism.rate_scale**2).max())
        singly = None if strain is None else np.minimum(steps, strain / mechanism.rate_scale)
    limited = np.isfinite(mechanism.velocity_limits)
    slowest = 2.0 * steps[limited] / (SPEED_SHARE * mechanism.velocity_limits[limited])
    pulse = max(PULSE, float(slowest.max(initial=0.0)))
    return Plan(mechanism, found, steps, None if singly is None else frozen(singly), pulse)


def _steps(mechanism: Mechanism, given: dict[str, float]) -> FloatArray:
    strokes = mechanism.position_limits[:, 1] - mechanism.position_limits[:, 0]
    lengths = LENGTH_SHARE * mechanism.characteristic_length / mechanism.rate_scale
    steps = np.minimum(STROKE_SHARE * strokes, lengths)
    names = mechanism.actuator_names
    for name, value in given.items():
        if name and name not in names:
            raise FaultToleranceError(f'--step: {name!r} is not an actuator: {", ".join(names)}')
        if not (isfinite(value) and value > 0.0):
            raise FaultToleranceError(f'--step: {value} is not positive')
        chosen = np.array([name in ('', one) for one in names])
        longest = LARGEST_SHARE * float(strokes[chosen].min())
        if value > longest:
            what = name or names[int(np.flatnonzero(chosen)[strokes[chosen].argmin()])]
            reason = f'more than a tenth of the stroke of {what} ({longest:.3g})'
            raise FaultToleranceError(f'--step: {value:g} is {reason}')
    for name in sorted(given):  # '' first: what is said of one drive counts for it
        steps = np.where([name in ('', one) for one in names], given[name], steps)
    return frozen(steps)
