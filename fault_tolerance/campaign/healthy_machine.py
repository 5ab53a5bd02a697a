# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A healthy machine that is not quite what detection takes it for.

Linear, so that many cycles cost little, and with its own equations: where springs of *other*
stiffness settle, at *another* place, behind drives with *other* levers and lags, of which messages
get lost and stamps are imprecise. None of this is a failure.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import pi

import numpy as np

from fault_tolerance.detection.hypotheses import hypotheses
from fault_tolerance.detection.noise import KEPT, MARGIN, SMALLEST, WINDOW, roughness
from fault_tolerance.detection.responses import Responses, Sensors, responses
from fault_tolerance.detection.sighting import REACH, Channels
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import fitted_configuration
from fault_tolerance.mechanism.freedom import attachment_of
from fault_tolerance.mechanism.parts import EncoderSide

MOTIONS = ('rest', 'circle', 'raster', 'lissajous', 'steps')
"""What it may follow."""

READINGS = 10
"""Readings, at least, in a period of the fastest motion."""

POINTING = 0.2
"""Seconds with which a pointing loop takes out a step."""


@dataclass(frozen=True)
class Flaws:
    """By how much a healthy machine may differ from its model, each way.

    Attributes
    ----------
    lag, lever, stiffness : float
        Shares of the drives' time constants, of their travel, of their stiffness.
    place : float
        Radians, and characteristic lengths, from where the responses were derived.
    lost : float
        Share of the commands that never arrive, and of the readings.
    jitter : float
        Share of a period by which stamps and arrivals are off.
    load_steps : float
        Steps of the load a second.
    """

    lag: float = 0.2
    lever: float = 0.005
    stiffness: float = 0.2
    place: float = REACH
    lost: float = 0.01
    jitter: float = 0.1
    load_steps: float = 0.2


NO_FLAWS = Flaws(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Cycles:
    """What a detector would have made of k readings, but for the first ones.

    Attributes
    ----------
    found : Responses
    jumps : (h,) array
        See `Channels.jumps`.
    moved, readings : (k, N) and (k, c) arrays
        Metres.
    noises : (w, c) array
        Standard deviations learnt, metres; for `WINDOW` readings each.
    """

    found: Responses
    jumps: FloatArray
    moved: FloatArray
    readings: FloatArray
    noises: FloatArray


def healthy_cycles(
    name: str, count: int, rng: np.random.Generator, flaws: Flaws | None = None
) -> Cycles:
    """Return readings of a healthy machine at some task.

    Parameters
    ----------
    name : str
        Of a shipped mechanism or a file.
    count : int
        About how many readings; some get lost.
    rng : numpy.random.Generator
        Decides on the task, the flaws and the noise.
    flaws : Flaws, optional

    Returns
    -------
    Cycles
    """
    flaws = flaws or Flaws()
    side: EncoderSide = 'load' if rng.choice(['load', 'motor']) == 'load' else 'motor'
    model, jumps, directions = _model(name, side)
    period = float(rng.choice([0.002, 0.01, 0.05]))
    travel = _motion(rng, count + 1, period) @ directions.T
    rates = np.diff(travel, axis=0) / period
    # A lag of the first order is told as a delay: that is a flaw too.
    lag = float(rng.choice([0.0, 0.5, 1.0])) * period * (flaws.lag > 0.0)
    times = np.asarray(period * np.arange(count), dtype=np.float64)
    stamps = period * (np.arange(count) + flaws.jitter * rng.uniform(-1.0, 1.0, count))
    arrivals = period * (np.arange(count) + flaws.jitter * rng.uniform(0.0, 1.0, count))
    expected = _travelled(stamps + lag, rates, stamps)
    obeyed = _held(rates, rng.random(count) < flaws.lost)
    true_lag = lag * (1.0 + flaws.lag * rng.uniform(-1.0, 1.0))
    setpoints = _travelled(arrivals, obeyed, times)
    setpoints -= true_lag * _followed(obeyed, period, true_lag)
    setpoints *= 1.0 + flaws.lever * rng.uniform(-1.0, 1.0, rates.shape[1])
    readings = _sensed(name, side, setpoints, rng, flaws, period)
    kept = np.flatnonzero(rng.random(count) >= flaws.lost)
    kept = kept[: len(kept) // WINDOW * WINDOW]
    expected, readings = expected[kept], readings[kept]
    strange = readings - expected @ model.matrices[0].T
    least = SMALLEST * mechanism_named(name).characteristic_length
    noises = _learnt(strange, least) * (readings != readings[0]).any(axis=0)
    moved = np.diff(expected, axis=0, prepend=expected[:1])
    # The first window is there to learn from; what is learnt counts from the next one on.
    return Cycles(model, jumps, moved[WINDOW:], readings[WINDOW:], noises[:-1])


@cache
def _model(name: str, side: EncoderSide) -> tuple[Responses, FloatArray, FloatArray]:
    """Return what a detector takes the machine for, and its motions (N, 2) per radian."""
    mechanism = mechanism_named(name).with_encoders(side)
    rows = home_rows(mechanism)
    found = responses(
        rows, FailureSet(), hypotheses(mechanism, FailureSet()), Sensors(True, True)
    )
    present = reconfigured(rows, FailureSet()).present
    inverse = present.mapping @ np.linalg.pinv(present.jacobian)
    directions = (mechanism.rate_scale[:, None] * inverse)[:, :2]
    return found, Channels(mechanism).jumps(found), directions


def _motion(rng: np.random.Generator, count: int, period: float) -> FloatArray:
    """Return two angles (count, 2), radians, of one of the `MOTIONS`."""
    kind = str(rng.choice(MOTIONS))
    amplitude = 10.0 ** rng.uniform(-5.0, -2.5)
    # Drives that lag by a reading are half as fast as they are told where three make a period.
    frequency = min(10.0 ** rng.uniform(-2.0, 0.3), 1.0 / (3.0 * READINGS * period))
    time = period * np.arange(count)
    phase = 2.0 * pi * frequency * time
    if kind == 'rest':
        return np.zeros((count, 2))
    if kind == 'circle':
        shape = np.stack([np.cos(phase), np.sin(phase)], 1)
    elif kind == 'lissajous':
        shape = np.stack([np.sin(3.0 * phase + 1.0), np.sin(2.0 * phase)], 1)
    elif kind == 'raster':
        cycles = frequency * time[:, None] / np.array([1.0, 8.0])
        shape = np.asarray(1.0 - 4.0 * np.abs((cycles + 0.25) % 1.0 - 0.5))
    else:
        size = max(1, round(2.0 / period))
        jumps = np.repeat(rng.uniform(-1.0, 1.0, (count // size + 1, 2)), size, 0)[:count]
        shape = _smooth(jumps, period, POINTING)
    return np.asarray(amplitude * shape)


def _travelled(starts: FloatArray, rates: FloatArray, times: FloatArray) -> FloatArray:
    """Return the way (t, N) until each of the ``times``, of rates in force from ``starts`` on."""
    knots = np.cumsum(np.diff(starts, append=starts[-1:])[:, None] * rates, axis=0)
    way = np.vstack([np.zeros_like(rates[:1]), knots[:-1]])
    return np.stack([np.interp(times, starts, one) for one in way.T], 1)


def _held(rates: FloatArray, lost: BoolArray) -> FloatArray:
    """Return the rates in force where some commands are ``lost``: the last one that came."""
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(len(rates))))
    return np.asarray(rates[last])


def _followed(rates: FloatArray, period: float, lag: float) -> FloatArray:
    """Return how fast drives with a first-order ``lag`` are at every reading."""
    before = np.vstack([rates[:1], rates[:-1]])
    return _smooth(before, period, lag) if lag > 0.0 else before


def _smooth(values: FloatArray, period: float, constant: float) -> FloatArray:
    """Return ``values`` (t, n) behind a first-order lag."""
    from scipy.signal import lfilter

    decay = np.exp(-period / constant)
    start = decay * values[:1]
    found, _ = lfilter([1.0 - decay], [1.0, -decay], values, axis=0, zi=start)
    return np.asarray(found)


def _sensed(
    name: str,
    side: str,
    setpoints: FloatArray,
    rng: np.random.Generator,
    flaws: Flaws,
    period: float,
) -> FloatArray:
    """Return the channels (k, c) of all sensors, with their noise, metres."""
    count = setpoints.shape[1]
    stiffness = np.asarray(1.0 + flaws.stiffness * rng.uniform(-1.0, 1.0, count))
    rates, twists = _place(name, flaws.place * rng.uniform(-1.0, 1.0, 2))
    inverse = np.linalg.inv(rates.T @ (stiffness[:, None] * rates))
    settled = inverse @ rates.T * stiffness
    free = _loads(rng, len(setpoints), rates.shape[1], flaws.load_steps * period)
    inner = setpoints @ settled.T + free @ inverse.T
    joints, twist = inner @ rates.T, inner @ twists.T
    efforts = stiffness * (setpoints - joints)
    encoders = setpoints if side == 'motor' else joints
    channels = np.hstack([encoders, efforts, twist])
    # Some sensors have no noise at all, as those of a simulator, and some are not there.
    noise = [2e-9, rng.choice([0.0, 5e-9]), rng.choice([1e-9, 2e-8])]
    sizes = np.repeat(noise, [count, count, 6])
    channels += sizes * rng.standard_normal(channels.shape)
    there = np.repeat([1.0, float(rng.choice([0, 1])), float(rng.choice([0, 1]))],
                      [count, count, 6])
    return np.asarray(channels * there)


def _place(name: str, tilt: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the motions of joints and platform at a place away from home."""
    mechanism = mechanism_named(name)
    _, _, directions = _model(name, 'load')
    values = (directions @ tilt) / mechanism.rate_scale
    rows = strut_rows(fitted_configuration(mechanism, values))
    twists, rates = rows.motions(attachment_of(mechanism))
    basis, sigma, right = np.linalg.svd(rates, full_matrices=False)
    rank = int((sigma > 1e-9 * sigma[0]).sum())
    turned = right[:rank].T / sigma[:rank]
    return np.asarray(basis[:, :rank]), np.asarray(twists @ turned)


def _loads(rng: np.random.Generator, count: int, size: int, often: float) -> FloatArray:
    """Return what the load on the platform adds up to (count, size), in metres of give."""
    steps = np.flatnonzero(rng.random(count) < often)
    change = np.zeros((count, size))
    sizes = 10.0 ** rng.uniform(-9.0, -5.0, (len(steps), 1))
    change[steps] = sizes * rng.standard_normal((len(steps), size))
    return np.asarray(np.cumsum(change, axis=0))


def _learnt(strange: FloatArray, least: float) -> FloatArray:
    """Return the standard deviations (w, c) that a detector has learnt after each window."""
    found = roughness(strange.reshape(-1, WINDOW, strange.shape[1]))
    typical = [
        np.median(found[max(0, place + 1 - KEPT) : place + 1], axis=0)
        for place in range(len(found))
    ]
    return np.maximum(MARGIN * np.array(typical), least)
