# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Everything known about a mechanism in one state, as plain data for JSON."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from fault_tolerance.kinematics.many_measures import pair_measures
from fault_tolerance.kinematics.measures import NextFailure, next_failure, present_measures
from fault_tolerance.kinematics.outlook import hard_torque_equivalence
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.mechanism.arrays import FloatArray


def measures_report(state: PostFailure, *, pairs: bool = False) -> dict[str, Any]:
    """Return the measures of ``state`` and its kinematics as strings, numbers, lists and None.

    Parameters
    ----------
    state : PostFailure
    pairs : bool
        Whether every pair of further failures is wanted too.

    Returns
    -------
    dict
        The keys of ``python -m fault_tolerance measures --json``: docs/command_line.md.
    """
    mechanism, present, verdict = state.rows.mechanism, state.present, state.verdict
    actuators, struts = mechanism.actuator_names, mechanism.strut_names
    so_far, ahead = present_measures(state), next_failure(state)
    report: dict[str, Any] = {
        'mechanism': mechanism.name,
        'actuators': list(actuators),
        'struts': list(struts),
        'task': list(mechanism.task.coordinates),
        'major': list(mechanism.task.major),
        'mobility': verdict.mobility,
        'stable': verdict.stable,
        'tolerable': verdict.tolerable,
        'reason': verdict.reason,
        'jacobian': _rows(present.jacobian),
        'mapping': _rows(present.mapping),
        'failures': [
            {'name': failure.name, 'mode': failure.mode.value}
            for failure in state.failures.failures
        ],
        'lost': list(verdict.lost),
        'gained': list(verdict.gained),
        'present': {
            'position': so_far.position,
            'torque': so_far.torque,
            'hard': so_far.hard,
            'retained_manipulability': so_far.retained_manipulability,
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
        for key, values in zip(
            ('position_pairs', 'torque_pairs'), pair_measures(present), strict=True
        ):
            report[key] = {
                f'{actuators[first]},{actuators[second]}': float(values[first, second])
                for first, second in combinations(driving, 2)
            }
    return report


def worst_next(ahead: NextFailure) -> dict[str, Any] | None:
    """Return the single failure that would hurt most, None if nothing is left to fail."""
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
