# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Rate and stroke limits, kept by slowing the whole command down.

Clipping one actuator alone would leave the range of the mapping matrix and make the struts pull
against each other. So the secondary part of the motion gives way first, by one factor, and then
everything by another one: what is left is slower, but still a motion of the mechanism, and the
major task keeps its direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import isfinite

import numpy as np

from fault_tolerance.compiled.activation import Active
from fault_tolerance.control.resolved_rate import ResolvedRate
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

LARGEST_RATE = 1e6
"""The limit of actuators that have none, so that no command overflows."""

NEGLIGIBLE = 1e-12
"""Rates below this fraction of the largest are rounding; they push nothing over a limit."""

_BOTH_WAYS = np.array([[1.0], [-1.0]])


@dataclass(frozen=True, eq=False)
class RateBounds:
    """Bounds ``lower <= rates <= upper``; standing still is always allowed.

    Attributes
    ----------
    lower, upper : (N,) array
        Not positive, and not negative.
    """

    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True, eq=False)
class LimitedRate:
    """A command within bounds.

    Attributes
    ----------
    command : ResolvedRate
        What is left of the command.
    scale : float
        The factor on everything.
    secondary_scale : float
        The factor the secondary part had to take first.
    saturation : tuple of str
        The actuators that would have crossed a bound.
    """

    command: ResolvedRate
    scale: float
    secondary_scale: float
    saturation: tuple[str, ...]


def kept_within_limits(
    resolved: ResolvedRate,
    mechanism: Mechanism,
    values: FloatArray,
    stroke_gain: float,
    scale: float = 1.0,
) -> LimitedRate:
    """Return the command slowed down until it keeps all limits at the joint values (N,).

    `limited_rate` within `rate_bounds`; nearly always there is nothing to slow down.
    """
    kernels = Active.kernels
    if scale == 1.0 and kernels is not None:
        speed, ends = constant_limits(mechanism)
        if kernels.within(resolved.rates, values, speed, ends, stroke_gain):
            return LimitedRate(resolved, scale, 1.0, ())
    bounds = rate_bounds(mechanism, values, stroke_gain)
    return limited_rate(resolved, bounds, mechanism.actuator_names, scale)


def rate_bounds(mechanism: Mechanism, values: FloatArray, stroke_gain: float) -> RateBounds:
    """Return the bounds on the actuator rates at the joint values (N,).

    Rate limits hold everywhere. Towards an end of the stroke an actuator may go no faster than
    `stroke_gain` (1/s) times the way that is left, so it arrives without a jolt (a velocity
    damper, as in Faverjon and Tournassoud, ICRA 1987); beyond an end it may only come back.
    Where a value is NaN there is no stroke to respect.
    """
    speed, ends = constant_limits(mechanism)
    # The way to both ends, (2, N).
    ways = np.maximum(stroke_gain * (ends + _BOTH_WAYS * values), 0.0)
    if isfinite(float(values.sum())):
        np.minimum(ways, speed, out=ways)
        return RateBounds(-ways[0], ways[1])
    down, up = np.fmax(ways, 0.0)
    known = np.isfinite(values)
    return RateBounds(
        -np.where(known, np.minimum(speed, down), speed),
        np.where(known, np.minimum(speed, up), speed),
    )


@lru_cache(maxsize=64)
def constant_limits(mechanism: Mechanism) -> tuple[FloatArray, FloatArray]:
    """Return the largest speeds (N,), and the ends of the strokes (2, N) as seen from home."""
    low, high = mechanism.position_limits.T
    return np.minimum(mechanism.velocity_limits, LARGEST_RATE), np.stack([-low, high])


def limited_rate(
    resolved: ResolvedRate,
    bounds: RateBounds,
    names: Sequence[str],
    scale: float = 1.0,
) -> LimitedRate:
    """Return the command slowed down until it keeps the bounds.

    Parameters
    ----------
    resolved : ResolvedRate
    bounds : RateBounds
    names : sequence of str
        Names of the N actuators.
    scale : float
        A factor on everything to begin with.
    """
    if scale == 1.0:
        rates = resolved.rates
        if np.logical_and.reduce((rates >= bounds.lower) & (rates <= bounds.upper)):
            return LimitedRate(resolved, scale, 1.0, ())
    rate_map = resolved.kinematics.rate_map
    major = _without_rounding(scale * (rate_map @ resolved.major))
    secondary = _without_rounding(scale * (rate_map @ resolved.secondary))
    wanted = _without_rounding(major + secondary)
    crossing = (wanted < bounds.lower) | (wanted > bounds.upper)
    if not crossing.any():
        command = resolved if scale == 1.0 else resolved.scaled(scale)
        return LimitedRate(command, scale, 1.0, ())
    saturation = tuple(name for name, over in zip(names, crossing, strict=True) if over)
    share, factor = _largest_share(major, secondary, bounds), 1.0
    if share is None:
        share, factor = 0.0, _largest_factor(major, bounds)
    command = resolved.scaled(scale * factor, share)
    return LimitedRate(command, scale * factor, share, saturation)


def singularity_scale(margin: float, hold_below: float, slow_below: float) -> float:
    """Return the factor by which everything slows down near a singularity.

    1 from the margin ``slow_below`` on, falling to 0 at ``hold_below`` (docs/theory.md, eq. 23).
    """
    return min(max((margin - hold_below) / (slow_below - hold_below), 0.0), 1.0)


def _without_rounding(rates: FloatArray) -> FloatArray:
    """Return the rates with zero for what is only rounding beside the largest."""
    size = np.abs(rates)
    return np.where(size > NEGLIGIBLE * size.max(initial=0.0), rates, 0.0)


def _largest_share(major: FloatArray, secondary: FloatArray, bounds: RateBounds) -> float | None:
    """Return the largest s in [0, 1] with ``major + s * secondary`` in bounds, if there is one."""
    moving = secondary != 0.0
    rate = secondary[moving]
    first = (bounds.lower[moving] - major[moving]) / rate
    second = (bounds.upper[moving] - major[moving]) / rate
    share = min(max(float(np.min(np.maximum(first, second), initial=1.0)), 0.0), 1.0)
    rates = major + share * secondary
    excess = np.max(np.maximum(bounds.lower - rates, rates - bounds.upper), initial=0.0)
    return share if excess <= NEGLIGIBLE * np.max(np.abs(rates), initial=0.0) else None


def _largest_factor(rates: FloatArray, bounds: RateBounds) -> float:
    """Return the largest factor in [0, 1] that brings the rates into bounds."""
    bound = np.where(rates < 0.0, bounds.lower, bounds.upper)
    crossing = np.abs(rates) > np.abs(bound)
    return float(np.min(bound[crossing] / rates[crossing], initial=1.0))
