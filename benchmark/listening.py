# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Detection beside a healthy machine that goes to and fro, without ROS."""

from __future__ import annotations

import numpy as np

from fault_tolerance.detection.detector import Detector
from fault_tolerance.detection.sighting import Sighting
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.configuration import Configuration

_PERIOD = 0.01
_SPEED = 1e-4
_NOISE = 2e-9
_NOTHING = FailureSet()


class Listening:
    """Takes one set of readings a call, moving along the first column of T.

    Parameters
    ----------
    configuration : Configuration
        Where it is all the time, as far as the responses are concerned.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._advance = best_kernel().advance
        self._detector = Detector(configuration.mechanism, advance=self._weighed)
        self._rows = strut_rows(configuration)
        self._way = reconfigured(self._rows, _NOTHING).present.mapping[:, 0]
        self._rng = np.random.default_rng(1)
        self._call, self._place = 0, 0.0
        self._arguments: tuple[object, ...] = ()
        while not self._arguments:
            self.readings()

    def _weighed(self, *arguments: object) -> float:
        self._arguments = arguments
        return float(self._advance(*arguments))

    def bank(self) -> None:
        """Take the last readings into all filters once more."""
        self._advance(*self._arguments)

    def readings(self) -> None:
        """Take the next readings: noise, filters, decision."""
        self._call += 1
        rate = _SPEED * np.cos(0.1 * self._call)
        self._place += _PERIOD * rate
        stamp = round(1e9 * _PERIOD * self._call)
        noise = _NOISE * self._rng.standard_normal(len(self._way))
        sighting = Sighting(stamp, self._place * self._way + noise)
        self._detector.observe(sighting, _NOTHING, np.eye(4), lambda: self._rows)
        self._detector.command(stamp, rate * self._way)
