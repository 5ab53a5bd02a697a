# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether joint readings can be true: within the strokes, in agreement, and as commanded.

Nothing here detects failures: those are reported. It tells where readings and reports, or
readings and the mechanism file, contradict each other.
"""

from __future__ import annotations

from math import inf

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import (
    MOTION_WINDOW,
    NOTABLE_MOTION,
    OVERSHOOT,
    READING_GAP,
    RESTING_SHARE,
)


class Plausibility:
    """Watches the readings of the single actuators of ``mechanism``."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._names = mechanism.actuator_names
        limits = mechanism.position_limits
        stroke = limits[:, 1] - limits[:, 0]
        margin = OVERSHOOT * np.where(np.isfinite(stroke), stroke, 0.0)
        self._lowest, self._highest = limits[:, 0] - margin, limits[:, 1] + margin
        self._motions = MotionWatch(mechanism)
        self.out_of_range: tuple[str, ...] = ()
        """Actuators whose readings lie beyond their strokes."""
        self.inconsistent: tuple[str, ...] = ()
        """Actuators whose readings contradict reports and commands."""
        self.notices: tuple[Notice, ...] = ()
        """The same as warnings."""

    def observe(
        self, values: FloatArray, rates: FloatArray, failures: FailureSet, now: float
    ) -> None:
        """Take the joint ``values`` (N,) read at ``now`` (s), NaN in lost struts.

        ``rates`` (N,) were commanded until now, and ``failures`` are in force.
        """
        outside = _named(self._names, (values < self._lowest) | (values > self._highest))
        motions = self._motions
        motions.observe(values, rates, failures, now)
        moving, resting = motions.moving_though_stuck, motions.resting_though_told
        inconsistent = (*moving, *resting)
        if (outside, inconsistent) == (self.out_of_range, self.inconsistent):
            return
        self.out_of_range, self.inconsistent = outside, inconsistent
        texts = (
            ('out_of_range', outside, 'beyond the stroke in the mechanism file'),
            ('inconsistent', moving, 'reported stuck, but moving'),
            ('inconsistent', resting, 'told to move, but at rest'),
        )
        self.notices = tuple(
            Notice(reason, f'{", ".join(names)}: {text}', rejected=False)
            for reason, names, text in texts
            if names
        )


class MotionWatch:
    """Tells which actuators move though reported stuck, or rest though told to move.

    Over each window it compares how far an actuator has moved, and how far the commands would
    have taken it; both as the distance between the ends, so that noise does not add up.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._names, self._scale = mechanism.actuator_names, mechanism.rate_scale
        self._notable = NOTABLE_MOTION * mechanism.characteristic_length
        count = len(self._names)
        self._begun = self._last = -inf
        # Row 0: values read; row 1: motion commanded. Then the lowest and highest of both.
        self._seen, self._low, self._high = np.zeros((3, 2, count))
        self._resting: frozenset[str] = frozenset()
        self._failures = FailureSet()
        self.moving_though_stuck: tuple[str, ...] = ()
        self.resting_though_told: tuple[str, ...] = ()

    def observe(
        self, values: FloatArray, rates: FloatArray, failures: FailureSet, now: float
    ) -> None:
        """Take ``values``, ``rates``, ``failures`` and ``now`` as `Plausibility.observe` does."""
        if not 0.0 <= now - self._last <= READING_GAP or failures != self._failures:
            self._restart(values, failures, now)
            self._resting = frozenset()
            return
        seen = self._seen
        seen[0] = values
        seen[1] += (now - self._last) * rates
        self._last = now
        # A reading that is NaN stays out of the comparison.
        np.minimum(self._low, seen, out=self._low)
        np.maximum(self._high, seen, out=self._high)
        if now - self._begun >= MOTION_WINDOW:
            self._judge(failures)
            self._restart(values, failures, now)

    def _restart(self, values: FloatArray, failures: FailureSet, now: float) -> None:
        if failures != self._failures:
            self.moving_though_stuck = self.resting_though_told = ()
        self._failures = failures
        self._begun = self._last = now
        self._seen[0], self._seen[1] = values, 0.0
        self._low[:] = self._high[:] = self._seen

    def _judge(self, failures: FailureSet) -> None:
        moved, told = self._scale * (self._high - self._low)
        least = max(self._notable, RESTING_SHARE * float(np.fmax.reduce(moved, initial=0.0)))
        moving = _named(self._names, moved > least)
        self.moving_though_stuck = tuple(name for name in moving if name in failures.stuck)
        rests = (told > self._notable) & (moved < RESTING_SHARE * told)
        resting = frozenset(_named(self._names, rests)) - {*failures.stuck, *failures.free}
        # Drives lag: only one that rests for two windows in a row is told of.
        self.resting_though_told = tuple(
            name for name in self._names if name in resting & self._resting
        )
        self._resting = resting


def _named(names: tuple[str, ...], chosen: BoolArray) -> tuple[str, ...]:
    if not chosen.any():  # nearly always, and this runs at every step
        return ()
    return tuple(name for name, yes in zip(names, chosen, strict=True) if yes)
