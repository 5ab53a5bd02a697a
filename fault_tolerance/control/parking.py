# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Move to the park pose after an intolerable failure, if the drives still hold the platform.

The park pose is that of the mechanism file (`park`). The remaining drives move there slowly, and
as far as they can. The state remains stopped.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from fault_tolerance.control.control_model import ControlModel, law_of
from fault_tolerance.control.estimate import Estimate
from fault_tolerance.control.rate_command import RateCommand, rate_command
from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.packing import packed_model
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.screws import difference
from fault_tolerance.mechanism.targets import pose_target
from fault_tolerance.mechanism.task import COORDINATES, Task
from fault_tolerance.tolerances import POOR_BELOW

DELAY = 1.0
"""Seconds from the stop to the move. By then the mechanism is at rest, and further failures by the
same cause have been reported."""

GAIN = 2.0
"""1/s: speed per distance left."""

SPEED = 0.1
"""The share of the drives' speed that is used; the platform's limit, characteristic lengths/s."""

GOAL = 2e-4
"""Characteristic lengths; nearer to the park pose is at the park pose."""

LEAST_HOLD = 0.1
"""How well the drives have to hold the platform, relative to home (docs/theory.md, section 8): the
move ends before a singularity where they no longer do."""

STANDSTILL = 0.2
"""Seconds without motion after which the move ends: it does not get any nearer."""

LONGEST_MOVE = 60.0
"""Seconds after which the move ends in any case."""


class Parking:
    """Makes at most one park move of ``mechanism`` per stop.

    The move is allowed while the drives hold the platform and nothing but the failures prevents
    the task. Anything else ends it, for as long as the stop lasts.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._failures: FailureSet | None = None
        self._starts_at = inf
        self._move: ParkMove | None = None
        self.text = ''
        """The outcome so far: parking, parked, or what could not be reached."""
        self.needs_reset = False
        """Whether `reset` is due, once the stop is over."""
        self.reset()

    def reset(self) -> None:
        """Get ready for the next stop: there is none now."""
        self._failures = self._move = None
        self._over, self.text, self.needs_reset = not self._mechanism.park, '', False

    def end(self) -> None:
        """End the move, for as long as the stop lasts."""
        if self._move is not None:
            self.text, self._move = 'park move broken off', None
        self._over = self.needs_reset = True

    def command(
        self, estimate: Estimate | None, last: RateCommand, now: float
    ) -> RateCommand | None:
        """Return the command of a park move ``now`` (s), in a step of a stop; None for rest.

        ``estimate`` is the present one; None if anything else than its failures keeps the
        mechanism from moving. ``last`` is the last command.
        """
        if self._over:
            return None
        self.needs_reset = True
        if estimate is None or not _is_held(estimate):
            self.end()
            return None
        if estimate.failures is not self._failures:
            if self._move is not None:
                self.end()
                return None
            self._starts_at, self._failures = now + DELAY, estimate.failures
        if now < self._starts_at:
            return None
        if self._move is None:
            self._move, self.text = ParkMove(self._mechanism, estimate.model, now), 'parking'
        command = self._move.command(estimate, last, now)
        if command is None:
            self.text, self._move, self._over = self._move.outcome(estimate), None, True
        return command


class ParkMove:
    """A move to the park pose of ``mechanism`` that begins ``now`` (s), by the law of ``model``.

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
        law = law_of(model.settings)
        law = law._replace(slow_below=0.0, hold_below=-1.0, singular_below=POOR_BELOW)
        self._model = ControlModel(slow, model.settings, model.kernel, packed_model(slow, law))

    def command(self, estimate: Estimate, last: RateCommand, now: float) -> RateCommand | None:
        """Return the command ``now`` (s) at an ``estimate``, after the ``last`` one.

        None where the move is over.
        """
        missing, scale = self._missing(estimate), self._target.scale
        if not _far(missing, self._length) or now > self._began + LONGEST_MOVE:
            return None
        twist = GAIN * missing / scale
        twist *= min(1.0, SPEED * self._length / float(np.linalg.norm(scale * twist)))
        model = replace(self._model, kernel=estimate.model.kernel)
        velocity = twist[model.mechanism.task.rows]
        command = rate_command(model, estimate, velocity, last, now)
        home_gain = estimate.model.packed.view.law.home_gain
        if LEAST_HOLD * float(command.numbers[at.GAIN]) > home_gain:
            return None
        speed = np.linalg.norm((scale * command.twist)[self._given])
        fast = np.abs(command.rates) > 0.5 * model.mechanism.velocity_limits
        if speed > GAIN * GOAL * self._length or fast.any():
            self._moved = now
        return command if now <= self._moved + STANDSTILL else None

    def outcome(self, estimate: Estimate) -> str:
        """Return where the move has ended, at an ``estimate``, in words."""
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
    return bool(np.abs(missing).max() > GOAL * length)


def _is_held(estimate: Estimate) -> bool:
    """Return whether the drives hold the platform as well as they have to, whatever its task."""
    facts, settings = estimate.numbers, estimate.model.settings
    held = min(facts[at.TORQUE], facts[at.HARD]) >= settings.tolerance_threshold
    return bool(settings.recovery and facts[at.UNCONTROLLED] == 0 and held)
