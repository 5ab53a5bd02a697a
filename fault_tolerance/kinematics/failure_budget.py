# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How many more failures can come, and which struts may be taken for free actuators when lost."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.verdict import is_tolerable
from fault_tolerance.mechanism.freedom import attachment_of

MOST_SETS = 20_000
"""Sets of failures tried at most; beyond, the count found so far is a lower bound."""


@dataclass(frozen=True)
class FailureBudget:
    """How many further failures of one kind are tolerated."""

    guaranteed: int
    """Any so many more are tolerated, whichever they are."""
    best_case: int
    """Some set of so many more is tolerated, no larger one was found."""
    complete: bool
    """Whether all sets up to one beyond `best_case` were tried."""


@dataclass(frozen=True)
class Equivalence:
    """Whether losing a strut equals freeing its actuators, and why."""

    strut: str
    equivalent: bool
    reason: str


def failure_budget(
    post: PostFailure, mode: FailureMode, most_sets: int = MOST_SETS
) -> FailureBudget:
    """Return how many further failures of ``mode`` the state ``post`` bears.

    Not more than ``most_sets`` sets of failures are tried.
    """
    mechanism, failures = post.mechanism, post.failures
    if mode is FailureMode.HARD:
        names = [name for name in mechanism.strut_names if name not in failures.lost]
    else:
        driving = zip(mechanism.actuator_names, post.present.active, strict=True)
        names = [name for name, drives in driving if drives]
    guaranteed, best_case, tried, holds = 0, 0, 0, True
    if not post.verdict.tolerable:
        return FailureBudget(0, 0, True)
    for size in range(1, len(names) + 1):
        some, all_ = False, True
        for chosen in combinations(names, size):
            tried += 1
            if tried > most_sets:
                return FailureBudget(guaranteed, best_case, False)
            further = failures.and_also(mechanism, *(Failure(mode, name) for name in chosen))
            tolerable = is_tolerable(post.rows, differential_kinematics(post.rows, further))
            some, all_ = some or tolerable, all_ and tolerable
            if some and not (all_ and holds):
                break
        holds = holds and all_
        guaranteed = size if holds else guaranteed
        if not some:
            break
        best_case = size
    return FailureBudget(guaranteed, best_case, True)


def hard_torque_equivalence(
    rows: StrutRows, failures: FailureSet | None = None
) -> tuple[Equivalence, ...]:
    """Return for each strut of ``rows`` whether losing it equals freeing its actuators.

    It does where the strut bars nothing: its end has full manipulability, or what it bars is
    barred by the others too (paper, section III-E). Struts lost in ``failures`` are left out.
    """
    mechanism = rows.mechanism
    lost = (failures or FailureSet()).of(mechanism).lost
    freedom = _freedom(rows, lost)
    result = []
    for place, name in enumerate(mechanism.strut_names):
        if name in lost:
            continue
        if not (rows.structure_strut == place).any():
            result.append(Equivalence(name, True, 'its end has full manipulability'))
            continue
        gained = _freedom(rows, (*lost, name)) - freedom
        reason = 'what it bars is barred by the others too'
        if gained:
            freedoms = 'degree of freedom' if gained == 1 else 'degrees of freedom'
            reason = f'without it the structure allows {gained} more {freedoms}'
        result.append(Equivalence(name, gained == 0, reason))
    return tuple(result)


def _freedom(rows: StrutRows, lost: tuple[str, ...]) -> int:
    """Return how many independent twists the structure of the struts not ``lost`` allows."""
    return int(rows.structure_of(attachment_of(rows.mechanism, lost)).allowed.shape[1])
