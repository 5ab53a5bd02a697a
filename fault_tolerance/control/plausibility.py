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
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import Configuration
from fault_tolerance.mechanism.description import Mechanism

OVERSHOOT = 1e-3
"""Beyond an end of its stroke by this share of it, a reading is outside the model's range."""

WINDOW = 1.0
"""Seconds over which motions are compared."""

GAP = 0.25
"""Seconds without a reading after which a comparison starts anew."""

NOTABLE = 1e-4
"""Characteristic lengths; shorter motions are not looked at."""

SHARE = 0.1
"""What moves by less than this share of what it should be compared with, rests."""

LEAVING = 0.8
"""How far below the limit a misfit must be before it counts as gone."""


class Plausibility:
    """What is watched of single actuators.

    Parameters
    ----------
    mechanism : Mechanism

    Attributes
    ----------
    out_of_range, inconsistent : tuple of str
        Actuators whose readings lie beyond their strokes, or contradict reports and commands.
    notices : tuple of Notice
        The same as warnings.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._strokes = StrokeWatch(mechanism)
        self._motions = MotionWatch(mechanism)
        self.out_of_range: tuple[str, ...] = ()
        self.inconsistent: tuple[str, ...] = ()
        self.notices: tuple[Notice, ...] = ()

    def observe(
        self, values: FloatArray, rates: FloatArray, failures: FailureSet, now: float
    ) -> None:
        """Take the joint values (N,) read now, NaN in lost struts, and the rates until now."""
        outside = self._strokes.outside(values)
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


class StrokeWatch:
    """Tells which readings lie beyond the strokes in the mechanism file.

    Parameters
    ----------
    mechanism : Mechanism
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._names = mechanism.actuator_names
        limits = mechanism.position_limits
        stroke = limits[:, 1] - limits[:, 0]
        margin = OVERSHOOT * np.where(np.isfinite(stroke), stroke, 0.0)
        self._lowest, self._highest = limits[:, 0] - margin, limits[:, 1] + margin

    def outside(self, values: FloatArray) -> tuple[str, ...]:
        """Return the actuators whose joint values (N,) are out of range; NaN is not."""
        beyond = (values < self._lowest) | (values > self._highest)
        if not beyond.any():
            return ()
        return tuple(name for name, out in zip(self._names, beyond, strict=True) if out)


class MisfitWatch:
    """Tells when redundant readings contradict each other too much to go by them.

    Parameters
    ----------
    limit : float
        Characteristic lengths.
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._exceeded = False

    def objection(self, configuration: Configuration) -> str:
        """Return why ``configuration`` is not to be trusted; empty if it is."""
        limit = self._limit * configuration.mechanism.characteristic_length
        misfit = configuration.largest_misfit
        # What hovers at the limit must not set the mechanism moving and halting all the time.
        self._exceeded = misfit > (LEAVING * limit if self._exceeded else limit)
        if not self._exceeded:
            return ''
        return f'joint readings contradict each other by {misfit:.2g} m (limit {limit:.2g} m)'


class MotionWatch:
    """Tells which actuators move though reported stuck, or rest though told to move.

    Over each window it compares how far an actuator has moved, and how far the commands would
    have taken it; both as the distance between the ends, so that noise does not add up.

    Parameters
    ----------
    mechanism : Mechanism
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._names = mechanism.actuator_names
        length = mechanism.characteristic_length
        kinds = [actuator.kind == 'revolute' for actuator in mechanism.actuators]
        self._scale = np.where(kinds, length, 1.0)
        self._notable = NOTABLE * length
        self._struts = tuple(actuator.strut for actuator in mechanism.actuators)
        self._begun = self._last = -inf
        self._told = np.zeros(len(kinds))
        # Lowest and highest of what was read, then of what was told.
        self._low, self._high = np.zeros((2, len(kinds))), np.zeros((2, len(kinds)))
        self._resting: frozenset[str] = frozenset()
        self._failures = FailureSet()
        self.moving_though_stuck: tuple[str, ...] = ()
        self.resting_though_told: tuple[str, ...] = ()

    def observe(
        self, values: FloatArray, rates: FloatArray, failures: FailureSet, now: float
    ) -> None:
        """Take the joint values (N,) read now, and the rates (N,) in force until now."""
        if not 0.0 <= now - self._last <= GAP or failures != self._failures:
            self._restart(values, failures, now)
            self._resting = frozenset()
            return
        self._told += (now - self._last) * rates
        self._last = now
        # Of what cannot be read, NaN, nothing is said.
        for row, seen in enumerate((values, self._told)):
            np.minimum(self._low[row], seen, out=self._low[row])
            np.maximum(self._high[row], seen, out=self._high[row])
        if now - self._begun >= WINDOW:
            self._judge(failures)
            self._restart(values, failures, now)

    def _restart(self, values: FloatArray, failures: FailureSet, now: float) -> None:
        if failures != self._failures:
            self.moving_though_stuck = self.resting_though_told = ()
        self._failures = failures
        self._begun = self._last = now
        self._told[:] = 0.0
        self._low[:] = self._high[:] = (values, self._told)

    def _judge(self, failures: FailureSet) -> None:
        moved, told = self._scale * (self._high - self._low)
        least = max(self._notable, SHARE * float(np.fmax.reduce(moved, initial=0.0)))
        moving = self._named(moved > least)
        self.moving_though_stuck = tuple(name for name in moving if name in failures.stuck)
        # Drives lag: only what rests for two windows in a row has had its chance.
        resting = frozenset(
            name
            for name in self._named((told > self._notable) & (moved < SHARE * told))
            if name not in failures.stuck and name not in failures.free
        )
        self.resting_though_told = tuple(
            name for name in self._names if name in resting & self._resting
        )
        self._resting = resting

    def _named(self, chosen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> tuple[str, ...]:
        return tuple(name for name, yes in zip(self._names, chosen, strict=True) if yes)
