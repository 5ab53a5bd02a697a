# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The kinematics to go on with after failures, and whether they will do."""

from __future__ import annotations

from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    weakest_constraint,
)
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.measures import PresentMeasures, present_measures
from fault_tolerance.kinematics.reconfiguration import (
    PostFailure,
    failures_in_words,
    reconfigured,
    weakest_motion,
)
from fault_tolerance.kinematics.rows import StrutRows

COMPLIANCE_BAND = 1.2
"""An absorbed constraint counts again only above this many times the compliance."""


class PostFailureModel:
    """Gives the kinematics with the present failures, always from the nominal rows.

    Structural constraints up to the mechanism's compliance are absorbed by the flexures
    (docs/theory.md, section 6). Where a scan crosses that threshold again and again, the verdict
    would change with every noisy reading. So a constraint that was absorbed stays so until it
    exceeds the compliance by `COMPLIANCE_BAND`.
    """

    def __init__(self) -> None:
        self._last: PostFailure | None = None

    def at(self, rows: StrutRows, failures: FailureSet) -> PostFailure:
        """Return the kinematics at ``rows`` with ``failures`` present, and go on from them."""
        post = self.foreseen(rows, failures)
        self.adopt(post)
        return post

    def foreseen(
        self,
        rows: StrutRows,
        failures: FailureSet,
        nominal: DifferentialKinematics | None = None,
    ) -> PostFailure:
        """Return what `at` would, and remember nothing of it.

        Parameters
        ----------
        rows : StrutRows
        failures : FailureSet
        nominal : DifferentialKinematics, optional
            Of the same rows, compliance included, where the caller has it already.
        """
        post = reconfigured(rows, failures, nominal)
        if self._is_undecided(post, rows.compliance):
            post = reconfigured(rows.with_compliance(COMPLIANCE_BAND * rows.compliance), failures)
        return post

    def adopt(self, post: PostFailure) -> None:
        """Go on from ``post``, as foreseen before."""
        self._last = post

    def _is_undecided(self, post: PostFailure, compliance: float) -> bool:
        """Return whether a freedom is gone by a constraint only just above the compliance."""
        limit, last = COMPLIANCE_BAND * compliance, self._last
        if last is None:
            return False
        if weakest_constraint(post.rows) <= limit and (
            _freedom(post.nominal) < _freedom(last.nominal)
        ):
            return True
        if post.failures != last.failures:
            return False
        return post.present.weakest_kept <= limit and (
            _freedom(post.present) < _freedom(last.present)
        )


def _freedom(kinematics: DifferentialKinematics) -> int:
    """Return the number of motions, controlled or not."""
    return kinematics.mobility + int(kinematics.unactuated.shape[1])


def intolerance(post: PostFailure, measures: PresentMeasures, threshold: float) -> str:
    """Return why the failures of ``post`` are not tolerated; empty if they are.

    They are tolerated when the platform is held, its major coordinates are all there, and no
    measure of theirs is below ``threshold``: nearly lost counts as lost. Around a configuration
    where a measure is 0 it grows in proportion to the way from there, so the threshold is also
    how far around a singularity all is judged as in it (docs/theory.md, section 8).
    """
    state = unit_free(post)
    if state is not post:
        measures = present_measures(state)
    found = {
        'position': measures.position,
        'torque': measures.torque,
        'hard': measures.hard,
    }
    name, value = min(found.items(), key=lambda item: item[1])
    if not post.verdict.tolerable:
        return f'{post.verdict.reason} ({name} measure {value:.3g})'
    if value >= threshold:
        return ''
    words = failures_in_words(post.failures)
    text = f'{words}: {name} measure {value:.3g} is below the tolerance threshold {threshold:.3g}'
    held = name != 'position'
    weakest = weakest_motion(state, held=held)
    if weakest:
        text += f'; hardly {"held" if held else "moved"}: {", ".join(weakest)}'
    return text


def unit_free(post: PostFailure) -> PostFailure:
    """Return ``post`` with turning drives taken at the characteristic length.

    The paper's measures compare radians with metres where a mechanism has drives of both kinds,
    and then depend on the units: too much for a decision.
    """
    scale = post.rows.rate_scale
    if (scale == scale[0]).all():
        return post
    return reconfigured(post.rows.in_metres(), post.failures)
