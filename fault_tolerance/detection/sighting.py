# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the sensors say at one moment, and the same as channels in metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.detection.hypotheses import Symptom
from fault_tolerance.detection.responses import Responses, Sensors
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.screws import difference

REACH = 0.02
"""Characteristic lengths, and radians, for which the responses of one configuration serve."""

LONGEST_GAP = 250_000_000
"""Nanoseconds without a reading after which everything starts again: what happened is unknown."""

LARGEST_JUMP = 1e-2
"""Characteristic lengths by which a reading that jumps may be off."""

LEAST_CHECK = 0.1
"""Share of a jump that the other encoders must contradict for it to be noticed."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """One set of readings.

    Attributes
    ----------
    stamp : int
        Nanoseconds, of the message.
    values : (N,) array
        Joint values from home in the mechanism's units; NaN where there is none.
    efforts : (N,) array or None
        N or N m; None where they are not sent.
    pose : (4, 4) array or None
        Of the platform by a sensor; None where there is nothing new.
    """

    stamp: int
    values: FloatArray
    efforts: FloatArray | None = None
    pose: FloatArray | None = None


class Channels:
    """Turns sightings of ``mechanism`` into channels: encoders, efforts, platform; all in metres.

    Efforts are divided by the stiffness of the drives, and need it in the mechanism file. The
    platform's motions are summed up from pose to pose.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._scale, self._length = mechanism.rate_scale, mechanism.characteristic_length
        self._yielding = self._scale / mechanism.drive_stiffness
        self._pose: FloatArray | None = None
        self._travelled = np.zeros(6)

    @property
    def count(self) -> int:
        """How many channels there are."""
        return 2 * len(self._scale) + 6

    def readings(self, sighting: Sighting) -> FloatArray:
        """Return the channels (c,) of a ``sighting``, NaN where there is nothing new."""
        count = len(self._scale)
        result = np.full(self.count, np.nan)
        result[:count] = self._scale * sighting.values
        if sighting.efforts is not None:
            result[count : 2 * count] = self._yielding * sighting.efforts
        if sighting.pose is not None:
            if self._pose is not None:
                moved = difference(sighting.pose, self._pose)
                self._travelled += np.repeat([self._length, 1.0], 3) * moved
            self._pose = sighting.pose
            result[2 * count :] = self._travelled
        return result

    def proved(self, deviation: FloatArray) -> Sensors:
        """Return which sensors beside the encoders have a noise ``deviation`` (c,)."""
        count = len(self._scale)
        heard = deviation > 0.0
        return Sensors(bool(heard[count : 2 * count].any()), bool(heard[2 * count :].all()))

    def jumps(self, found: Responses) -> FloatArray:
        """Return by how many metres a channel may have jumped, (h,): by hypothesis of ``found``.

        Only readings that the other encoders check; elsewhere a jump of the reading cannot be
        told from one of the machine.
        """
        count = len(self._scale)
        left, sigma, _ = np.linalg.svd(found.matrices[0, :count])
        unmoved = left[:, sigma <= 0.5 * sigma.max(initial=0.0)]
        result = np.zeros(len(found.hypotheses))
        for place, suspect in enumerate(found.hypotheses):
            if suspect.symptom is Symptom.BIASED:
                check = float(np.linalg.norm(unmoved.T @ found.drift[place, :count]))
                result[place] = LARGEST_JUMP * self._length if check > LEAST_CHECK else -1.0
        return result


def distance(before: FloatArray, after: FloatArray, length: float) -> float:
    """Return how far two poses ``before`` and ``after`` (4, 4) are apart, a small rotation.

    In radians, or in units of ``length``, metres, whichever is more.
    """
    turned = np.abs(after[:3, :3] - before[:3, :3]).max()
    return float(max(turned, np.abs(after[:3, 3] - before[:3, 3]).max() / length))
