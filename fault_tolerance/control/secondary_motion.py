# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Secondary motion that climbs towards better tolerance of the next single failure.

While nothing has failed, the secondary coordinates of the task may go where the worst p, t or h of
the next failure is larger, instead of where they are asked to be (`Settings.secondary`). The major
task does not notice: the control law serves it first. Measures at neighbouring configurations say
which way is up, one coordinate at a time and after the command is on its way.
"""

from __future__ import annotations

from math import exp, inf

import numpy as np

from fault_tolerance.control.estimate import Estimate, estimate
from fault_tolerance.control.output import Output
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

STEP = 1e-3
"""Radians, and characteristic lengths, to the neighbours that are measured."""

SHARPNESS = 30.0
"""Of the smooth minimum of measures: those that are less than about 1/30 apart count together.

The worst measure itself has ridges, on which its slope would change to and fro.
"""

FLAT = 0.5
"""Slope, measure per radian or characteristic length, below which it goes slower."""

CADENCE = 0.01
"""Seconds between two pairs of neighbours."""

SMOOTHING = 0.2
"""Time constant of the climb, seconds."""

EASE = 0.5
"""Seconds in which climbing replaces following, and the reverse."""

GAP = 0.2
"""Seconds without a command after which climbing begins anew."""

MARGIN = 0.1
"""Share of a stroke before its end in which the climb slows down, to 0 at the end."""

_HOPELESS = 1e-6
_POOR = 1e-3


class SecondaryMotion:
    """Decides on the secondary part of the task velocity of one ``mechanism``.

    ``climbs`` says whether it is to climb. It has a say while it is ``active``.
    """

    def __init__(self, mechanism: Mechanism, climbs: bool) -> None:
        self._mechanism, task = mechanism, mechanism.task
        self._places = task.secondary_rows
        turning = task.rows[self._places] < 3
        length = mechanism.characteristic_length
        self._units = np.where(turning, 1.0, length)  # of the task, per characteristic length
        low, high = mechanism.position_limits.T
        self._low, self._high = low, high
        self._margin = np.where(np.isfinite(high - low), MARGIN * (high - low), 1.0)
        self._slopes = np.zeros(len(self._places))
        self._rates = np.zeros((len(mechanism.actuators), len(self._places)))
        self._turn, self._due, self._time = 0, -inf, -inf
        self._climb, self._share = np.zeros_like(self._slopes), 0.0
        self.active = self._climbs = False
        self.switch(climbs)

    def __repr__(self) -> str:
        return f'SecondaryMotion({self._mechanism.name!r}, share {self._share:.2f})'

    def switch(self, climbs: bool) -> None:
        """Climb from now on, or follow, as ``climbs`` says; from one to the other it eases."""
        self._climbs = climbs and len(self._places) > 0
        self.active = self.active or self._climbs

    def velocity(self, asked: FloatArray, found: Estimate, now: float) -> FloatArray:
        """Return the task velocity (l,) to command in place of the one ``asked`` for (l,).

        The major part is as asked. ``found`` is where the mechanism is, ``now`` in seconds.
        """
        elapsed, self._time = now - self._time, now
        self.active = self._climbs or self._share > 0.0
        if found.failures.parts or not self.active:
            self._share = 0.0  # the law eases what changes at a failure
            return asked
        if not 0.0 <= elapsed <= GAP:
            elapsed, self._share = 0.0, 0.0
        if not self._share:
            self._climb[:] = 0.0
        steep = max(float(np.linalg.norm(self._slopes)), FLAT)
        uphill = found.model.settings.secondary_speed / steep * self._slopes
        kept = exp(-elapsed / SMOOTHING)
        self._climb = kept * self._climb + (1.0 - kept) * uphill
        step = elapsed / EASE if self._climbs else -elapsed / EASE
        self._share = min(max(self._share + step, 0.0), 1.0)
        wanted = self._within_strokes(found) * self._climb * self._units
        result = asked.copy()
        result[self._places] += self._share * (wanted - asked[self._places])
        return result

    def consider(self, output: Output, now: float) -> None:
        """Measure two neighbours of where an ``output`` is, if it is time to (``now``, s).

        To be called after the command is on its way.
        """
        found = output.estimate
        if not self._climbs or output.failures.parts or output.idle or not found.located:
            self._slopes[:] = 0.0
            return
        if 0.0 <= now - self._due < CADENCE:
            return
        self._due = now
        self._turn = (self._turn + 1) % len(self._places)
        self._slopes[self._turn], self._rates[:, self._turn] = self._slope(found, self._turn)

    def _within_strokes(self, found: Estimate) -> float:
        """Return the share of the climb that is left near the ends of strokes."""
        rates, at = self._rates @ self._climb, found.actuator_values
        room = np.where(rates > 0.0, self._high - at, at - self._low) / self._margin
        return float(np.clip(np.where(rates == 0.0, 1.0, room), 0.0, 1.0).min())

    def _slope(self, found: Estimate, place: int) -> tuple[float, FloatArray]:
        """Return how the worst measure changes with a secondary coordinate, and how the drives do.

        Per radian or characteristic length of the one number ``place``, as far as the major task
        leaves it free; drives (N,) in their units.
        """
        task, parts = self._mechanism.task, found.arrays
        jacobian = parts.jacobian[task.rows]
        _, sigma, right = np.linalg.svd(jacobian[task.major_rows])
        rank = int((sigma > _POOR * sigma.max(initial=0.0)).sum())
        free = right[rank:].T
        turned = np.linalg.pinv(jacobian[task.secondary_rows] @ free, rcond=_POOR)
        length = self._mechanism.characteristic_length
        reduced = free @ turned[:, place] * length
        rates = (parts.follow @ reduced) / found.model.view.drives.scale
        beside = [
            estimate(found.model, found, found.actuator_values + way * rates, found.failures)
            for way in (STEP, -STEP)
        ]
        if not all(one.located and not one.obstacle for one in beside):
            return 0.0, rates
        up, down = (one.measures()[3:] for one in beside)
        # A failure that is fatal anyway is no reason to go anywhere.
        counted = (up > _HOPELESS) & (down > _HOPELESS)
        if not counted.any():
            return 0.0, rates
        return (_smallest(up[counted]) - _smallest(down[counted])) / (2.0 * STEP), rates


def _smallest(measures: FloatArray) -> float:
    """Return the smooth minimum of ``measures`` (k,)."""
    least = float(measures.min())
    return least - float(np.log(np.exp(SHARPNESS * (least - measures)).mean())) / SHARPNESS
