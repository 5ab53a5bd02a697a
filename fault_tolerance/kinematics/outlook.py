# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How many more failures can come, and which struts may be taken for free actuators when lost."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from fault_tolerance.kinematics.differential import compatible_twists
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure, reconfigured
from fault_tolerance.kinematics.rows import StrutRows

MOST_SETS = 20_000
"""Sets of failures tried at most; beyond, the count found so far is a lower bound."""


@dataclass(frozen=True)
class Outlook:
    """How many further failures of one kind are tolerated whichever they are.

    Attributes
    ----------
    certain : int
        Any so many more are tolerated.
    possible : int
        Some set of so many more is tolerated, no larger one was found.
    complete : bool
        Whether all sets up to one beyond `possible` were tried.
    """

    certain: int
    possible: int
    complete: bool


@dataclass(frozen=True)
class Equivalence:
    """Whether losing a strut equals freeing its actuators, and why.

    Attributes
    ----------
    strut : str
    equivalent : bool
    reason : str
    """

    strut: str
    equivalent: bool
    reason: str


def outlook(state: PostFailure, mode: FailureMode, most_sets: int = MOST_SETS) -> Outlook:
    """Return how many further failures of ``mode`` the present ``state`` bears.

    Parameters
    ----------
    state : PostFailure
    mode : FailureMode
    most_sets : int
        How many sets of failures may be tried.
    """
    mechanism, failures = state.rows.mechanism, state.failures
    if mode is FailureMode.HARD:
        names = [name for name in mechanism.strut_names if name not in failures.lost]
    else:
        driving = zip(mechanism.actuator_names, state.present.active, strict=True)
        names = [name for name, drives in driving if drives]
    certain, possible, tried = 0, 0, 0
    still_certain = state.verdict.tolerable
    if not still_certain:
        return Outlook(0, 0, True)
    for size in range(1, len(names) + 1):
        some, all_ = False, True
        for chosen in combinations(names, size):
            tried += 1
            if tried > most_sets:
                return Outlook(certain, possible, False)
            further = failures.and_also(mechanism, *(Failure(mode, name) for name in chosen))
            tolerable = reconfigured(state.rows, further, state.nominal).verdict.tolerable
            some, all_ = some or tolerable, all_ and tolerable
            if some and not (all_ and still_certain):
                break
        still_certain = still_certain and all_
        certain = size if still_certain else certain
        if not some:
            break
        possible = size
    return Outlook(certain, possible, True)


def hard_torque_equivalence(
    rows: StrutRows, failures: FailureSet | None = None
) -> tuple[Equivalence, ...]:
    """Return for each strut still there whether losing it equals freeing its actuators.

    It does where the strut bars nothing: its end has full manipulability, or what it bars is
    barred by the others too (paper, section III-E).
    """
    lost = failures.lost if failures is not None else ()
    names = rows.mechanism.strut_names
    attached = np.array([name not in lost for name in names], dtype=bool)
    freedom = compatible_twists(rows, attached).shape[1]
    result = []
    for place in np.flatnonzero(attached).tolist():
        if not (rows.structure_strut == place).any():
            reason = 'its end has full manipulability'
            result.append(Equivalence(names[place], True, reason))
            continue
        others = attached.copy()
        others[place] = False
        gained = compatible_twists(rows, others).shape[1] - freedom
        reason = 'what it bars is barred by the others too'
        if gained:
            freedoms = 'degree of freedom' if gained == 1 else 'degrees of freedom'
            reason = f'without it the structure allows {gained} more {freedoms}'
        result.append(Equivalence(names[place], gained == 0, reason))
    return tuple(result)
