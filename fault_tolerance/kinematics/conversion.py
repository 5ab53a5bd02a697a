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
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet
from fault_tolerance.kinematics.measures import present_measures
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.verdict import Verdict
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import EQUAL_MEASURES

MOST_COMBINATIONS = 10_000
"""Combinations of actions judged at most; more would take longer than anybody waits."""


@dataclass(frozen=True)
class Conversion:
    """A set of failures that can be had by braking and releasing, and what it keeps."""

    actions: tuple[tuple[Failure, Failure], ...]
    """What is converted into what; empty for leaving everything as it is."""
    failures: FailureSet
    """The failures afterwards."""
    verdict: Verdict
    kept: float
    """p t h of all failures then present, 0 if they are not tolerable."""

    def __repr__(self) -> str:
        actions = ', '.join(f'{old} to {new}' for old, new in self.actions)
        return f'Conversion({actions or "nothing"}, kept {self.kept:.4g})'


@dataclass(frozen=True)
class Conversions:
    """What conversion can do: ``best`` against leaving everything ``as_it_is``."""

    as_it_is: Conversion
    best: Conversion
    options: tuple[Conversion, ...]
    """All that was considered, the best first."""

    def __repr__(self) -> str:
        return f'Conversions(best {self.best}, {len(self.options)} options)'


def best_conversion(rows: StrutRows, failures: FailureSet) -> Conversions:
    """Return what braking and releasing, as the mechanism allows it, can make of ``failures``.

    Every combination of the actions at hand is judged: brakes on free actuators that have one,
    release of struts that can be released and have a failed actuator.

    Parameters
    ----------
    rows : StrutRows
    failures : FailureSet

    Returns
    -------
    Conversions

    Raises
    ------
    FailureError
        If there are more than `MOST_COMBINATIONS`.
    """
    mechanism = rows.mechanism
    failures = failures.of(mechanism)
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
        after = FailureSet(lost=failures.lost).and_also(mechanism, *(new for _, new in choice))
        if after not in options:
            options[after] = _judged(rows, after, actions)
    # Rounding errors are no reason to act: among equals the fewest actions come first.
    ranked = sorted(
        options.values(),
        key=lambda option: (-round(option.kept, EQUAL_MEASURES), len(option.actions)),
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
    post = reconfigured(rows, failures)
    kept = 0.0
    if post.verdict.tolerable:
        measures = present_measures(post)
        kept = measures.position * measures.torque * measures.hard
    return Conversion(actions, failures, post.verdict, kept)
