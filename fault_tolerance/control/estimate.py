# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where the mechanism is, what its failures leave of it, and whether that will do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fault_tolerance.control.joint_states import unusable
from fault_tolerance.control.observability import is_determined, silent_drives
from fault_tolerance.control.settings import Settings
from fault_tolerance.kernel import model as at
from fault_tolerance.kernel.compilation import Kernel
from fault_tolerance.kernel.model import EstimateArrays, Law, Model, estimate_of
from fault_tolerance.kernel.packing import PackedModel, packed_model
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure, reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.kinematics.verdict import intolerance
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.configuration import Configuration, placed_configuration
from fault_tolerance.mechanism.description import Mechanism


@dataclass(frozen=True, eq=False)
class ControlModel:
    """A mechanism, the settings, and the kernel in one form; made by `control_model`.

    Attributes
    ----------
    mechanism : Mechanism
    settings : Settings
    kernel : Kernel
    packed : PackedModel
        Mechanism and settings as the kernel takes them.
    """

    mechanism: Mechanism
    settings: Settings
    kernel: Kernel
    packed: PackedModel

    @cached_property
    def view(self) -> Model:
        """The packed numbers by name."""
        return self.packed.view

    @cached_property
    def unknown(self) -> Estimate:
        """The estimate before there is any reading: home, but not located."""
        numbers = np.zeros(self.packed.size)
        pose = estimate_of(self.view, numbers).pose
        pose[:] = np.eye(4)
        pose[:3, 3] = self.mechanism.origin
        none = frozen(np.full(len(self.mechanism.actuators), np.nan))
        flags = frozen(np.zeros(len(self.mechanism.struts) + 2 * len(none)))
        return Estimate(self, FailureSet(), flags, none, frozen(numbers))

    def with_kernel(self, kernel: Kernel) -> ControlModel:
        """Return the same with the kernel in another form; estimates go on from each other."""
        return replace(self, kernel=kernel)


def control_model(mechanism: Mechanism, settings: Settings, kernel: Kernel) -> ControlModel:
    """Return the model of a mechanism under control.

    Margins from singularities are relative to home, where the mechanism is made to work. A home
    that is singular itself, as of a stretched arm, is no yardstick.

    Parameters
    ----------
    mechanism : Mechanism
    settings : Settings
    kernel : Kernel

    Returns
    -------
    ControlModel
    """
    law = Law(
        misfit_limit=settings.misfit_limit,
        threshold=settings.tolerance_threshold,
        slow_below=settings.slow_below,
        hold_below=settings.hold_below,
        stroke_gain=settings.stroke_gain,
        max_acceleration=settings.max_acceleration,
    )
    model = ControlModel(mechanism, settings, kernel, packed_model(mechanism, law))
    home = estimate(model, model.unknown, np.zeros(len(mechanism.actuators)), FailureSet())
    jacobian, task = home.arrays.jacobian, mechanism.task
    major = jacobian[task.rows[task.major_rows]]
    sigma = np.linalg.svd(major, compute_uv=False)
    transmission = float(sigma.min()) if 0 < len(major) == len(sigma) else 0.0
    gain = float(np.linalg.norm(jacobian))
    moves, held = transmission > settings.slow_below, gain * settings.slow_below < 1.0
    law = law._replace(
        home_transmission=transmission if moves else 1.0,
        home_gain=gain if moves and held else 1.0,
    )
    return replace(model, packed=packed_model(mechanism, law))


@dataclass(frozen=True, eq=False)
class Estimate:
    """What is known of the mechanism after one set of readings.

    As a reason of the state machine its text is the verdict in words, found when asked for.

    Attributes
    ----------
    model : ControlModel
    failures : FailureSet
        Present when it was made.
    flags : (s + 2 N,) array
        The same as the kernel takes them: 1 for every strut lost, actuator stuck, and actuator
        free.
    readings : (N,) array
        What it was made from; NaN in lost struts.
    numbers : array
        The kernel's result, see `fault_tolerance.kernel.model.EstimateArrays`.
    located : bool
        Whether the loops have closed, now or before.
    obstacle : str
        Why these readings must not be acted on; empty if they may.
    tolerated : bool
        Whether the mechanism, with its failures, can do its task here.
    determined : bool
        Whether the readings there are say where it is.
    """

    model: ControlModel
    failures: FailureSet
    flags: FloatArray
    readings: FloatArray
    numbers: FloatArray
    located: bool = False
    obstacle: str = ''
    tolerated: bool = True
    determined: bool = True

    def __repr__(self) -> str:
        """Return the mechanism, its failures and its mobility."""
        return f'<Estimate of {self.model.mechanism.name}: {self}, mobility {self.mobility}>'

    def __str__(self) -> str:
        """Return why the mechanism cannot do its task, or what the failures leave."""
        return self._words

    @cached_property
    def _words(self) -> str:
        reason, threshold = self.post.verdict.reason, self.model.settings.tolerance_threshold
        if not self.failures:
            return reason if self.tolerated else f'singular configuration: {reason}'
        return (not self.tolerated and intolerance(self.post, threshold)) or reason

    @cached_property
    def arrays(self) -> EstimateArrays:
        """The numbers by name, scaled to metres."""
        return estimate_of(self.model.view, self.numbers)

    @property
    def mobility(self) -> int:
        """Degrees of freedom the drives control."""
        return int(self.numbers[at.MOBILITY])

    @property
    def flexure_strain(self) -> float:
        """Metres the flexures take up."""
        return float(self.numbers[at.STRAIN])

    @property
    def misfit(self) -> float:
        """By how much the redundant readings contradict each other at most, metres."""
        return float(self.numbers[at.MISFIT])

    @property
    def pose(self) -> FloatArray:
        """The platform frame in base axes, (4, 4)."""
        # Asked for at every step, and all the arrays take ten times as long.
        return self.numbers[self.model.packed.pose].reshape((4, 4))

    @property
    def joint_values(self) -> FloatArray:
        """Joint values of all struts, (s, k), zero where padded."""
        return self.arrays.values

    @property
    def actuator_values(self) -> FloatArray:
        """Joint values of the actuators, (N,), consistent with the pose."""
        return self.arrays.actuators

    @cached_property
    def configuration(self) -> Configuration:
        """The configuration, by definition."""
        return placed_configuration(
            self.model.mechanism, self.pose, self.joint_values, self.readings, self.failures.lost
        )

    @cached_property
    def post(self) -> PostFailure:
        """Kinematics and verdict with the failures, by definition (numpy, about a millisecond)."""
        rows = strut_rows(self.configuration).with_compliance(float(self.numbers[at.COMPLIANCE]))
        return reconfigured(rows, self.failures)

    def measures(self) -> FloatArray:
        """Return p, t, h of the failures present, then p (N,), t (N,), h (s,) of each next one.

        Returns
        -------
        (3 + 2 N + s,) array
            As the paper defines them, drives and task in their own units; NaN for what has
            failed already.
        """
        model = self.model
        out = np.empty(3 + 2 * len(self.readings) + len(model.mechanism.struts))
        packed = model.packed
        model.kernel.measures(packed.counts, packed.measured, self.numbers, out, packed.work)
        return out


def estimate(
    model: ControlModel, before: Estimate, values: FloatArray, failures: FailureSet
) -> Estimate:
    """Return where the mechanism is and what its failures leave of it.

    Always from the nominal rows and the whole set of failures; `before` is only the warm start
    of closing the loops, and what hysteresis remembers.

    Parameters
    ----------
    model : ControlModel
    before : Estimate
        The last one; `ControlModel.unknown` at first.
    values : (N,) array
        Joint values from home, NaN where there is no reading.
    failures : FailureSet

    Returns
    -------
    Estimate
        Where the loops do not close, at the last place where they did.
    """
    flags = before.flags
    if failures is not before.failures:
        names, struts = model.mechanism.actuator_names, model.mechanism.strut_names
        flags = np.zeros(len(flags))
        drives = flags[len(struts) :].reshape((2, len(names)))
        flags[[*map(struts.index, failures.lost)]] = 1.0
        drives[0, [*map(names.index, failures.stuck)]] = 1.0
        drives[1, [*map(names.index, failures.free)]] = 1.0
        flags.setflags(write=False)
    if failures.lost:
        values = np.where(flags[model.view.chains.strut] != 0.0, np.nan, values)
    if values.flags.writeable:
        values = values.copy()
        values.setflags(write=False)
    packed, numbers = model.packed, np.empty(model.packed.size)
    model.kernel.estimate(
        packed.counts, packed.numbers, flags, before.numbers, values, numbers, packed.work)
    numbers.setflags(write=False)
    unread, determined = None, True
    if numbers[at.UNREAD]:
        # After a clearing, the strut that was lost may not have been read yet.
        unread = unusable(model.mechanism, values, failures.parts)
        places, determined = model.view.chains.strut, before.determined
        silent = silent_drives(values, places, flags)
        known = failures is before.failures
        if not known or (silent != silent_drives(before.readings, places, flags)).any():
            place = Estimate(model, failures, flags, values, numbers).configuration
            least = model.settings.tolerance_threshold
            determined = is_determined(place, failures, values, least)
    obstacle = unread.text if unread is not None else ''
    if not (obstacle or (determined and numbers[at.CLOSED] and not numbers[at.CONTRADICTORY])):
        obstacle = _obstacle(model, numbers, determined)
    # Where nothing is known of the place, nothing is judged.
    located = bool(numbers[at.LOCATED])
    tolerated = bool(not located or numbers[at.VERDICT] == at.TOLERATED)
    return Estimate(
        model, failures, flags, values, numbers, located, obstacle, tolerated, determined
    )


def _obstacle(model: ControlModel, numbers: FloatArray, determined: bool) -> str:
    """Return why readings that can be used must not be acted on."""
    if not determined:
        return 'failed drives without a reading: the others do not say where it is'
    if not numbers[at.CLOSED]:
        return 'the loops do not close at these joint values'
    limit = model.settings.misfit_limit * model.mechanism.characteristic_length
    return (f'joint readings contradict each other by {numbers[at.MISFIT]:.2g} m'
            f' (limit {limit:.2g} m)')
