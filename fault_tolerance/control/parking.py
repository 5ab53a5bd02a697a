# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The park move: to where a platform may stand that is still held and cannot do its task.

After such a failure the platform stands where it was. If the mechanism file says where it may
stand (`park`), what is left of it goes there, slowly, and as far as that goes. The state remains
stopped.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from fault_tolerance.control.estimate import ControlModel, Estimate
from fault_tolerance.control.resolved_rate import RateCommand, rate_command
from fault_tolerance.kernel import model as at
from fault_tolerance.kernel.model import Law
from fault_tolerance.kernel.packing import packed_model
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.screws import difference
from fault_tolerance.mechanism.targets import pose_target
from fault_tolerance.mechanism.task import COORDINATES, Task

DELAY = 1.0
"""Seconds from the stop to the move. By then the mechanism is at rest, and what fails by the same
cause has been reported."""

GAIN = 2.0
"""1/s: speed per distance left."""

SPEED = 0.1
"""The share of the drives' speed that is used; the platform's limit, characteristic lengths/s."""

NEAR = 2e-4
"""Characteristic lengths; nearer to the goal is at the goal."""

HELD = 0.1
"""How well the drives have to hold the platform, relative to home (docs/theory.md, section 8): it
does not go near a singularity where they no longer do."""

STILL = 0.2
"""Seconds without motion after which it does not get any nearer."""

LONGEST = 60.0
"""Seconds after which the move ends in any case."""


class Parking:
    """Makes one park move a stop, if it may.

    It may while the drives hold the platform and nothing but the failures keeps it from its task.
    Whatever else happens ends the move, for as long as the stop lasts.

    Parameters
    ----------
    mechanism : Mechanism

    Attributes
    ----------
    text : str
        What there is to say of it: parking, parked, or what could not be reached.
    used : bool
        Whether it has to be made ready for the next stop.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._failures: FailureSet | None = None
        self._due = inf
        self._move: ParkMove | None = None
        self.reset()

    def reset(self) -> None:
        """Be ready for the next stop: there is none now."""
        self._failures = self._move = None
        self._over, self.text, self.used = not self._mechanism.park, '', False

    def end(self) -> None:
        """End the move, for as long as the stop lasts."""
        if self._move is not None:
            self.text, self._move = 'park move broken off', None
        self._over = self.used = True

    def command(
        self, estimate: Estimate | None, before: RateCommand, now: float
    ) -> RateCommand | None:
        """Return the command of a park move in a cycle of a stop; None for rest.

        Parameters
        ----------
        estimate : Estimate or None
            The present one; None if anything else than its failures keeps it from moving.
        before : RateCommand
            The last command.
        now : float
            Seconds.

        Returns
        -------
        RateCommand or None
        """
        if self._over:
            return None
        self.used = True
        if estimate is None or not _is_held(estimate):
            self.end()
            return None
        if estimate.failures is not self._failures:
            if self._move is not None:
                self.end()
                return None
            self._due, self._failures = now + DELAY, estimate.failures
        if now < self._due:
            return None
        if self._move is None:
            self._move, self.text = ParkMove(self._mechanism, estimate.model, now), 'parking'
        found = self._move.command(estimate, before, now)
        if found is None:
            self.text, self._move, self._over = self._move.outcome(estimate), None, True
        return found


class ParkMove:
    """A move to the park pose of ``mechanism`` that begins ``now`` (s), as ``model`` says.

    It follows the control law with slow drives and the coordinates of the park pose as the major
    task, but does not end where one of them is lost.
    """

    def __init__(self, mechanism: Mechanism, model: ControlModel, now: float) -> None:
        self._target = pose_target(mechanism, mechanism.park)
        self._given = list(self._target.given)
        self._began = self._moved = now
        self._length = mechanism.characteristic_length
        drives = [replace(one, velocity=SPEED * one.velocity) for one in mechanism.actuators]
        task = Task(mechanism.task.coordinates, tuple(mechanism.park))
        slow = replace(mechanism.with_actuators(drives), task=task)
        settings, law = model.settings, Law()
        law = law._replace(
            stroke_gain=settings.stroke_gain, max_acceleration=settings.max_acceleration,
            slow_below=0.0, hold_below=-1.0, singular_below=law.poor_below,
        )
        self._model = ControlModel(slow, settings, model.kernel, packed_model(slow, law))

    def command(self, estimate: Estimate, before: RateCommand, now: float) -> RateCommand | None:
        """Return the command ``now`` (s) at an ``estimate``, after the one ``before``.

        None where the move is over.
        """
        missing, scale = self._missing(estimate), self._target.scale
        if not _far(missing, self._length) or now > self._began + LONGEST:
            return None
        twist = GAIN * missing / scale
        twist *= min(1.0, SPEED * self._length / float(np.linalg.norm(scale * twist)))
        model = self._model.with_kernel(estimate.model.kernel)
        asked = twist[model.mechanism.task.rows]
        found = rate_command(model, estimate, asked, before, now)
        if HELD * float(found.numbers[at.GAIN]) > estimate.model.view.law.home_gain:
            return None
        gained = np.linalg.norm((scale * found.twist)[self._given])
        fast = np.abs(found.rates) > 0.5 * model.mechanism.velocity_limits
        if gained > GAIN * NEAR * self._length or fast.any():
            self._moved = now
        return found if now <= self._moved + STILL else None

    def outcome(self, estimate: Estimate) -> str:
        """Return where it has ended, at an ``estimate``, in words."""
        missing, scale = self._missing(estimate), self._target.scale
        off = [
            f'{COORDINATES[row]} by {missing[row] / scale[row]:.2g} {"rad" if row < 3 else "m"}'
            for row in self._given if _far(missing[row], self._length)
        ]
        return f'parked as far as it goes, off in {", ".join(off)}' if off else 'parked'

    def _missing(self, estimate: Estimate) -> FloatArray:
        """Return the way left to the park pose (6,), metres; 0 in coordinates it does not have."""
        target, missing = self._target, np.zeros(6)
        way = target.scale * (target.values - difference(estimate.pose, target.home))
        missing[self._given] = way[self._given]
        return missing


def _far(missing: FloatArray, length: float) -> bool:
    return bool(np.abs(missing).max() > NEAR * length)


def _is_held(estimate: Estimate) -> bool:
    """Return whether the drives hold the platform as well as they have to, whatever its task."""
    facts, settings = estimate.numbers, estimate.model.settings
    held = min(facts[at.TORQUE], facts[at.HARD]) >= settings.tolerance_threshold
    return bool(settings.recovery and facts[at.DRIFTING] == 0 and held)
