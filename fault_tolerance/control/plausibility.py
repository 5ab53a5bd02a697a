# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether joint readings can be true: within the strokes of the mechanism file."""

from __future__ import annotations

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import OVERSHOOT


class Plausibility:
    """Watches the readings of the single actuators of ``mechanism``."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._names = mechanism.actuator_names
        limits = mechanism.position_limits
        stroke = limits[:, 1] - limits[:, 0]
        margin = OVERSHOOT * np.where(np.isfinite(stroke), stroke, 0.0)
        self._lowest, self._highest = limits[:, 0] - margin, limits[:, 1] + margin
        self.out_of_range: tuple[str, ...] = ()
        """Actuators whose readings lie beyond their strokes."""
        self.notices: tuple[Notice, ...] = ()
        """The same as warnings, for as long as it lasts."""

    def observe(self, values: FloatArray) -> tuple[Notice, ...]:
        """Take the joint ``values`` (N,), NaN in lost struts; return a notice if any is news."""
        outside = _named(self._names, (values < self._lowest) | (values > self._highest))
        if outside == self.out_of_range:
            return ()
        text = f'{", ".join(outside)}: beyond the stroke in the mechanism file'
        self.notices = (Notice('out_of_range', text, rejected=False),) if outside else ()
        news = self.notices if set(outside) - set(self.out_of_range) else ()
        self.out_of_range = outside
        return news


def _named(names: tuple[str, ...], chosen: BoolArray) -> tuple[str, ...]:
    if not any(chosen.tolist()):  # nearly always, and this runs at every step
        return ()
    return tuple(name for name, yes in zip(names, chosen, strict=True) if yes)
