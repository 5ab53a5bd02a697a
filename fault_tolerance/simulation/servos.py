# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The drives of the simulated mechanism: commanded rate in, position held out."""

from __future__ import annotations

from math import exp

import numpy as np

from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism


class Servos:
    """N velocity servos, each a first-order lag with a rate limit and the stroke as its end.

    ``mechanism`` gives strokes and rates, ``time_constant`` is in seconds (0 follows at once), and
    ``unlimited_rate`` is the largest rate of an actuator that has no limit of its own: rad/s, or
    characteristic lengths a second where it slides. The drives hold the joint values ``setpoints``
    (N,); they are told to move at ``rates`` (N,), but static friction keeps each where it is until
    it should be farther away than ``breakaway`` (N,), radians or metres.

    A servo moves at its command times its ``obedience`` (N,), plus its ``own_rates`` (N,).
    """

    def __init__(
        self,
        mechanism: Mechanism,
        time_constant: float,
        unlimited_rate: float,
        breakaway: FloatArray | float = 0.0,
    ) -> None:
        sliding = [actuator.kind == 'prismatic' for actuator in mechanism.actuators]
        fallback = unlimited_rate * np.where(sliding, mechanism.characteristic_length, 1.0)
        limits = mechanism.velocity_limits
        self.rate_limits = np.where(np.isfinite(limits), limits, fallback)
        self.lowest = mechanism.position_limits[:, 0]
        self.highest = mechanism.position_limits[:, 1]
        self.setpoints = np.zeros(len(sliding))
        self.rates = np.zeros(len(sliding))
        self.obedience = np.ones(len(sliding))
        self.own_rates = np.zeros(len(sliding))
        # Where they would be without friction.
        self._goals = np.zeros(len(sliding))
        self._breakaway = breakaway
        self._time_constant = time_constant

    def advance(self, command: FloatArray, driven: BoolArray, dt: float) -> None:
        """Let the servos follow ``command`` (N,), rad/s and m/s, for ``dt`` seconds.

        The lag is integrated exactly, so that the distance travelled does not depend on how
        time is divided. Servos that are not ``driven`` (N,) stand still.
        """
        obeyed = self.obedience * np.clip(command, -self.rate_limits, self.rate_limits)
        wanted = np.clip(obeyed + self.own_rates, -self.rate_limits, self.rate_limits)
        lag = self._time_constant
        decay = exp(-dt / lag) if lag > 0.0 else 0.0
        behind = self.rates - wanted
        travel = np.where(driven, wanted * dt + behind * (lag * (1.0 - decay)), 0.0)
        reached = self._goals + travel
        self._goals = np.clip(reached, self.lowest, self.highest)
        moving = driven & (reached == self._goals)
        self.rates = np.where(moving, wanted + behind * decay, 0.0)
        slips = np.abs(self._goals - self.setpoints) > self._breakaway
        self.setpoints = np.where(slips, self._goals, self.setpoints)

    def rest_at(self, index: int, value: float) -> float:
        """Put servo ``index`` to rest as near to ``value`` as its stroke allows; return where."""
        within = float(np.clip(value, self.lowest[index], self.highest[index]))
        self.halt_at(index, within)
        return within

    def halt_at(self, index: int, value: float) -> None:
        """Put servo ``index`` to rest at ``value``, wherever that is."""
        self.setpoints[index] = self._goals[index] = value
        self.rates[index] = 0.0
