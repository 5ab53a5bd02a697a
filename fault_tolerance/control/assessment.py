# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where the mechanism is, what its failures leave of its kinematics, and what that is worth."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fault_tolerance.control.judgement import PostFailureModel, intolerance
from fault_tolerance.control.settings import Settings
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.many_measures import hard_measures, single_measures
from fault_tolerance.kinematics.measures import (
    NextFailure,
    PresentMeasures,
    next_failure_from,
    present_measures,
)
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.kinematics.rows import StrutRows, strut_rows
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
    def singles(self) -> tuple[FloatArray, FloatArray]:
        """The measures p and t of each further failure, (N,) each."""
        return single_measures(self.post.present)

    @cached_property
    def hard(self) -> FloatArray:
        """The measure h of each further strut lost, (s,)."""
        return hard_measures(self.post.rows, self.post.failures, self.post.present)

    @cached_property
    def following(self) -> NextFailure:
        """What each further failure would cost; slow, so not for the path of a command."""
        return next_failure_from(self.post, self.singles, self.hard)

    def work_out(self) -> Iterator[None]:
        """Work out the measures piece by piece; what fails will fail again when asked for."""
        for name in ('measures', 'singles', 'hard'):
            with suppress(Exception):
                getattr(self, name)
            yield

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


@dataclass(frozen=True, eq=False)
class Fit:
    """Joint values brought to a configuration.

    Attributes
    ----------
    key : tuple of bytes and tuple of str
        The joint values, and the struts that had been lost.
    rows : StrutRows or None
        At `configuration`.
    configuration : Configuration or None
        The one fitted, or the last before it whose loops closed; None if none ever did.
    unclosed : str
        Why it is not the one fitted; empty if it is.
    """

    key: tuple[bytes, tuple[str, ...]]
    configuration: Configuration | None
    rows: StrutRows | None
    unclosed: str = ''


@dataclass(frozen=True, eq=False)
class Prospect:
    """What an assessment would be, before anything is decided on it."""

    fit: Fit
    assessment: Assessment | None


class Assessor:
    """Assesses joint values and failures, each from the nominal rows at the present configuration.

    Parameters
    ----------
    mechanism : Mechanism
    threshold : float
        The tolerance threshold.
    misfit_limit : float
        Characteristic lengths by which readings may contradict each other before the loops are
        closed afresh, from home.

    Attributes
    ----------
    yielding : float
        What the flexures absorb while the loops are closed.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        threshold: float,
        misfit_limit: float = Settings.misfit_limit,
    ) -> None:
        self._mechanism = mechanism
        self._most_misfit = misfit_limit * mechanism.characteristic_length
        # While the loops are closed the flexures absorb a little more than the verdict grants:
        # otherwise the fit itself would tip over at the threshold that the verdict is about.
        compliance = min(FIT_BAND * mechanism.compliance, MOST_COMPLIANCE)
        self.yielding = max(compliance, mechanism.compliance)
        self._threshold = threshold
        self._model = PostFailureModel()
        self._fit = Fit((b'', ()), None, None)
        self._post: PostFailure | None = None

    @property
    def unclosed(self) -> str:
        """Why the newest joint values could not be assessed; empty if they were."""
        return self._fit.unclosed

    def assessed(self, values: FloatArray, failures: FailureSet) -> Assessment | None:
        """Return the assessment at the joint values (N,), or None if no loops ever closed."""
        prospect = self.foreseen(values, failures)
        self.adopt(prospect)
        return prospect.assessment

    def foreseen(self, values: FloatArray, failures: FailureSet) -> Prospect:
        """Return what `assessed` would, and remember nothing of it."""
        fit = self._fit
        if fit.key != (values.tobytes(), failures.lost):
            fit = self._fitted(values, failures)
        if fit.configuration is None or fit.rows is None:
            return Prospect(fit, None)
        # New failures are judged even then, where the loops last closed.
        last = self._post if fit is self._fit else None
        nominal = last.nominal if last is not None and last.rows is fit.rows else None
        post = self._model.foreseen(fit.rows, failures, nominal)
        return Prospect(fit, Assessment(fit.configuration, post, self._threshold))

    def adopt(self, prospect: Prospect) -> None:
        """Go on from ``prospect``, foreseen before."""
        self._fit = prospect.fit
        self._post = None
        if prospect.assessment is not None:
            self._post = prospect.assessment.post
            self._model.adopt(self._post)

    def prepare(self) -> None:
        """Work out what the way on from here will need, before it is needed."""
        configuration = self._fit.configuration
        if configuration is not None and not self._fit.unclosed:
            configuration.prepare()

    def _fitted(self, values: FloatArray, failures: FailureSet) -> Fit:
        read = without_lost(self._mechanism, values, failures)
        last = self._fit.configuration
        mechanism, yielding = self._mechanism, self.yielding
        found = fitted_configuration(mechanism, read, failures.lost, last, yielding)
        if last is not None and not self._agrees(found):
            # The last configuration may be a bad start, as after a long gap, or after readings
            # without sense: they may have left it upside down, where sound ones do not fit.
            afresh = fitted_configuration(mechanism, read, failures.lost, compliance=yielding)
            if not found.converged or (
                afresh.converged and afresh.largest_misfit < found.largest_misfit
            ):
                found = afresh
        key = values.tobytes(), failures.lost
        if not found.converged:
            reason = 'the loops do not close at these joint values'
            return Fit(key, last, self._fit.rows, reason)
        return Fit(key, found, strut_rows(found))

    def _agrees(self, found: Configuration) -> bool:
        """Return whether the loops are closed, and the joint values with them."""
        return found.converged and found.largest_misfit <= self._most_misfit


def without_lost(mechanism: Mechanism, values: FloatArray, failures: FailureSet) -> FloatArray:
    """Return the joint values (N,) with NaN in lost struts, whatever their encoders say."""
    if not failures.lost:
        return values
    lost = [bool(one.strut) and one.strut in failures.lost for one in mechanism.actuators]
    return np.where(lost, np.nan, values)
