# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The examination of a mechanism as plain data: freedom, constraints, budget, conversions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

import numpy as np

from fault_tolerance.analysis.hints import hints
from fault_tolerance.analysis.reports import failure_entries, group_entries, worst_next
from fault_tolerance.analysis.scene import joint_groups, joint_letter
from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.classification import classification, redundancy
from fault_tolerance.kinematics.common_causes import group_outlooks
from fault_tolerance.kinematics.conversion import Conversion, best_conversion
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failure_budget import failure_budget, hard_torque_equivalence
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.kinematics.subspaces import rank_of, singular_values
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import Configuration
from fault_tolerance.mechanism.parts import Actuator, Strut

_BREAKDOWNS = (FailureMode.POSITION, FailureMode.TORQUE, FailureMode.HARD)
# Sets of failures tried of a mechanism with up to so many actuators; with more of them one set
# takes longer, and fewer are tried.
_MOST_SETS, _ORDINARY_COUNT = 4000, 8


def check_report(configuration: Configuration, post: PostFailure) -> dict[str, Any]:
    """Return the examination of the mechanism at ``configuration``, with its kinematics ``post``.

    Plain data for JSON, with the keys of docs/command_line.md.
    """
    mechanism, verdict, groups = configuration.mechanism, post.verdict, group_outlooks(post)
    at_home = differential_kinematics(home_rows(mechanism))
    values = configuration.actuator_values.tolist()
    count = max(len(mechanism.actuators), _ORDINARY_COUNT)
    return {
        'mechanism': mechanism.name,
        'task': list(mechanism.task.coordinates),
        'major': list(mechanism.task.major),
        'characteristic_length': mechanism.characteristic_length,
        'compliance': mechanism.compliance,
        'actuators': list(map(_actuator, mechanism.actuators, values)),
        'struts': _struts(post),
        'failures': failure_entries(post.failures),
        'mobility': verdict.mobility,
        'stable': verdict.stable,
        'tolerable': verdict.tolerable,
        'reason': verdict.reason,
        'classification': list(classification(post, at_home)),
        'redundancy': asdict(redundancy(post)),
        'closure': {
            'residual': configuration.closure_residual,
            'flexure_strain': configuration.flexure_strain,
            'misfit': configuration.largest_misfit,
        },
        'singular_values': {
            'major': singular_values(post.present.major).tolist(),
            'structure': singular_values(_attached_structure(post)).tolist(),
        },
        'constraints': _constraints(post),
        'equivalence': {
            entry.strut: {'equivalent': entry.equivalent, 'reason': entry.reason}
            for entry in hard_torque_equivalence(post.rows, post.failures)
        },
        'failure_budget': {
            mode.value: asdict(failure_budget(post, mode, _MOST_SETS * _ORDINARY_COUNT // count))
            for mode in _BREAKDOWNS
        },
        'groups': group_entries(groups),
        'worst_next': worst_next(post, groups),
        'conversions': _conversions(post),
        'hints': hints(mechanism),
    }


def _actuator(actuator: Actuator, value: float) -> dict[str, Any]:
    return {
        'name': actuator.name,
        'strut': actuator.strut or None,
        'joint': actuator.joint or None,
        'kind': actuator.kind,
        'position': [_finite(limit) for limit in actuator.position],
        'velocity': _finite(actuator.velocity),
        'joint_state_name': actuator.joint_state_name,
        'home': actuator.home,
        'sign': actuator.sign,
        'brake': actuator.brake,
        'value': value,
    }


def _struts(post: PostFailure) -> list[dict[str, Any]]:
    owners = post.rows.structure_strut
    return [
        {
            'name': strut.name,
            'chain': chain_in_letters(strut),
            'joints': [joint.name for joint in strut.joints],
            'actuators': [actuator.name for actuator in strut.actuators],
            'release': strut.release,
            'bars': int((owners == place).sum()),
        }
        for place, strut in enumerate(post.rows.mechanism.struts)
    ]


def chain_in_letters(strut: Strut) -> str:
    """Return the joints of ``strut``, base to platform, as in ``R P* S``; * marks a drive."""
    return ' '.join(
        joint_letter(joints) + '*' * any(joint.actuator is not None for joint in joints)
        for _, joints in joint_groups(strut)
    )


def _attached_structure(post: PostFailure) -> FloatArray:
    """Return the structural rows (g, d) of the struts that hold the platform."""
    names = post.rows.mechanism.strut_names
    lost = [names.index(name) for name in post.failures.lost]
    structure: FloatArray = post.rows.structure[~np.isin(post.rows.structure_strut, lost)]
    return structure


def _constraints(post: PostFailure) -> dict[str, Any]:
    """Return how many directions the struts bar, and what becomes of those barred twice."""
    structure = _attached_structure(post)
    independent = rank_of(singular_values(structure))
    return {
        'rows': len(structure),
        'repeated': len(structure) - independent,
        'absorbed': post.present.absorbed,
        'effective': independent - post.present.absorbed,
        'weakest': _finite(post.present.weakest_kept),
    }


def _conversions(post: PostFailure) -> list[dict[str, Any]]:
    """Return what brakes and releases make of the failures present, or else of each to come."""
    mechanism, failures = post.rows.mechanism, post.failures
    cases: Sequence[FailureSet] = [failures]
    if not failures:
        cases = [
            FailureSet().and_also(mechanism, Failure(mode, name))
            for mode in (FailureMode.POSITION, FailureMode.TORQUE)
            for name in mechanism.actuator_names
        ]
    found = []
    for case in cases:
        entry: dict[str, Any] = {'failures': failure_entries(case), 'as_it_is': None, 'best': None}
        try:
            conversions = best_conversion(post.rows, case)
        except FailureError:
            # So much is broken at once that not every combination of actions can be tried.
            found.append(entry)
            continue
        if len(conversions.options) > 1:
            entry['as_it_is'] = _conversion(conversions.as_it_is)
            entry['best'] = _conversion(conversions.best)
            found.append(entry)
    return found


def _conversion(conversion: Conversion) -> dict[str, Any]:
    return {
        'actions': [{'from': str(one), 'to': str(other)} for one, other in conversion.actions],
        'tolerable': conversion.verdict.tolerable,
        'kept': conversion.kept,
    }


def _finite(value: float) -> float | None:
    """Return ``value``, or None (no limit) where it is infinite: JSON has no infinity."""
    return float(value) if isfinite(value) else None
