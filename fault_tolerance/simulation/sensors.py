# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The encoders of the simulated mechanism: what they read, with noise, and how they may lie."""

from __future__ import annotations

import numpy as np

from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.faults import FaultMode
from fault_tolerance.simulation.plant_settings import PlantSettings


class Encoders:
    """N encoders, each on its joint (the load's side) or on its drive (the motor's side).

    ``mechanism`` and ``settings`` say which, and how noisy they are; ``levers`` (N,) are metres
    per unit of each, 1 where it slides. ``rng`` is the source of the noise. What is wrong with
    each is in ``faults``: 'frozen', 'biased' or 'none'.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        settings: PlantSettings,
        levers: FloatArray,
        rng: np.random.Generator,
    ) -> None:
        sides = [
            one.encoder if settings.encoders == 'file' else settings.encoders
            for one in mechanism.actuators
        ]
        self._on_motor = np.array([side == 'motor' for side in sides])
        self._noise = settings.encoder_noise / levers
        self._bias = settings.encoder_bias / levers
        self._last = np.zeros(len(sides))
        self.faults: list[FaultMode] = ['none'] * len(sides)
        self.rng = rng

    def sensed(self, joints: FloatArray, drives: FloatArray, free: BoolArray) -> FloatArray:
        """Return what there is to read (N,): ``joints`` (N,) or ``drives`` (N,), rad or m.

        A ``free`` (N,) drive is carried along with its joint.
        """
        return np.where(self._on_motor & ~free, drives, joints)

    def readings(self, sensed: FloatArray, awake: BoolArray) -> FloatArray:
        """Return what they say of the values ``sensed`` (N,), rad or m.

        Those that are not ``awake`` (N,) are free of noise. A frozen one repeats the last reading.
        """
        # Drawn for all of them always: no fault changes the noise of others.
        noise = self._noise * self.rng.standard_normal(len(sensed))
        biased, frozen = self._have('biased'), self._have('frozen')
        read = sensed + np.where(biased, self._bias, 0.0) + np.where(awake, noise, 0.0)
        self._last = np.where(frozen, self._last, read)
        return self._last.copy()

    def speeds(self, before: FloatArray, sensed: FloatArray, dt: float) -> FloatArray:
        """Return the speeds (N,) they say: from values ``before`` (N,) to ``sensed`` in ``dt``."""
        return np.where(self._have('frozen'), 0.0, (sensed - before) / dt)

    def _have(self, fault: FaultMode) -> BoolArray:
        return np.array([one == fault for one in self.faults])
