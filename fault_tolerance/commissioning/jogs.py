# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""One small motion out and back, watched sample by sample.

Written as generators that take a `Sample` and give the joint rates that answer it, so that what
happens one after the other stands one after the other. They know no clock.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field
from math import cos, pi
from typing import NamedTuple

import numpy as np

from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray

REST = 0.5
"""Seconds after a motion before readings may count as at rest; delays have to be shorter."""

STILL = 0.2
"""Seconds over which readings must not change to be at rest."""

LONGEST_REST = 3.0
"""Seconds; what is not at rest by then does not obey."""

BEYOND = 2.0
"""A motion ends at once where a reading goes so many times as far as it should."""

_NOISE_BAND = 8.0
"""Standard deviations; noise stays within."""


class Sample(NamedTuple):
    """One reading of all joints."""

    time: float
    """Seconds."""
    values: FloatArray
    """(N,): joint values from home, radians or metres."""


Steps = Generator[FloatArray, Sample, None]


class Surprise(FaultToleranceError):
    """Something happened that no mistake in the file explains: nothing may be moved any more."""


@dataclass(eq=False)
class Jog:
    """One motion and what was read meanwhile.

    Attributes
    ----------
    direction : (N,) array
        Travel commanded at share 1, radians or metres.
    limits : (N,) array
        How far readings may go.
    share : float
        How much of it was commanded.
    out, back : (N,) array
        Travel read, radians or metres.
    stopped : bool
        Whether it ended early, as a reading went beyond its limit.
    times, shares : list of float
        When readings came, and what share of the motion had been commanded before each.
    values : list of (N,) array
        The readings.
    """

    direction: FloatArray
    limits: FloatArray
    share: float = 0.0
    out: FloatArray = field(default_factory=lambda: np.zeros(0))
    back: FloatArray = field(default_factory=lambda: np.zeros(0))
    stopped: bool = False
    times: list[float] = field(default_factory=list)
    shares: list[float] = field(default_factory=list)
    values: list[FloatArray] = field(default_factory=list)

    def __repr__(self) -> str:
        return f'Jog({self.share:.3g}, {len(self.times)} readings)'

    @property
    def response(self) -> FloatArray:
        """Travel read per share commanded (N,), radians or metres: mean of out and back."""
        share = self.share if self.share > 0.0 else np.inf
        return np.asarray(0.5 * (self.out - self.back) / share)


class Jogger:
    """Moves drives called ``names`` a little and reads how far they come.

    ``noise`` (N,) is the standard deviation of the readings, radians or metres.
    """

    def __init__(self, names: tuple[str, ...], noise: FloatArray) -> None:
        self.names, self.noise = names, noise
        self._zeros = np.zeros(len(names))
        self._rested: FloatArray | None = None
        self._share = 0.0

    @property
    def rested(self) -> FloatArray:
        """Where the joints have last been at rest (N,)."""
        return self._zeros if self._rested is None else self._rested

    def uncertainty(self, count: float = 10.0) -> FloatArray:
        """Return the standard deviation (N,) of a travel between means of ``count`` readings."""
        return np.asarray(self.noise * np.sqrt(2.0 / count))

    def watch(self, steps: FloatArray) -> Steps:
        """Yield zeros for a while; `Surprise` if anything moves by more than noise.

        ``steps`` (N,) are the motions to come.
        """
        yield from self._rest(steps)

    def jog(self, jog: Jog, share: float, pulse: float) -> Steps:
        """Move a ``share`` of ``jog`` out and back in ``pulse`` seconds each; fill it in.

        Yields the rates (N,) to command. Raises `Surprise` if the joints do not come to rest, or
        go on outwards on the way back.
        """
        self._share = 0.0
        amplitude = np.abs(jog.direction) * share
        yield from self._rest(jog.limits)
        origin = self.rested
        jog.stopped = yield from self._pulse(jog, share, pulse, origin, jog.limits)
        jog.share = self._share
        yield from self._rest(jog.limits, jog, after_motion=True)
        there = self.rested
        jog.out = there - origin
        bounds = np.maximum(jog.limits, 1.2 * np.abs(jog.out))
        if (yield from self._pulse(jog, -self._share, pulse, origin, bounds)):
            raise Surprise('on the way back the readings went farther away')
        yield from self._rest(np.maximum(amplitude, self.noise), jog, after_motion=True)
        jog.back = self.rested - there

    def _pulse(
        self, jog: Jog, share: float, pulse: float, origin: FloatArray, bounds: FloatArray
    ) -> Generator[FloatArray, Sample, bool]:
        """Command a ``share`` with a speed that rises and falls as a cosine.

        It ends early, and returns True, where readings are farther than ``bounds`` (N,) from
        ``origin`` (N,).
        """
        sample = yield self._zeros
        begin = before = sample.time
        target, speed = self._share + share, 0.0
        while True:
            # What was commanded last has been in force until now.
            self._share += speed * (sample.time - before)
            before = sample.time
            self._record(jog, sample)
            if (np.abs(sample.values - origin) > bounds + _NOISE_BAND * self.noise).any():
                return True
            elapsed = sample.time - begin
            if elapsed >= pulse or (self._share - target) * share > 0.0:
                return False
            speed = share / pulse * (1.0 - cos(2.0 * pi * min(elapsed / pulse, 1.0)))
            sample = yield speed * jog.direction

    def _rest(
        self, tolerance: FloatArray, jog: Jog | None = None, after_motion: bool = False
    ) -> Steps:
        """Yield zeros until the joints are at rest, and remember where.

        Where nothing has been commanded before, they have to be so from the beginning:
        ``tolerance`` (N,) says how far they may move, besides noise.
        """
        sample = yield self._zeros
        begin = sample.time
        window: list[Sample] = []
        least = REST if after_motion else STILL
        while True:
            if jog is not None:
                self._record(jog, sample)
            window.append(sample)
            while window[-1].time - window[0].time > STILL and len(window) > 2:
                window.pop(0)
            rested = np.mean([one.values for one in window], axis=0)
            if sample.time - begin >= least:
                moving = self._moving(window, tolerance)
                if not moving.any():
                    break
                if not after_motion or sample.time - begin > LONGEST_REST:
                    self._complain(moving, after_motion)
            sample = yield self._zeros
        if self._rested is not None and not after_motion:
            crept = np.abs(rested - self._rested) > 0.2 * tolerance + _NOISE_BAND * self.noise
            if crept.any():
                self._complain(crept, after_motion)
        self._rested = rested

    def _moving(self, window: list[Sample], tolerance: FloatArray) -> BoolArray:
        """Return which joints (N,) the last readings show in motion."""
        half = len(window) // 2
        first, last = (np.mean([one.values for one in part], axis=0)
                       for part in (window[:half], window[half:]))
        band = 0.02 * tolerance + _NOISE_BAND * self.noise / max(half, 1) ** 0.5
        return np.asarray(np.abs(last - first) > band)

    def _complain(self, moving: BoolArray, after_motion: bool) -> None:
        names = [name for name, one in zip(self.names, moving, strict=True) if one]
        verb = 'moves' if len(names) == 1 else 'move'
        text = f'{", ".join(names)} {verb} while nothing is commanded'
        if after_motion:
            text = f'{text}: not at rest {LONGEST_REST:g} s after the last motion'
        raise Surprise(text)

    def _record(self, jog: Jog, sample: Sample) -> None:
        jog.times.append(sample.time)
        jog.shares.append(self._share)
        jog.values.append(sample.values)
