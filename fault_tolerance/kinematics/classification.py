# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What kind of manipulator it is in this state: the paper's remarks on Theorem 1, with names.

Under-constrained: the platform moves with every drive at rest. Over-constrained: constraints
take away degrees of freedom that the mechanism has without them, as stuck joints do.
Kinematically redundant: there are more drives than degrees of freedom, by redundant struts or by
overactuation; this takes no degree of freedom away.
"""

from __future__ import annotations

from dataclasses import dataclass

from fault_tolerance.kinematics.actuator_measures import torque_measure
from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    differential_kinematics,
)
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure

UNDER_CONSTRAINED = 'under-constrained'
OVER_CONSTRAINED = 'over-constrained'
KINEMATICALLY_REDUNDANT = 'kinematically redundant'


@dataclass(frozen=True)
class Redundancy:
    """How much more a mechanism has than it needs."""

    kinematic: int
    """Drives beyond the degrees of freedom they control, N - n."""
    task: int
    """Degrees of freedom beyond the major coordinates, n - m (negative where some are missing)."""
    struts: tuple[str, ...]
    """Struts without which the platform moves and is held as before."""
    drives: tuple[str, ...]
    """Drives without which the platform is held, though their struts could not be spared."""


def classification(
    post: PostFailure, reference: DifferentialKinematics | None = None
) -> tuple[str, ...]:
    """Return the names that fit ``post``; none for an ordinary manipulator.

    With fewer degrees of freedom than the ``reference``, the mechanism without failures where it
    is known to be well (usually at home), it is over-constrained too.
    """
    present, failures = post.present, post.failures
    names = []
    if not present.stable:
        names.append(UNDER_CONSTRAINED)
    unlocked = present
    if failures.stuck:
        unlocked = differential_kinematics(
            post.rows, FailureSet(free=failures.free, lost=failures.lost)
        )
    barred = _freedom(present) < _freedom(unlocked)
    if reference is not None:
        barred = barred or _freedom(post.nominal) < _freedom(reference)
    if barred:
        names.append(OVER_CONSTRAINED)
    if int(present.active.sum()) > present.mobility:
        names.append(KINEMATICALLY_REDUNDANT)
    return tuple(names)


def redundancy(post: PostFailure) -> Redundancy:
    """Return how redundant the mechanism is in ``post``, and by which struts and drives."""
    mechanism, present, failures = post.mechanism, post.present, post.failures
    kinematic = int(present.active.sum()) - present.mobility
    task = present.mobility - len(mechanism.task.major)
    if kinematic <= 0 or not present.stable:
        return Redundancy(kinematic, task, (), ())
    struts = []
    for name in mechanism.strut_names:
        if name in failures.lost or not mechanism.actuators_of(name):
            continue
        further = failures.and_also(mechanism, Failure(FailureMode.HARD, name))
        without = differential_kinematics(post.rows, further)
        if without.stable and without.mobility == present.mobility:
            struts.append(name)
    drives = tuple(
        actuator.name
        for index, actuator in enumerate(mechanism.actuators)
        if present.active[index]
        and actuator.strut not in struts
        and torque_measure(present, [index]) > 0.0
    )
    return Redundancy(kinematic, task, tuple(struts), drives)


def _freedom(kinematics: DifferentialKinematics) -> int:
    """Return how many independent motions there are, driven or not."""
    return kinematics.mobility + int(kinematics.unactuated.shape[1])
