# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where the mechanism is, what its failures leave of its kinematics, and what that is worth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fault_tolerance.control.judgement import PostFailureModel, intolerance
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.measures import (
    NextFailure,
    PresentMeasures,
    next_failure,
    present_measures,
)
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import Configuration, fitted_configuration
from fault_tolerance.mechanism.description import Mechanism

FIT_BAND = 1.5
"""Constraints up to this many times the compliance are not enforced while loops are closed."""

MOST_COMPLIANCE = 0.99
"""Singular values of constraints do not reach 1 where they matter."""


@dataclass(frozen=True)
class Assessment:
    """One configuration, judged with the failures present.

    Attributes
    ----------
    configuration : Configuration
        The last one whose loops close.
    post : PostFailure
        Kinematics and verdict there.
    threshold : float
        The tolerance threshold.
    """

    configuration: Configuration
    post: PostFailure
    threshold: float

    @cached_property
    def measures(self) -> PresentMeasures:
        """What the failures present have cost."""
        return present_measures(self.post)

    @cached_property
    def following(self) -> NextFailure:
        """What each further failure would cost; slow, so not for the path of a command."""
        return next_failure(self.post)

    @cached_property
    def intolerance(self) -> str:
        """Why the failures present are not tolerated; empty if they are, or there are none."""
        if not self.post.failures:
            return ''
        return intolerance(self.post, self.measures, self.threshold)

    @cached_property
    def singularity(self) -> str:
        """Why the mechanism cannot do its task here though nothing has failed."""
        if self.post.failures or self.post.verdict.tolerable:
            return ''
        return f'singular configuration: {self.post.verdict.reason}'


class Assessor:
    """Assesses joint values and failures, each from the nominal rows at the present configuration.

    Parameters
    ----------
    mechanism : Mechanism
    threshold : float
        The tolerance threshold.
    """

    def __init__(self, mechanism: Mechanism, threshold: float) -> None:
        self._mechanism = mechanism
        # While the loops are closed the flexures absorb a little more than the verdict grants:
        # otherwise the fit itself would tip over at the threshold that the verdict is about.
        compliance = min(FIT_BAND * mechanism.compliance, MOST_COMPLIANCE)
        self._yielding = replace(mechanism, compliance=max(compliance, mechanism.compliance))
        self._threshold = threshold
        self._model = PostFailureModel()
        self._last: Configuration | None = None
        self._unclosed = ''

    @property
    def unclosed(self) -> str:
        """Why the newest joint values could not be assessed; empty if they were."""
        return self._unclosed

    def assessed(self, values: FloatArray, failures: FailureSet) -> Assessment | None:
        """Return the assessment at the joint values (N,), or None if no loops ever closed."""
        configuration = self._fitted(without_lost(self._mechanism, values, failures), failures)
        self._unclosed = ''
        if configuration.converged:
            self._last = configuration
        else:
            self._unclosed = 'the loops do not close at these joint values'
        if self._last is None:
            return None
        # New failures are judged even then, where the loops last closed.
        post = self._model.at(strut_rows(self._last), failures)
        return Assessment(self._last, post, self._threshold)

    def _fitted(self, values: FloatArray, failures: FailureSet) -> Configuration:
        found = fitted_configuration(self._yielding, values, failures.lost, self._last)
        if not found.converged and self._last is not None:
            # The last configuration may be a bad start, as after a long gap.
            found = fitted_configuration(self._yielding, values, failures.lost)
        return replace(found, mechanism=self._mechanism)


def without_lost(mechanism: Mechanism, values: FloatArray, failures: FailureSet) -> FloatArray:
    """Return the joint values (N,) with NaN in lost struts, whatever their encoders say."""
    if not failures.lost:
        return values
    lost = [bool(one.strut) and one.strut in failures.lost for one in mechanism.actuators]
    return np.where(lost, np.nan, values)
