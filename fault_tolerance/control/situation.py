# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where the mechanism is and what its failures make of it: assessed, anticipated, judged."""

from __future__ import annotations

from collections.abc import Callable

from fault_tolerance.control.anticipation import REACH, Found, PostFailureTable, is_safe
from fault_tolerance.control.assessment import Assessment, Assessor, without_lost
from fault_tolerance.control.command import CommandLaw
from fault_tolerance.control.onset import FirstCommand, Onset
from fault_tolerance.control.plausibility import MisfitWatch
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.shortcut import Followed, Shortcut, Taken
from fault_tolerance.control.transition import Sent
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
    judged : Assessment or None
        The newest one whose verdict is known.
    assessed_by : str
        Whether the newest one was ``anticipated`` or ``derived`` when it was needed.
    outdated : bool
        Whether there is news that it does not take into account.
    """

    def __init__(self, mechanism: Mechanism, settings: Settings, law: CommandLaw) -> None:
        self._mechanism = mechanism
        self._law = law
        self._anticipates = settings.anticipate
        self._assessor = Assessor(
            mechanism, settings.tolerance_threshold, settings.misfit_limit
        )
        self._onset = Onset(mechanism, settings, law)
        self._table = PostFailureTable(mechanism, self._assessor, law, self._onset)
        self._first: tuple[FirstCommand, Found] | None = None
        self._misfit = MisfitWatch(settings.misfit_limit)
        self._shortcut = Shortcut(mechanism, settings, law, self._assessor.yielding)
        self._contradiction = ''
        self._assessment: Assessment | None = None
        self._taken: Taken | None = None
        self.judged: Assessment | None = None
        self.assessed_by = ''
        self.outdated = False

    @property
    def assessment(self) -> Assessment | None:
        """The newest one; None before there was any."""
        taken, self._taken = self._taken, None
        if taken is not None:
            self._adopt(taken.followed)
        return self._assessment

    def supplier(self) -> Callable[[], Assessment | None]:
        """Return what returns the newest one as it is now."""
        assessment = self.assessment
        return lambda: assessment

    def assess(self, values: FloatArray, failures: FailureSet) -> None:
        """Find out where the mechanism is at the joint values (N,), and what that comes to."""
        self._assessment = found = self._assessed(values, failures)
        self._contradiction = ''
        if found is not None and not self._assessor.unclosed:
            self._contradiction = self._misfit.objection(found.configuration)
        if found is not None and not self._may_be_judged_later(found):
            self.judged = found

    def judge(self) -> bool:
        """Work out the verdict if it has been waiting; return whether it had.

        Within `REACH` of a configuration where nothing about it was close, it stands.
        """
        taken, judged = self._taken, self.judged
        if taken is not None and judged is not None and judged.post.failures == taken.failures:
            # The shortcut has made sure of all else that `_may_be_judged_later` asks for.
            if not taken.failures or self._stands(judged, taken.actuator_values):
                return False
        now = self.assessment
        if now is judged:
            return False
        if now is not None and judged is not None and self._may_be_judged_later(now):
            if self._stands(judged, now.configuration.actuator_values):
                return False
        self.judged = now
        return True

    def _stands(self, judged: Assessment, values: FloatArray) -> bool:
        """Return whether a verdict also holds at other joint values (N,), for being near."""
        away = self._table.moved(judged.configuration.actuator_values, values)
        return away <= REACH and is_safe(judged)

    def shortcut(
        self, values: FloatArray, velocity: FloatArray, failures: FailureSet
    ) -> Taken | None:
        """Return the command for new joint values the short way, if it is open.

        What the assessment is, is worked out when it is asked for.
        """
        taken = self._shortcut.command(values, velocity, failures)
        if taken is not None:
            self._taken, self.assessed_by, self.outdated = taken, 'derived', False
        return taken

    def first_command(
        self,
        values: FloatArray,
        velocity: FloatArray,
        failures: FailureSet,
        sent: Sent,
        allowed: float,
    ) -> FirstCommand | None:
        """Return the first command with new failures the short way; None where it is not open.

        Parameters are those of `Onset.command`; see `catch_up`.
        """
        last = self.assessment
        if last is None or last.post.failures == failures or self.obstacle:
            return None
        found = self._anticipated(values, failures)
        if found is None or found.readied is None:
            return None
        read = without_lost(self._mechanism, values, failures)
        first = self._onset.command(found.readied, read, velocity, sent, allowed)
        if first is not None:
            self._first = first, found
        return first

    def catch_up(self) -> Followed | None:
        """Take over what a first command was made of; None if there was none since."""
        if self._first is None:
            return None
        (first, found), self._first = self._first, None
        followed = Followed(
            found.prospect, first.readied.inverse, first.limited(), None, found.exact,
            first.begun(),
        )
        self._adopt(followed)
        self.assessed_by, self.outdated = 'anticipated', not followed.exact
        return followed

    def _adopt(self, followed: Followed) -> None:
        """Go on from what came of a command that was made a short way."""
        self._assessor.adopt(followed.prospect)
        self._law.adopt(followed.inverse, followed.looseness)
        self._assessment = found = followed.prospect.assessment
        if found is not None and not self._may_be_judged_later(found):
            self.judged = found

    def prepare(self, *, moves: bool) -> None:
        """Work out what the next assessment will need, before it is needed.

        Parameters
        ----------
        moves : bool
            Whether the command just given moves, and all that it depends on lasts.
        """
        if not (moves and self._is_settled()):
            self._shortcut.forget()
        elif self._taken is not None:
            self._shortcut.go_on(self._taken)
            return
        elif self.assessment is not None:
            self._shortcut.prepare(self.assessment)
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
        found = self._anticipated(values, failures)
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

    def _anticipated(self, values: FloatArray, failures: FailureSet) -> Found | None:
        """Return what new failures come to, if that has been worked out."""
        last = self.assessment
        if last is None or last.post.failures == failures:
            return None
        return self._table.found(values, failures, last.post.nominal)

    def _is_settled(self) -> bool:
        """Return whether there is nothing against going on from the newest assessment."""
        if self.outdated or self.intolerance or not self._law.at_ease:
            return False
        # The shortcut is not taken where there is an obstacle.
        return self._taken is not None or not self.obstacle

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
