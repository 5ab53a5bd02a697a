# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Everything known about a mechanism in one state, as plain data for JSON."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from fault_tolerance.kinematics.failure_budget import hard_torque_equivalence
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.measures import NextFailure
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.mechanism.arrays import FloatArray


def measures_report(state: PostFailure, *, pairs: bool = False) -> dict[str, Any]:
    """Return the measures of ``state`` and its kinematics as plain data for JSON.

    ``pairs`` adds every pair of further failures. The keys: docs/command_line.md.
    """
    mechanism, present, verdict = state.mechanism, state.present, state.verdict
    actuators, struts = mechanism.actuator_names, mechanism.strut_names
    so_far, ahead = state.measures, state.next_failure
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
        'worst_next': worst_next(ahead),
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


def worst_next(ahead: NextFailure) -> dict[str, Any] | None:
    """Return mode, name and measure of the worst failure ``ahead``; None if nothing is left."""
    if ahead.worst is None:
        return None
    worst = ahead.worst
    return {'mode': worst.mode.value, 'name': worst.name, 'measure': ahead.worst_measure}


def _by_name(names: tuple[str, ...], values: FloatArray) -> dict[str, float | None]:
    """Return the values by name, None for NaN: what has failed already."""
    return {
        name: None if value != value else value
        for name, value in zip(names, values.tolist(), strict=True)
    }


def _rows(matrix: FloatArray) -> list[list[float]]:
    # Adding zero turns -0.0 into 0.0.
    return [[value + 0.0 for value in row] for row in matrix.tolist()]
