# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The table of post-failure kinematics: what every next single failure would come to.

It is filled while there is nothing else to do, entry by entry, always from the nominal rows and
the whole set of failures, and follows the mechanism as it moves. When a failure is reported, its
entry takes the place of what would have to be computed then.

At the joint values it was made for, an entry is what the live path would give. Where the
mechanism has moved on, but no farther than `REACH`, it still serves for the first command, if
nothing about its verdict is close; the next step derives everything anew. Everything else, a stop
above all, is left to the live path: the table never stops what the live path would not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fault_tolerance.control.assessment import Assessment, Assessor, Prospect
from fault_tolerance.control.command import CommandLaw
from fault_tolerance.control.onset import Onset, Readied
from fault_tolerance.control.resolved_rate import TaskInverse
from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

REACH = 1e-3
"""Characteristic lengths (radians) any actuator may have moved since an entry was made."""

RENEWAL = 0.25
"""Share of `REACH` after which an entry is made anew."""

SAFE_MEASURE = 0.05
"""How far above the tolerance threshold all measures of the failures must be, for an entry to
serve a little way off."""

CAPACITY = 256
"""Mechanisms with more single failures than this have no table: it would be old all the time."""


@dataclass(frozen=True, eq=False)
class Entry:
    """What one set of failures would come to.

    Attributes
    ----------
    values : (N,) array
        The joint values it was made for.
    prospect : Prospect or None
        None where it could not be worked out: that is left to the live path too.
    inverse : TaskInverse or None
        What resolves task velocities then; None where it must not move.
    readied : Readied or None
        What the first command can be made of the shortest way.
    """

    values: FloatArray
    prospect: Prospect | None
    inverse: TaskInverse | None
    readied: Readied | None = None


class Found(NamedTuple):
    """What the table has for a set of failures.

    Attributes
    ----------
    prospect : Prospect
    assessment : Assessment
        The prospect's.
    inverse : TaskInverse or None
    readied : Readied or None
        See `Entry`.
    exact : bool
        Whether it was made for the present joint values.
    """

    prospect: Prospect
    assessment: Assessment
    inverse: TaskInverse | None
    readied: Readied | None
    exact: bool


class PostFailureTable:
    """Holds the post-failure kinematics of every failure that may come next.

    Parameters
    ----------
    mechanism : Mechanism
    assessor : Assessor
        The one whose work is done in advance.
    law : CommandLaw
    onset : Onset
    """

    def __init__(
        self, mechanism: Mechanism, assessor: Assessor, law: CommandLaw, onset: Onset
    ) -> None:
        self._mechanism = mechanism
        self._assessor = assessor
        self._law = law
        self._onset = onset
        turning = np.array([one.kind == 'revolute' for one in mechanism.actuators])
        self._units = np.where(turning, 1.0, mechanism.characteristic_length)
        self._failures: FailureSet | None = None
        self._sets: tuple[FailureSet, ...] = ()
        self._entries: dict[FailureSet, Entry] = {}
        self._next = 0

    def __len__(self) -> int:
        """Return how many entries there are."""
        return len(self._entries)

    def refresh_next(self, values: FloatArray, failures: FailureSet) -> bool:
        """Make, or make anew, one entry for a failure beyond the present ``failures``.

        Parameters
        ----------
        values : (N,) array
            The present joint values; they are kept, so they must not be written to.
        failures : FailureSet

        Returns
        -------
        bool
            Whether there was one to make: False when all of them are there and fresh.
        """
        if failures != self._failures:
            self._failures = failures
            self._sets = tuple(further_sets(self._mechanism, failures))
            self._entries.clear()
            self._next = 0
        for _ in range(len(self._sets)):
            place, self._next = self._next, (self._next + 1) % len(self._sets)
            entry = self._entries.get(self._sets[place])
            if entry is None or self.moved(entry.values, values) > RENEWAL * REACH:
                self._entries[self._sets[place]] = self._entry(values, self._sets[place])
                return True
        return False

    def found(
        self, values: FloatArray, failures: FailureSet, nominal: DifferentialKinematics
    ) -> Found | None:
        """Return the entry for ``failures`` if it may be used at the joint values (N,).

        Parameters
        ----------
        values : (N,) array
        failures : FailureSet
            All that are present now.
        nominal : DifferentialKinematics
            Those at the last assessment.
        """
        entry = self._entries.get(failures)
        prospect = entry.prospect if entry else None
        if entry is None or prospect is None or prospect.assessment is None:
            return None
        assessment = prospect.assessment
        exact = entry.values.tobytes() == values.tobytes()
        if exact or (
            self.moved(entry.values, values) <= REACH
            and assessment.post.nominal.mobility == nominal.mobility
            and is_safe(assessment)
        ):
            return Found(prospect, assessment, entry.inverse, entry.readied, exact)
        return None

    def _entry(self, values: FloatArray, failures: FailureSet) -> Entry:
        try:
            prospect = self._assessor.foreseen(values, failures)
            assessment, inverse = prospect.assessment, None
            if prospect.fit.unclosed:
                return Entry(values, None, None)
            # Why not, if not, is worked out here: it is there when it is asked for.
            if assessment is not None and not assessment.intolerance:
                inverse = self._law.foreseen(assessment.post.present)
        except (ArithmeticError, ValueError):  # no convergence, numbers that are not finite
            return Entry(values, None, None)
        if assessment is None or inverse is None:
            return Entry(values, prospect, None)
        return Entry(values, prospect, inverse, self._onset.readied(assessment, inverse))

    def moved(self, before: FloatArray, values: FloatArray) -> float:
        """Return how far any actuator has moved, in characteristic lengths or radians.

        Parameters
        ----------
        before, values : (N,) array
            Joint values.
        """
        away = np.abs(values - before) / self._units
        # Only actuators of lost struts may be without a value, and those hold nothing.
        return float(np.fmax(away, 0.0).max())


def further_sets(mechanism: Mechanism, failures: FailureSet) -> Iterator[FailureSet]:
    """Yield each set of failures that one more single failure makes of ``failures``."""
    actuators, struts = mechanism.actuator_names, mechanism.strut_names
    if 2 * len(actuators) + len(struts) > CAPACITY:
        return
    singles = [
        *(Failure(FailureMode.POSITION, name) for name in actuators),
        *(Failure(FailureMode.TORQUE, name) for name in actuators),
        *(Failure(FailureMode.HARD, name) for name in struts),
    ]
    seen = {failures}
    for failure in singles:
        further = failures.and_also(mechanism, failure)
        if further not in seen:
            seen.add(further)
            yield further


def is_safe(assessment: Assessment) -> bool:
    """Return whether a little motion cannot change the verdict."""
    measures = assessment.measures
    return not assessment.intolerance and assessment.threshold + SAFE_MEASURE <= min(
        measures.position, measures.torque, measures.hard
    )
