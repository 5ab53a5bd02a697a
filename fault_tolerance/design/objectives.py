# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What a design is to be good at: the worst measure over all sets of failures, at all poses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations
from math import comb, pi, sin, sqrt

import numpy as np

from fault_tolerance.kinematics.actuator_measures import position_measures, torque_measures
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.measures import hard_measure, motion_quality
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.mechanism.arrays import FloatArray, IntArray, frozen

MEASURES = ('position', 'torque', 'hard', 'smallest_singular_value')

_PACKINGS = {
    3: (4, (70.5288, 63.4349, 63.4349, 54.7356, 49.6399, 47.9821, 46.6746, 44.4031, 41.8820)),
    4: (5, (75.5225, 70.5288, 67.0213, 65.5302)),
}
"""Degrees between the closest of N lines in three and four dimensions, from so many lines on, as
far apart as is known (N. J. A. Sloane, *Tables of packings in Grassmannian spaces*)."""


@dataclass(frozen=True)
class Objective:
    """The worst of a measure, to be as large as possible."""

    measure: str
    failures: int = 1
    """How many there are at a time."""
    scale: float = 0.0
    """What it is divided by, to be compared with other objectives; 0: its bound."""

    def __str__(self) -> str:
        if self.measure == 'smallest_singular_value':
            return 'smallest singular value'
        plural = '' if self.failures == 1 else 's'
        return f'{self.measure}, {self.failures} failure{plural}'

    def values(self, post: PostFailure) -> FloatArray:
        """Return the measure of every set of so many failures in ``post``."""
        present, mechanism = post.present, post.mechanism
        if self.measure == 'smallest_singular_value':
            return np.array([motion_quality(post)[1]])
        if self.measure == 'hard':
            lost = combinations(mechanism.strut_names, self.failures)
            return np.array([
                hard_measure(present, differential_kinematics(post.rows, FailureSet(lost=one)))
                for one in lost
            ])
        measures = position_measures if self.measure == 'position' else torque_measures
        return measures(present, _sets(len(mechanism.actuators), self.failures))

    def count(self, post: PostFailure) -> int:
        """Return how many sets of so many failures there are in ``post``."""
        if self.measure == 'smallest_singular_value':
            return 1
        mechanism = post.mechanism
        hard = self.measure == 'hard'
        return comb(len(mechanism.struts if hard else mechanism.actuators), self.failures)

    def bound(self, post: PostFailure) -> float | None:
        """Return what the worst cannot exceed (docs/theory.md, eq. 20), for ``post``; or None."""
        drives, freedom = len(post.mechanism.actuators), post.present.mobility
        major = len(post.mechanism.task.major)
        if self.measure == 'torque':
            return _bound(drives - freedom, drives, self.failures)
        if self.measure == 'position':
            return _bound(freedom - major, freedom, self.failures)
        return None

    def packing(self, post: PostFailure) -> float | None:
        """Return t of the worst pair if all rows of 1 - T T' are as far apart as lines can be.

        ``(r / N) sin`` of the angle between the closest of N lines in r dimensions, with r drives
        more than the mobility of ``post``: what drives that count alike can attain. None where
        that is not known.
        """
        drives = len(post.mechanism.actuators)
        spare = drives - post.present.mobility
        if self.measure != 'torque' or self.failures != 2:
            return None
        if spare == 2:
            return spare / drives * sin(pi / drives)
        first, angles = _PACKINGS.get(spare, (0, ()))
        if not 0 <= drives - first < len(angles):
            return None
        return spare / drives * sin(np.radians(angles[drives - first]))


def _bound(few: int, many: int, count: int) -> float:
    return sqrt(comb(max(few, 0), count) / comb(many, count)) if many >= count else 0.0


@cache
def _sets(count: int, size: int) -> IntArray:
    return frozen(np.array(list(combinations(range(count), size)), dtype=np.intp))
