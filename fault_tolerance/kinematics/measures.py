# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Fault-tolerance measures p, t and h: of what has failed, and of what may fail next.

Each is a ratio of manipulabilities between 0 (intolerable) and 1 (nothing lost); see
docs/theory.md, section 5. By definition, with the rank each needs made explicit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import sqrt

import numpy as np

from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    differential_kinematics,
)
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet
from fault_tolerance.kinematics.many_measures import hard_measures, single_measures
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.kinematics.subspaces import (
    manipulability,
    null_space,
    range_basis,
    singular_values,
)
from fault_tolerance.mechanism.arrays import FloatArray, frozen_array

CONDITION_CAP = 1e12
"""Condition numbers are reported up to here: infinity has no place in a message or in JSON."""


@dataclass(frozen=True)
class PresentMeasures:
    """What the failures present have cost.

    Attributes
    ----------
    position : float
        p of the stuck set on the nominal kinematics.
    torque : float
        t of the free set after that.
    hard : float
        h of the lost set after both. Each is 1 where its set is empty.
    retained_manipulability : float
        w_m(J_m now) / w_m(J_m nominal); may exceed 1; 0 if intolerable.
    smallest_singular_value, condition_number : float
        Of J_m now; the latter at most `CONDITION_CAP`.
    """

    position: float
    torque: float
    hard: float
    retained_manipulability: float
    smallest_singular_value: float
    condition_number: float


@dataclass(frozen=True, eq=False)
class NextFailure:
    """The measure of each single failure if it came next; NaN for what has failed already.

    Attributes
    ----------
    position, torque : (N,) array
        Per actuator.
    hard : (s,) array
        Per strut.
    position_bound, torque_bound : float
        What the worst of them cannot exceed, whatever the mechanism (docs/theory.md, eq. 20).
    worst : Failure or None
        The single failure that hurts most; None if nothing is left to fail.
    worst_measure : float
        Its measure, 0 if there is none.
    """

    position: FloatArray
    torque: FloatArray
    hard: FloatArray
    position_bound: float
    torque_bound: float
    worst: Failure | None
    worst_measure: float


def position_measure(kinematics: DifferentialKinematics, stuck: Sequence[int]) -> float:
    """Return p for position failures of the actuators at the places ``stuck`` (eq. 14).

    ``w_m(J_m N) / w_m(J_m)`` with N a basis of the null space of their rows of T; 0 when a major
    coordinate is lost.
    """
    major = kinematics.major
    order = len(major)
    sigma = singular_values(major)
    scale = float(sigma.max(initial=0.0))
    nominal = manipulability(major, order, scale)
    if nominal == 0.0:
        return 0.0
    unlocked = null_space(kinematics.mapping[list(stuck)], 1.0)
    return manipulability(major @ unlocked, order, scale) / nominal


def torque_measure(kinematics: DifferentialKinematics, free: Sequence[int]) -> float:
    """Return t for torque failures of the actuators at the places ``free`` (eq. 15).

    ``w_n(T_r)`` of the rows that still drive; 0 when the platform is no longer held.
    """
    remaining = np.delete(kinematics.mapping, list(free), axis=0)
    return manipulability(remaining, kinematics.mobility, 1.0)


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


def present_measures(state: PostFailure) -> PresentMeasures:
    """Return what the failures of ``state`` have cost."""
    rows, failures, nominal = state.rows, state.failures, state.nominal
    locked = nominal
    if failures.stuck and (failures.free or failures.lost):
        locked = differential_kinematics(rows, FailureSet(stuck=failures.stuck))
    freed = locked
    if failures.free and failures.lost:
        freed = differential_kinematics(rows, FailureSet(failures.stuck, failures.free))
    order = len(nominal.task.major)
    stuck = [rows.mechanism.actuator_index(name) for name in failures.stuck]
    free = [rows.mechanism.actuator_index(name) for name in failures.free]
    sigma = singular_values(state.present.major)
    smallest = float(sigma[order - 1]) if len(sigma) >= order else 0.0
    largest = float(sigma.max(initial=0.0))
    condition = largest / smallest if smallest > largest / CONDITION_CAP else CONDITION_CAP
    retained = 0.0
    before = manipulability(nominal.major, order)
    if state.verdict.tolerable and before > 0.0:
        retained = manipulability(state.present.major, order) / before
    return PresentMeasures(
        position_measure(nominal, stuck) if stuck else 1.0,
        torque_measure(locked, free) if free else 1.0,
        hard_measure(freed, state.present) if failures.lost else 1.0,
        retained,
        smallest,
        condition,
    )


def next_failure(state: PostFailure) -> NextFailure:
    """Return the measure of every single further failure, the present taken as nominal."""
    return next_failure_from(
        state,
        single_measures(state.present),
        hard_measures(state.rows, state.failures, state.present),
    )


def next_failure_from(
    state: PostFailure, singles: tuple[FloatArray, FloatArray], hard: FloatArray
) -> NextFailure:
    """Return the same from p and t of every actuator, (N,) each, and h of every strut, (s,)."""
    mechanism, present = state.rows.mechanism, state.present
    count = len(mechanism.actuators)
    position, torque = singles
    names = mechanism.actuator_names, mechanism.strut_names
    worst, measure = _worst(*names, position, torque, hard)
    left, mobility = int(present.active.sum()), present.mobility
    return NextFailure(
        frozen_array(position, (count,), 'p', finite=False),
        frozen_array(torque, (count,), 't', finite=False),
        frozen_array(hard, (len(mechanism.struts),), 'h', finite=False),
        sqrt(max(mobility - len(mechanism.task.major), 0) / mobility) if mobility else 0.0,
        sqrt(max(left - mobility, 0) / left) if left else 0.0,
        worst,
        measure,
    )


def pair_measures(
    kinematics: DifferentialKinematics,
) -> tuple[dict[tuple[int, int], float], dict[tuple[int, int], float]]:
    """Return p and t of every pair of driving actuators, by their places."""
    places = [int(index) for index in np.flatnonzero(kinematics.active)]
    pairs = list(combinations(places, 2))
    position = {pair: position_measure(kinematics, pair) for pair in pairs}
    torque = {pair: torque_measure(kinematics, pair) for pair in pairs}
    return position, torque


def _worst(
    actuators: tuple[str, ...],
    struts: tuple[str, ...],
    position: FloatArray,
    torque: FloatArray,
    hard: FloatArray,
) -> tuple[Failure | None, float]:
    candidates = [
        (float(value), Failure(mode, name))
        for mode, names, values in (
            (FailureMode.POSITION, actuators, position),
            (FailureMode.TORQUE, actuators, torque),
            (FailureMode.HARD, struts, hard),
        )
        for name, value in zip(names, values, strict=True)
        if not np.isnan(value)
    ]
    if not candidates:
        return None, 0.0
    # Rounding error does not choose between equals: the first named does.
    value, failure = min(candidates, key=lambda candidate: round(candidate[0], 9))
    return failure, value
