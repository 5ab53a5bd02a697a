# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Relief: strain that a late report or a repair has left behind is led back.

In directions that only strain the mechanism, and only after a change of the failures: what has
always been there may be meant.
"""

from __future__ import annotations

import numpy as np

from fault_tolerance.detection.self_stress import SelfStress
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

GAIN = 5.0
"""1/s: how fast strain is led back."""

SPEED = 1e-3
"""Characteristic lengths per second; the drives do not relieve strain faster."""

OVER_NOISE = 10.0
"""Strains below so many times the noise of the encoders are left alone."""


class Relief:
    """Relieves ``mechanism`` of strain, if that is ``wanted``.

    Attributes
    ----------
    disturbed : bool
        Whether there has been a change that may have left strain.
    internal_force : float
        The largest force of the drives against each other, N; NaN where no efforts show it.
    """

    def __init__(self, mechanism: Mechanism, wanted: bool) -> None:
        self._wanted, self._scale = wanted, mechanism.rate_scale
        self._fastest = SPEED * mechanism.characteristic_length
        self.disturbed = False
        self.internal_force = np.nan

    def rates(self, stress: SelfStress, efforts: FloatArray, noise: float) -> FloatArray | None:
        """Return rates (N,) that lead strain back, if a change has left any; else None.

        They are in the mechanism's units. ``stress`` is of the configuration, ``efforts`` (N,)
        are in N or N m, ``noise`` is the largest of the encoders, metres.
        """
        strain = stress.strain(np.nan_to_num(efforts))
        self.internal_force = stress.force(strain)
        if not self._wanted or float(np.abs(strain).max(initial=0.0)) <= OVER_NOISE * noise:
            self.disturbed = False
        if not self.disturbed:
            return None
        rates = GAIN * stress.relieving(strain)
        fastest = float(np.abs(self._scale * rates).max())
        return rates * min(1.0, self._fastest / fastest) if fastest > 0.0 else None
