# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Parts that fail together by a common cause, and what would be left without them.

An amplifier that carries two drives is a group of the mechanism file. When it fails, each of its
drives is what it is without power.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fault_tolerance.kinematics.actuator_measures import single_measures
from fault_tolerance.kinematics.failures import (
    Failure,
    FailureMode,
    FailureSet,
    actuators_named,
    failure_set,
)
from fault_tolerance.kinematics.reconfiguration import PostFailure, after, reconfigured
from fault_tolerance.kinematics.verdict import Verdict
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.failure_modes import mode_from_word
from fault_tolerance.tolerances import EQUAL_MEASURES


@dataclass(frozen=True)
class GroupOutlook:
    """What one group would leave if it failed next."""

    name: str
    failures: FailureSet
    """What would fail."""
    verdict: Verdict | None
    """On what would be left; None where all of it has failed already."""


def group_failures(mechanism: Mechanism) -> dict[str, FailureSet]:
    """Return what fails with each group of ``mechanism``, by the name of the group.

    Every drive as `when_off` of the mechanism file says, where that is not given by the worse of
    stuck and free (`worse_modes`). A strut in a group means its drives; one that has none is lost.
    """
    groups = mechanism.groups
    worse = worse_modes(mechanism) if groups else {}
    when_off = {one.name: one.when_off for one in mechanism.actuators}

    def fails(part: str) -> tuple[Failure, ...]:
        if part in mechanism.strut_names and not mechanism.actuators_of(part):
            return (Failure(FailureMode.HARD, part),)
        return tuple(
            Failure(mode_from_word(when_off[one]) if when_off[one] else worse[one], one)
            for one in actuators_named(mechanism, part)
        )

    return {
        name: failure_set(mechanism, [one for part in parts for one in fails(part)])
        for name, parts in groups.items()
    }


def group_outlooks(post: PostFailure) -> tuple[GroupOutlook, ...]:
    """Return what each group would leave if it failed next, after the failures of ``post``."""
    found = []
    for name, failures in group_failures(post.mechanism).items():
        further = post.failures.and_also(post.mechanism, *failures.failures)
        left = None if further == post.failures else reconfigured(post.rows, further).verdict
        found.append(GroupOutlook(name, failures, left))
    return tuple(found)


def worst_group(intolerable: Sequence[str], measure: float | None) -> str:
    """Return which group hurts more than any single failure; empty if none does.

    Parameters
    ----------
    intolerable : sequence of str
        The groups that must not fail next, in their order.
    measure : float or None
        Of the worst single failure; None if nothing is left to fail.

    Returns
    -------
    str
    """
    stopped_by_one = measure is not None and round(measure, EQUAL_MEASURES) <= 0.0
    return '' if stopped_by_one or not intolerable else intolerable[0]


def worse_modes(mechanism: Mechanism) -> dict[str, FailureMode]:
    """Return of stuck and free what costs more at home, for every actuator of ``mechanism``."""
    measures = single_measures(after(mechanism).present)
    stuck, free = (values.round(EQUAL_MEASURES) for values in measures)
    return {
        name: FailureMode.POSITION if stuck[place] <= free[place] else FailureMode.TORQUE
        for place, name in enumerate(mechanism.actuator_names)
    }


def members(mechanism: Mechanism, part: str) -> tuple[str, ...]:
    """Return the actuators of ``mechanism`` that ``part``, an actuator, strut or group, means.

    FailureError if there is none.
    """
    names = mechanism.groups.get(part, (part,))
    found = {one for name in names for one in actuators_named(mechanism, name)}
    return tuple(one for one in mechanism.actuator_names if one in found)
