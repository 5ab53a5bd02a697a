# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Everything known about a mechanism in one state, as plain data for JSON."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from typing import Any

import numpy as np

from fault_tolerance.kinematics.common_causes import GroupOutlook, group_outlooks, worst_group
from fault_tolerance.kinematics.failure_budget import hard_torque_equivalence
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.mechanism.arrays import FloatArray


def measures_report(state: PostFailure, *, pairs: bool = False) -> dict[str, Any]:
    """Return the measures of ``state`` and its kinematics as plain data for JSON.

    ``pairs`` adds every pair of further failures. The keys: docs/command_line.md.
    """
    mechanism, present, verdict = state.mechanism, state.present, state.verdict
    actuators, struts = mechanism.actuator_names, mechanism.strut_names
    so_far, ahead, groups = state.measures, state.next_failure, group_outlooks(state)
    report: dict[str, Any] = {
        'mechanism': mechanism.name,
        'actuators': list(actuators),
        'struts': list(struts),
        'task': list(mechanism.task.coordinates),
        'major': list(mechanism.task.major),
        'at': _by_name(actuators, state.configuration.actuator_values),
        'mobility': verdict.mobility,
        'stable': verdict.stable,
        'tolerable': verdict.tolerable,
        'reason': verdict.reason,
        'jacobian': _rows(present.jacobian),
        'mapping': _rows(present.mapping),
        'failures': failure_entries(state.failures),
        'lost': list(verdict.lost),
        'gained': list(verdict.gained),
        'present': {
            name: getattr(so_far, name)
            for name in ('position', 'torque', 'hard', 'retained_manipulability')
        },
        'smallest_singular_value': so_far.smallest_singular_value,
        'condition_number': so_far.condition_number,
        'position': _by_name(actuators, ahead.position),
        'torque': _by_name(actuators, ahead.torque),
        'hard': _by_name(struts, ahead.hard),
        'groups': group_entries(groups),
        'worst_next': worst_next(state, groups),
        'hard_torque_equivalence': {
            entry.strut: entry.equivalent
            for entry in hard_torque_equivalence(state.rows, state.failures)
        },
    }
    if pairs:
        driving = np.flatnonzero(present.active).tolist()
        for kind, values in state.pair_measures._asdict().items():
            report[f'{kind}_pairs'] = {
                f'{actuators[first]},{actuators[second]}': float(values[first, second])
                for first, second in combinations(driving, 2)
            }
    return report


def failure_entries(failures: FailureSet) -> list[dict[str, str]]:
    """Return name and mode of each of ``failures``."""
    return [{'name': failure.name, 'mode': failure.mode.value} for failure in failures.failures]


def group_entries(groups: Iterable[GroupOutlook]) -> dict[str, dict[str, Any] | None]:
    """Return what each of the ``groups`` would leave if it failed next, by name; None: it has."""
    return {
        one.name: None if one.verdict is None else {
            'failures': failure_entries(one.failures),
            'tolerable': one.verdict.tolerable,
            'reason': one.verdict.reason,
        }
        for one in groups
    }


def worst_next(state: PostFailure, groups: Iterable[GroupOutlook]) -> dict[str, Any] | None:
    """Return mode, name and measure of the worst failure after ``state``; None: nothing is left.

    If every single one is tolerable, one of the ``groups`` may be the worst: with mode ``group``.
    """
    ahead = state.next_failure
    worst, measure = ahead.worst, ahead.worst_measure
    intolerable = [one.name for one in groups if one.verdict and not one.verdict.tolerable]
    group = worst_group(intolerable, measure if worst else None)
    if group:
        return {'mode': 'group', 'name': group, 'measure': 0.0}
    if worst is None:
        return None
    return {'mode': worst.mode.value, 'name': worst.name, 'measure': measure}


def _by_name(names: tuple[str, ...], values: FloatArray) -> dict[str, float | None]:
    """Return the values by name, None for NaN: what has failed already."""
    return {
        name: None if value != value else value
        for name, value in zip(names, values.tolist(), strict=True)
    }


def _rows(matrix: FloatArray) -> list[list[float]]:
    # Adding zero turns -0.0 into 0.0.
    return [[value + 0.0 for value in row] for row in matrix.tolist()]
