# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Fault-tolerance measures p, t and h: of what has failed, and of what may fail next.

Each is a ratio of manipulabilities between 0 (intolerable) and 1 (nothing lost), with the rank it
needs made explicit (docs/theory.md, eq. 13-16).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from fault_tolerance.kinematics.actuator_measures import (
    position_measure,
    single_measures,
    torque_measure,
)
from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    differential_kinematics,
)
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet
from fault_tolerance.kinematics.subspaces import manipulability, range_basis, singular_values
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import CONDITION_CAP, EQUAL_MEASURES

if TYPE_CHECKING:
    from fault_tolerance.kinematics.reconfiguration import PostFailure


@dataclass(frozen=True)
class PresentMeasures:
    """What the failures present have cost."""

    position: float
    """p of the stuck set on the nominal kinematics."""
    torque: float
    """t of the free set after that."""
    hard: float
    """h of the lost set after both. Each is 1 where its set is empty."""
    retained_manipulability: float
    """w_m(J_m now) / w_m(J_m nominal); may exceed 1; 0 if intolerable."""
    smallest_singular_value: float
    condition_number: float
    """Of J_m now; the latter at most `CONDITION_CAP`."""

    def __repr__(self) -> str:
        return f'PresentMeasures(p {self.position:.4g}, t {self.torque:.4g}, h {self.hard:.4g})'


@dataclass(frozen=True, eq=False)
class NextFailure:
    """The measure of each single failure if it came next; NaN for what has failed already."""

    position: FloatArray
    torque: FloatArray
    """(N,): per actuator."""
    hard: FloatArray
    """(s,): per strut."""
    position_bound: float
    torque_bound: float
    """What the worst of them cannot exceed, whatever the mechanism (docs/theory.md, eq. 20)."""
    worst: Failure | None
    """The single failure that hurts most; None if nothing is left to fail."""
    worst_measure: float
    """Its measure, 0 if there is none."""

    def __repr__(self) -> str:
        return f'NextFailure(worst {self.worst}, {self.worst_measure:.4g})'


def hard_measure(before: DifferentialKinematics, after: DifferentialKinematics) -> float:
    """Return h for struts lost between ``before`` and ``after`` (eq. 16).

    ``w_r(J) / w_r(P J^)`` with r = rank J and P the projection on the range of J; 0 when the
    platform is no longer held.
    """
    if not after.stable:
        return 0.0
    basis = range_basis(before.jacobian)
    order = basis.shape[1]
    left = manipulability(basis.T @ after.jacobian, order)
    return manipulability(before.jacobian, order) / left if left > 0.0 else 0.0


def hard_measures(post: PostFailure) -> FloatArray:
    """Return h (s,) of the loss of each strut after the failures of ``post``; NaN if lost."""
    mechanism, present = post.mechanism, post.present
    result = np.full(len(mechanism.struts), np.nan)
    for place, name in enumerate(mechanism.strut_names):
        if name not in post.failures.lost:
            further = post.failures.and_also(mechanism, Failure(FailureMode.HARD, name))
            after = differential_kinematics(post.rows, further)
            result[place] = hard_measure(present, after)
    return frozen(result)


def present_measures(post: PostFailure) -> PresentMeasures:
    """Return what the failures of ``post`` have cost."""
    stuck = [post.mechanism.actuator_index(name) for name in post.failures.stuck]
    position = position_measure(post.nominal, stuck) if stuck else 1.0
    return PresentMeasures(position, *holding_measures(post), *motion_quality(post))


def motion_quality(post: PostFailure) -> tuple[float, float, float]:
    """Return what has become of J_m in ``post``, as in `PresentMeasures`.

    Retained manipulability, smallest singular value, and condition number.
    """
    major = post.present.major
    order, sigma = len(major), singular_values(major)
    smallest = float(sigma[order - 1]) if len(sigma) >= order else 0.0
    largest = float(sigma.max(initial=0.0))
    condition = largest / smallest if smallest > largest / CONDITION_CAP else CONDITION_CAP
    retained = retained_manipulability(post) if post.verdict.tolerable else 0.0
    return retained, smallest, condition


def retained_manipulability(post: PostFailure) -> float:
    """Return w_m(J_m) of ``post`` over that of its nominal kinematics, where the rank is m.

    0 when a major coordinate is lost, or was not there before.
    """
    major = post.present.major
    before = manipulability(post.nominal.major, len(major))
    return manipulability(major, len(major)) / before if before > 0.0 else 0.0


def holding_measures(post: PostFailure) -> tuple[float, float]:
    """Return t of the free set after the stuck set, and h of the lost set after both.

    Those of ``post``; each is 1 where its set is empty.
    """
    rows, failures = post.rows, post.failures
    torque = hard = 1.0
    if failures.free:
        locked = differential_kinematics(rows, FailureSet(stuck=failures.stuck))
        free = [post.mechanism.actuator_index(name) for name in failures.free]
        torque = torque_measure(locked, free)
    if failures.lost:
        freed = differential_kinematics(rows, FailureSet(failures.stuck, failures.free))
        hard = hard_measure(freed, post.present)
    return torque, hard


def next_failure(post: PostFailure) -> NextFailure:
    """Return the measure of every single failure after those of ``post``, taken as nominal."""
    mechanism, present = post.mechanism, post.present
    position, torque = single_measures(present)
    hard = hard_measures(post)
    return NextFailure(
        position,
        torque,
        hard,
        *measure_bounds(int(present.active.sum()), present.mobility, len(mechanism.task.major)),
        *worst_failure(mechanism, position, torque, hard),
    )


def measure_bounds(active: int, mobility: int, major: int) -> tuple[float, float]:
    """Return what p and t of the worst single failure cannot exceed (docs/theory.md, eq. 20).

    With ``active`` drives, of ``mobility`` degrees of freedom and ``major`` coordinates.
    """
    position = sqrt(max(mobility - major, 0) / mobility) if mobility else 0.0
    return position, sqrt(max(active - mobility, 0) / active) if active else 0.0


def worst_failure(
    mechanism: Mechanism, position: FloatArray, torque: FloatArray, hard: FloatArray
) -> tuple[Failure | None, float]:
    """Return the single failure of ``mechanism`` that hurts most, and its measure.

    Of the measures ``position`` (N,), ``torque`` (N,) and ``hard`` (s,) of each; None and 0 where
    all are NaN.
    """
    candidates = [
        (float(value), Failure(mode, name))
        for mode, names, values in (
            (FailureMode.POSITION, mechanism.actuator_names, position),
            (FailureMode.TORQUE, mechanism.actuator_names, torque),
            (FailureMode.HARD, mechanism.strut_names, hard),
        )
        for name, value in zip(names, values, strict=True)
        if not np.isnan(value)
    ]
    # Among equals the first one is taken: rounding errors must not choose.
    measure, worst = min(
        candidates, key=lambda each: round(each[0], EQUAL_MEASURES), default=(0.0, None)
    )
    return worst, measure
