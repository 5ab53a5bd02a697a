# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The estimate of one step: pose, what the failures leave to do, whether that is tolerated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from fault_tolerance.control.joint_states import unusable
from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import EstimateArrays, estimate_of
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure, reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.kinematics.verdict import intolerance
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray
from fault_tolerance.mechanism.configuration import Configuration, placed_configuration
from fault_tolerance.tolerances import MISFIT_BAND

if TYPE_CHECKING:
    from fault_tolerance.control.control_model import ControlModel


@dataclass(frozen=True, eq=False)
class Estimate:
    """What is known of the mechanism after one set of readings; made by `estimate`.

    As a reason of the state machine it builds its text, the verdict in words, when asked for it.
    """

    model: ControlModel
    failures: FailureSet
    """Those it was made with."""
    flags: FloatArray
    """(s + 2 N,): the same for the kernel; 1 for struts lost, actuators stuck, actuators free."""
    readings: FloatArray
    """(N,): what it was made from; NaN in lost struts."""
    numbers: FloatArray
    """The kernel's result, see `fault_tolerance.kernel.array_layout.EstimateArrays`."""
    located: bool = False
    """Whether the loops have closed, now or before."""
    hold_reason: str = ''
    """Why these readings must not be acted on; empty if they may."""
    tolerated: bool = True
    """Whether the mechanism, with its failures, can do its task here."""
    determined: bool = True
    """Whether the available readings determine the pose."""

    def __repr__(self) -> str:
        """Return the mechanism, its failures and its mobility."""
        return f'<Estimate of {self.model.mechanism.name}: {self}, mobility {self.mobility}>'

    def __str__(self) -> str:
        """Return why the mechanism cannot do its task, or what the failures leave."""
        return self._text

    @cached_property
    def _text(self) -> str:
        reason, threshold = self.post.verdict.reason, self.model.settings.tolerance_threshold
        if not self.failures:
            return reason if self.tolerated else f'singular configuration: {reason}'
        return (not self.tolerated and intolerance(self.post, threshold)) or reason

    @cached_property
    def arrays(self) -> EstimateArrays:
        """The numbers by name, scaled to metres."""
        return estimate_of(self.model.packed.view, self.numbers)

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
        # Used at every step, and all the arrays take ten times as long.
        return self.numbers[self.model.packed.pose].reshape((4, 4))

    @property
    def actuator_values(self) -> FloatArray:
        """Joint values of the actuators, (N,), consistent with the pose."""
        return self.arrays.actuator_values

    @cached_property
    def configuration(self) -> Configuration:
        """The configuration, by definition."""
        return placed_configuration(
            self.model.mechanism, self.pose, self.arrays.values, self.readings, self.failures.lost
        )

    @cached_property
    def post(self) -> PostFailure:
        """Kinematics and verdict with the failures, by definition (numpy, about a millisecond)."""
        rows = strut_rows(self.configuration).with_compliance(float(self.numbers[at.COMPLIANCE]))
        return reconfigured(rows, self.failures)

    def measures(self) -> FloatArray:
        """Return p, t, h of the failures present, then p (N,), t (N,), h (s,) of each next one.

        (3 + 2 N + s,), as the paper defines them, drives and task in their own units; NaN for
        what has failed already.
        """
        model = self.model
        out = np.empty(3 + 2 * len(self.readings) + len(model.mechanism.struts))
        packed = model.packed
        model.kernel.measures(packed.counts, packed.measured, self.numbers, out, packed.work)
        return out


def estimate(
    model: ControlModel, before: Estimate, values: FloatArray, failures: FailureSet
) -> Estimate:
    """Return where the mechanism of ``model`` is and what its ``failures`` leave of it.

    Always from the nominal rows and the whole set of failures. ``before``, the last estimate
    (`ControlModel.unknown` at first), is only the warm start of closing the loops, and what
    hysteresis remembers. ``values`` (N,) are joint values from home, NaN where there is no
    reading. Where the loops do not close, the pose is the last one at which they did.
    """
    flags = before.flags
    if failures is not before.failures:
        names, struts = model.mechanism.actuator_names, model.mechanism.strut_names
        broken = [0.0] * len(flags)
        for name in failures.lost:
            broken[struts.index(name)] = 1.0
        for name in failures.stuck:
            broken[len(struts) + names.index(name)] = 1.0
        for name in failures.free:
            broken[len(struts) + len(names) + names.index(name)] = 1.0
        flags = np.array(broken)
        flags.setflags(write=False)
    if failures.lost:
        values = np.where(flags[model.packed.view.chains.strut] != 0.0, np.nan, values)
    if values.flags.writeable:
        values = values.copy()
        values.setflags(write=False)
    packed, numbers = model.packed, np.empty(model.packed.size)
    model.kernel.estimate(
        packed.counts, packed.numbers, flags, before.numbers, values, numbers, packed.work)
    numbers.setflags(write=False)
    rejected, determined = None, True
    if numbers[at.UNREAD]:
        # After a clearing, the strut that was lost may not have been read yet.
        rejected, determined = unusable(model.mechanism, values, failures.parts), before.determined
        places = model.packed.view.chains.strut
        sensorless = _sensorless(values, places, flags)
        known = failures is before.failures
        if not known or (sensorless != _sensorless(before.readings, places, flags)).any():
            place = Estimate(model, failures, flags, values, numbers).configuration
            least = model.settings.tolerance_threshold
            determined = _is_determined(place, failures, values, least)
    hold_reason = rejected.text if rejected is not None else ''
    closed = determined and numbers[at.CLOSED] and not numbers[at.CONTRADICTORY]
    if not (hold_reason or closed):
        hold_reason = _hold_reason(model, before, numbers, determined)
    # Where nothing is known of the place, nothing is judged.
    located = bool(numbers[at.LOCATED])
    tolerated = bool(not located or numbers[at.TOLERATED])
    return Estimate(
        model, failures, flags, values, numbers, located, hold_reason, tolerated, determined
    )


def _hold_reason(
    model: ControlModel, before: Estimate, numbers: FloatArray, determined: bool
) -> str:
    """Return why readings that are usable must not be acted on."""
    if not determined:
        return ('pose not determined: failed drives are without a reading, and the others do not '
                'suffice')
    if not numbers[at.CLOSED]:
        return 'the loops do not close at these joint values'
    limit = model.settings.misfit_limit * model.mechanism.characteristic_length
    limit *= MISFIT_BAND if before.numbers[at.CONTRADICTORY] else 1.0
    return (f'joint readings contradict each other by {numbers[at.MISFIT]:.2g} m'
            f' (limit {limit:.2g} m)')


def _sensorless(readings: FloatArray, struts: IntArray, flags: FloatArray) -> BoolArray:
    """Return which actuators of attached struts have no reading, (N,).

    ``struts`` (N,) are the places of their struts in ``flags``; -1 where there are none.
    """
    return np.asarray(np.isnan(readings) & ~((struts >= 0) & (flags[struts] != 0.0)))


def _is_determined(
    configuration: Configuration, failures: FailureSet, readings: FloatArray, least: float
) -> bool:
    """Return whether the readings determine the pose, as the attached struts hold it.

    They do where the smallest singular value of the rows of T that are read is above ``least``.
    """
    rows = strut_rows(configuration)
    # Encoders read drives that are stuck and limp as well as others.
    mapping = differential_kinematics(rows, FailureSet(lost=failures.lost)).mapping
    sigma = np.linalg.svd(mapping[~np.isnan(readings)], compute_uv=False)
    return len(sigma) == mapping.shape[1] and bool(sigma.min(initial=1.0) > least)
