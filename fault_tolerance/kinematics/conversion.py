# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Turning one failure into a milder one: a brake makes free into stuck, a release stuck into lost.

A stuck joint takes degrees of freedom away, a free one gives a motion away, a lost strut does
neither if the others hold the platform. Which is best depends on the redundancy at hand (paper,
section III-F).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import prod

from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet, failure_set
from fault_tolerance.kinematics.measures import present_measures
from fault_tolerance.kinematics.reconfiguration import Verdict, reconfigured
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.description import Mechanism

MOST_COMBINATIONS = 10_000
"""Combinations of actions judged at most; more would take longer than anybody waits."""


@dataclass(frozen=True)
class Conversion:
    """A set of failures that can be had by braking and releasing, and what it keeps.

    Attributes
    ----------
    actions : tuple of (Failure, Failure)
        What is converted into what; empty for leaving everything as it is.
    failures : FailureSet
        The failures afterwards.
    verdict : Verdict
    kept : float
        p t h of all failures then present, 0 if they are not tolerable.
    """

    actions: tuple[tuple[Failure, Failure], ...]
    failures: FailureSet
    verdict: Verdict
    kept: float


@dataclass(frozen=True)
class Conversions:
    """What conversion can do: ``best`` against leaving everything ``as_it_is``.

    Attributes
    ----------
    as_it_is, best : Conversion
    options : tuple of Conversion
        All that was considered, the best first.
    """

    as_it_is: Conversion
    best: Conversion
    options: tuple[Conversion, ...]


def convert(
    mechanism: Mechanism, failures: FailureSet, name: str, mode: FailureMode
) -> FailureSet:
    """Return ``failures`` with the one of ``name`` turned into ``mode``.

    Parameters
    ----------
    mechanism : Mechanism
    failures : FailureSet
    name : str
        An actuator with a failure.
    mode : FailureMode
        `POSITION` (by a brake) or `HARD` (by releasing its strut).

    Raises
    ------
    FailureError
        If no brake or release makes that of its failure. Whether the part has one is not asked
        here: the description of the mechanism says, and `best_conversion` keeps to it.
    """
    if name not in mechanism.actuator_names:
        raise FailureError(name, 'not an actuator', mechanism.actuator_names)
    present = failures.mode_of(mechanism, name)
    if mode is FailureMode.POSITION and present is not FailureMode.TORQUE:
        raise FailureError(name, 'a brake holds a free actuator, and this one is not')
    if mode is FailureMode.HARD and present is FailureMode.NONE:
        raise FailureError(name, 'has not failed')
    if mode not in (FailureMode.POSITION, FailureMode.HARD):
        raise FailureError(mode.value, 'no action makes a failure of this kind')
    others = [
        (failure.mode, failure.name) for failure in failures.failures if failure.name != name
    ]
    return failure_set(mechanism, [*others, (mode, name)])


def best_conversion(rows: StrutRows, failures: FailureSet) -> Conversions:
    """Return what braking and releasing, as the mechanism allows it, can make of ``failures``.

    Every combination of the actions at hand is judged: brakes on free actuators that have one,
    release of struts that can be released and have a failed actuator.

    Raises
    ------
    FailureError
        If there are more than `MOST_COMBINATIONS`.
    """
    mechanism = rows.mechanism
    alternatives = [
        _alternatives(mechanism, failure)
        for failure in failures.failures
        if failure.mode is not FailureMode.HARD
    ]
    combinations = prod(len(choices) for choices in alternatives)
    if combinations > MOST_COMBINATIONS:
        reason = f'more than {MOST_COMBINATIONS} combinations of conversions'
        raise FailureError(str(combinations), reason)
    as_it_is = _judged(rows, failures, ())
    options = {failures: as_it_is}
    for choice in product(*alternatives):
        actions = tuple((old, new) for old, new in choice if old != new)
        lost = [(FailureMode.HARD, name) for name in failures.lost]
        after = failure_set(mechanism, [(new.mode, new.name) for _, new in choice] + lost)
        if after not in options:
            options[after] = _judged(rows, after, actions)
    ranked = sorted(
        # Rounding error is no reason to act.
        options.values(), key=lambda option: (-round(option.kept, 9), len(option.actions))
    )
    return Conversions(as_it_is, ranked[0], tuple(ranked))


def _alternatives(mechanism: Mechanism, failure: Failure) -> list[tuple[Failure, Failure]]:
    """Return what ``failure`` of an actuator can be, itself first."""
    choices = [failure]
    actuator = mechanism.actuators[mechanism.actuator_index(failure.name)]
    if failure.mode is FailureMode.TORQUE and actuator.brake:
        choices.append(Failure(FailureMode.POSITION, failure.name))
    releasable = [strut.name for strut in mechanism.struts if strut.release]
    if actuator.strut in releasable:
        choices.append(Failure(FailureMode.HARD, actuator.strut))
    return [(failure, choice) for choice in choices]


def _judged(
    rows: StrutRows, failures: FailureSet, actions: tuple[tuple[Failure, Failure], ...]
) -> Conversion:
    state = reconfigured(rows, failures)
    kept = 0.0
    if state.verdict.tolerable:
        measures = present_measures(state)
        kept = measures.position * measures.torque * measures.hard
    return Conversion(actions, failures, state.verdict, kept)
