# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where the mechanism is and what its failures make of it: assessed, anticipated, judged."""

from __future__ import annotations

from fault_tolerance.control.anticipation import PostFailureTable
from fault_tolerance.control.assessment import Assessment, Assessor
from fault_tolerance.control.command import CommandLaw
from fault_tolerance.control.plausibility import MisfitWatch
from fault_tolerance.control.settings import Settings
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism


class Situation:
    """The newest assessment, and the newest verdict.

    They may be of two configurations, one after the other: with failures present, the verdict
    waits until the command is out where it can.

    Parameters
    ----------
    mechanism : Mechanism
    settings : Settings
    law : CommandLaw

    Attributes
    ----------
    assessment : Assessment or None
        The newest one; None before there was any.
    judged : Assessment or None
        The newest one whose verdict is known.
    assessed_by : str
        Whether the newest one was ``anticipated`` or ``derived`` when it was needed.
    outdated : bool
        Whether there is news that it does not take into account.
    """

    def __init__(self, mechanism: Mechanism, settings: Settings, law: CommandLaw) -> None:
        self._law = law
        self._anticipates = settings.anticipate
        self._assessor = Assessor(
            mechanism, settings.tolerance_threshold, settings.misfit_limit
        )
        self._table = PostFailureTable(mechanism, self._assessor, law)
        self._misfit = MisfitWatch(settings.misfit_limit)
        self._contradiction = ''
        self.assessment: Assessment | None = None
        self.judged: Assessment | None = None
        self.assessed_by = ''
        self.outdated = False

    def assess(self, values: FloatArray, failures: FailureSet) -> None:
        """Find out where the mechanism is at the joint values (N,), and what that comes to."""
        self.assessment = found = self._assessed(values, failures)
        self._contradiction = ''
        if found is not None and not self._assessor.unclosed:
            self._contradiction = self._misfit.objection(found.configuration)
        if found is not None and not self._may_be_judged_later(found):
            self.judged = found

    def judge(self) -> bool:
        """Work out the verdict if it has been waiting; return whether it had."""
        if self.assessment is self.judged:
            return False
        self.judged = self.assessment
        return True

    def prepare(self) -> None:
        """Work out what the next assessment will need, before it is needed."""
        self._assessor.prepare()

    def anticipate(self, values: FloatArray, failures: FailureSet) -> bool:
        """Work out what one further failure would come to; return whether there was any to do."""
        ready = self.assessment is not None and not (self.outdated or self._assessor.unclosed)
        return ready and self._anticipates and self._table.refresh_next(values, failures)

    @property
    def intolerance(self) -> str:
        """Why the failures are not tolerated; empty if they are, or there are none."""
        return self.judged.intolerance if self.judged else ''

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        return self.judged.post.verdict.reason if self.judged else ''

    @property
    def obstacle(self) -> str:
        """Why the mechanism must not move here though nothing is wrong with it for good."""
        if self._assessor.unclosed:
            return self._assessor.unclosed
        if self._contradiction:
            return self._contradiction
        return self.assessment.singularity if self.assessment else ''

    def _assessed(self, values: FloatArray, failures: FailureSet) -> Assessment | None:
        """Return the assessment; what a new failure comes to may have been worked out already."""
        last = self.assessment
        if last is not None and last.post.failures != failures:
            found = self._table.found(values, failures, last.post.nominal.mobility)
            if found is not None:
                self._assessor.adopt(found.prospect)
                if found.inverse is not None:
                    self._law.adopt(found.inverse)
                self.assessed_by = 'anticipated'
                # From a little way off it does for one command.
                self.outdated = not found.exact
                return found.assessment
        assessment = self._assessor.assessed(values, failures)
        self.assessed_by = 'derived'
        self.outdated = False
        return assessment

    def _may_be_judged_later(self, found: Assessment) -> bool:
        """Return whether the verdict can wait until the command is out.

        It can where the same failures were tolerated at the configuration before, and nothing
        drifts: what the command must not come near is looked at anyway (`CommandLaw.obstacle`).
        New failures are judged at once.
        """
        judged = self.judged
        return (
            judged is not None
            and bool(found.post.failures)
            and judged.post.failures == found.post.failures
            and not judged.intolerance
            and found.post.present.stable
            and found.post.present.mobility == judged.post.present.mobility
        )
