# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What is left after failures: the kinematics to go on with, and their verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from fault_tolerance.errors import ClosureError, FaultToleranceError
from fault_tolerance.kinematics.actuator_measures import ActuatorMeasures, pair_measures
from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    differential_kinematics,
)
from fault_tolerance.kinematics.failures import FailureLike, FailureSet, failure_set
from fault_tolerance.kinematics.measures import (
    NextFailure,
    PresentMeasures,
    next_failure,
    present_measures,
)
from fault_tolerance.kinematics.rows import StrutRows, strut_rows
from fault_tolerance.kinematics.verdict import Verdict, failures_in_words, verdict_of
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import (
    Configuration,
    posed_configuration,
    solved_configuration,
)
from fault_tolerance.mechanism.description import Mechanism


@dataclass(frozen=True, eq=False)
class PostFailure:
    """The kinematics at one configuration with failures, and what follows when it is asked for.

    Attributes
    ----------
    rows : StrutRows
    failures : FailureSet
    present : DifferentialKinematics
        With the failures.
    known_nominal : DifferentialKinematics or None
        Without them, where it has been derived already.
    """

    rows: StrutRows
    failures: FailureSet
    present: DifferentialKinematics
    known_nominal: DifferentialKinematics | None = None

    def __repr__(self) -> str:
        return f'PostFailure({self.mechanism.name!r}, {failures_in_words(self.failures)})'

    @cached_property
    def nominal(self) -> DifferentialKinematics:
        """The kinematics without failures."""
        if not self.failures:
            return self.present
        return self.known_nominal or differential_kinematics(self.rows)

    @cached_property
    def verdict(self) -> Verdict:
        """Whether the mechanism can do its task in this state, and why (not)."""
        return verdict_of(self.rows, self.failures, self.nominal, self.present)

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that has the failures."""
        return self.rows.mechanism

    @property
    def configuration(self) -> Configuration:
        """Where it is: the pose, and the values of joints and actuators."""
        return self.rows.configuration

    @property
    def jacobian(self) -> FloatArray:
        """J (l, n) with the failures: task velocity per reduced rate."""
        return self.present.jacobian

    @property
    def mapping(self) -> FloatArray:
        """T (N, n) with the failures: actuator rates per reduced rate."""
        return self.present.mapping

    @cached_property
    def measures(self) -> PresentMeasures:
        """What the failures have cost: `present_measures`."""
        return present_measures(self)

    @cached_property
    def next_failure(self) -> NextFailure:
        """What each single further failure would leave: `next_failure`."""
        return next_failure(self)

    @cached_property
    def pair_measures(self) -> ActuatorMeasures:
        """What each pair of further failures would leave: `pair_measures` of `present`."""
        return pair_measures(self.present)

    def in_metres(self) -> PostFailure:
        """Return the same state for rates and twists in metres per second."""
        return reconfigured(self.rows.in_metres(), self.failures)


def reconfigured(
    rows: StrutRows,
    failures: FailureSet | None = None,
    nominal: DifferentialKinematics | None = None,
) -> PostFailure:
    """Return the kinematics with ``failures`` present, from the nominal rows.

    Parameters
    ----------
    rows : StrutRows
        Of the complete mechanism at the present configuration.
    failures : FailureSet, optional
        All failures present, however and in whatever order they came.
    nominal : DifferentialKinematics, optional
        Of the same rows without failures, where the caller has it already.

    Returns
    -------
    PostFailure

    Raises
    ------
    FailureError
        If ``failures`` name what the mechanism does not have.
    """
    failures = (failures or FailureSet()).of(rows.mechanism)
    present = None if failures else nominal
    return PostFailure(
        rows, failures, present or differential_kinematics(rows, failures), nominal
    )


def after(
    mechanism: Mechanism,
    failures: FailureSet | Iterable[FailureLike] = (),
    *,
    at: Mapping[str, float] | None = None,
    pose: Mapping[str, float] | None = None,
) -> PostFailure:
    """Return what ``failures`` leave of ``mechanism``: at home, or where ``at`` or ``pose`` say.

    Parameters
    ----------
    mechanism : Mechanism
    failures : FailureSet, or iterable of (mode, name), 'mode:name' or Failure
        All failures present: the mode as in `failure_set`, the name of an actuator or a strut.
    at : mapping of str to float, optional
        Actuator values in radians or metres from home, see `solved_configuration`.
    pose : mapping of str to float, optional
        Task coordinates in radians or metres from home, see `posed_configuration`. Not together
        with ``at``.

    Returns
    -------
    PostFailure

    Raises
    ------
    FailureError
        For an unknown mode or name.
    MechanismError
        For an unknown actuator or coordinate.
    ClosureError
        If the mechanism cannot be there.
    FaultToleranceError
        If both ``at`` and ``pose`` are given.
    """
    if not isinstance(failures, FailureSet):
        failures = failure_set(mechanism, failures)
    if at is not None and pose is not None:
        raise FaultToleranceError('give either at (actuator values) or pose, not both')
    solved = solved_configuration if pose is None else posed_configuration
    given = (at if pose is None else pose) or {}
    try:
        configuration = solved(mechanism, given)
    except ClosureError:
        # Without a lost strut the others may go where it does not reach.
        lost = failures.of(mechanism).lost
        if not lost:
            raise
        configuration = solved(mechanism, given, lost)
    return reconfigured(strut_rows(configuration), failures)
