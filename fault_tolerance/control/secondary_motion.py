# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Secondary motion towards better tolerance of the next failure: gradient ascent of the measures.

While nothing has failed, the secondary coordinates of the task may go where the worst p, t or h of
the next failure is larger, instead of where they are requested (`Settings.secondary`). The major
task is not affected: the control law serves it first. The gradient comes from measures at
neighbouring configurations, one coordinate at a time and after the command.
"""

from __future__ import annotations

from math import exp, inf

import numpy as np

from fault_tolerance.control.estimate import Estimate, estimate
from fault_tolerance.control.step_output import Output
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

NEIGHBOUR = 1e-3
"""Radians, and characteristic lengths, to the neighbours that are measured."""

SHARPNESS = 30.0
"""Of the smooth minimum of measures: those that are less than about 1/30 apart count together.

The worst measure itself has ridges, on which its slope would change to and fro.
"""

FLAT = 0.5
"""Slope, measure per radian or characteristic length, below which it climbs slower."""

MEASURING_PERIOD = 0.01
"""Seconds between two pairs of neighbours."""

SMOOTHING = 0.2
"""Time constant of the climb, seconds."""

FADE = 0.5
"""Seconds in which climbing replaces following, and the reverse."""

GAP = 0.2
"""Seconds without a command after which climbing begins anew."""

STROKE_MARGIN = 0.1
"""Share of a stroke before its end in which the climb slows down, to 0 at the end."""

_FATAL = 1e-6
"""Measures; a next failure with less stops the mechanism wherever it is, and is left out."""

_POOR = 1e-3
"""Singular values, relative to the largest; directions with less are not used for climbing."""


class SecondaryMotion:
    """Decides on the secondary part of the task velocity of one ``mechanism``.

    ``climbs`` says whether it is to climb.
    """

    def __init__(self, mechanism: Mechanism, climbs: bool) -> None:
        self._mechanism, task = mechanism, mechanism.task
        self._places = task.secondary_rows
        turning = task.rows[self._places] < 3
        length = mechanism.characteristic_length
        self._units = np.where(turning, 1.0, length)  # of the task, per characteristic length
        low, high = mechanism.position_limits.T
        self._low, self._high = low, high
        self._margin = np.where(np.isfinite(high - low), STROKE_MARGIN * (high - low), 1.0)
        self._slopes = np.zeros(len(self._places))
        self._rates = np.zeros((len(mechanism.actuators), len(self._places)))
        self._turn, self._measured_at, self._time = 0, -inf, -inf
        self._climb, self._share = np.zeros_like(self._slopes), 0.0
        self._climbs = False
        self.active = False
        """Whether it still changes the velocity (climbing or fading out)."""
        self.switch(climbs)

    def switch(self, climbs: bool) -> None:
        """Climb from now on, or follow, as ``climbs`` says; one fades into the other."""
        self._climbs = climbs and len(self._places) > 0
        self.active = self.active or self._climbs

    def velocity(self, requested: FloatArray, present: Estimate, now: float) -> FloatArray:
        """Return the task velocity (l,) to command in place of the one ``requested`` (l,).

        The major part is as requested. ``present`` is the estimate ``now`` (s).
        """
        elapsed, self._time = now - self._time, now
        self.active = self._climbs or self._share > 0.0
        if present.failures.parts or not self.active:
            self._share = 0.0  # the law eases what changes at a failure
            return requested
        if not 0.0 <= elapsed <= GAP:
            elapsed, self._share = 0.0, 0.0
        if not self._share:
            self._climb[:] = 0.0
        steep = max(float(np.linalg.norm(self._slopes)), FLAT)
        uphill = present.model.settings.secondary_speed / steep * self._slopes
        kept = exp(-elapsed / SMOOTHING)
        self._climb = kept * self._climb + (1.0 - kept) * uphill
        step = elapsed / FADE if self._climbs else -elapsed / FADE
        self._share = min(max(self._share + step, 0.0), 1.0)
        wanted = self._room(present) * self._climb * self._units
        result = requested.copy()
        result[self._places] += self._share * (wanted - requested[self._places])
        return result

    def consider(self, output: Output, now: float) -> None:
        """Measure two neighbours of the estimate of an ``output``, if it is time, ``now`` (s).

        To be called after the command.
        """
        present, off = output.estimate, bool(output.no_request_reason) or not self._climbs
        if off or output.failures.parts or not present.located:
            self._slopes[:] = 0.0
            return
        if 0.0 <= now - self._measured_at < MEASURING_PERIOD:
            return
        self._measured_at = now
        self._turn = (self._turn + 1) % len(self._places)
        self._slopes[self._turn], self._rates[:, self._turn] = self._slope(present, self._turn)

    def _room(self, present: Estimate) -> float:
        """Return the share of the climb that is left near the ends of strokes."""
        rates, at = self._rates @ self._climb, present.actuator_values
        room = np.where(rates > 0.0, self._high - at, at - self._low) / self._margin
        return float(np.clip(np.where(rates == 0.0, 1.0, room), 0.0, 1.0).min())

    def _slope(self, present: Estimate, place: int) -> tuple[float, FloatArray]:
        """Return how the worst measure changes with a secondary coordinate, and how the drives do.

        Per radian or characteristic length of the one number ``place``, as far as the major task
        leaves it free; drives (N,) in their units.
        """
        task, parts = self._mechanism.task, present.arrays
        jacobian = parts.jacobian[task.rows]
        _, sigma, right = np.linalg.svd(jacobian[task.major_rows])
        rank = int((sigma > _POOR * sigma.max(initial=0.0)).sum())
        free = right[rank:].T
        turned = np.linalg.pinv(jacobian[task.secondary_rows] @ free, rcond=_POOR)
        length = self._mechanism.characteristic_length
        reduced = free @ turned[:, place] * length
        rates = (parts.follow @ reduced) / present.model.packed.view.actuators.scale
        at, model, failures = present.actuator_values, present.model, present.failures
        neighbours = [
            estimate(model, present, at + step * rates, failures)
            for step in (NEIGHBOUR, -NEIGHBOUR)
        ]
        if not all(one.located and not one.hold_reason for one in neighbours):
            return 0.0, rates
        up, down = (one.measures()[3:] for one in neighbours)
        counted = (up > _FATAL) & (down > _FATAL)
        if not counted.any():
            return 0.0, rates
        return (_smallest(up[counted]) - _smallest(down[counted])) / (2.0 * NEIGHBOUR), rates


def _smallest(measures: FloatArray) -> float:
    """Return the smooth minimum of ``measures`` (k,)."""
    least = float(measures.min())
    return least - float(np.log(np.exp(SHARPNESS * (least - measures)).mean())) / SHARPNESS
