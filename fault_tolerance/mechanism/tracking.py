# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Following a mechanism from one configuration to a near one, at one evaluation each.

The decompositions made at the last configuration serve for the Newton step away from it. If that
step was not short enough to be the last, further ones are taken with the same decompositions
(chord steps): they only need to know where the struts' tips are. The rows are then derived
anew, once, and the same evaluation certifies what was found (docs/theory.md, section 3).
"""

from __future__ import annotations

from fault_tolerance.compiled.activation import Active
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.attachment import Attachment
from fault_tolerance.mechanism.following import followed
from fault_tolerance.mechanism.screws import displaced_by
from fault_tolerance.mechanism.state import State, placed_state
from fault_tolerance.mechanism.steps import Closed, steps_from

_MOST_EVALUATIONS = 4
_MOST_CHORDS = 4
FARTHEST = 0.1
"""Characteristic lengths; farther away the last decompositions are no guide any more."""

LAST_STEP = 1e-4
"""Characteristic lengths; a step of relative length e leaves an error of about e squared."""


def tracked(
    start: State, target: FloatArray, attachment: Attachment, compliance: float, last_step: float
) -> Closed | None:
    """Return the state near ``start`` that fits ``target``, or None: then take the long way.

    Parameters
    ----------
    start : State
    target : (N,) array
        Joint values of the actuators; those of attached struts must be finite here.
    attachment : Attachment
    compliance : float
    last_step : float
        Characteristic lengths; the relative length of a Newton step that need not be followed
        by another one. It leaves an error of about its square.
    """
    state, iterations = start, 0
    unit = start.chains.length
    least, most = last_step * unit, FARTHEST * unit
    kept = state.constraints.structure_of(attachment).kept(compliance)
    if Active.kernels is not None:
        steps = steps_from(state, attachment, kept)
        limits = kept, compliance, least, most
        near = followed(Active.kernels, state, steps, target, limits) if steps else None
        if near is not None:
            return near
    for _ in range(_MOST_EVALUATIONS):
        regular = state.regular
        steps = steps_from(state, attachment, kept)
        if regular is None or steps is None:
            return None
        pose, values, openings, travelled = state.pose, state.joint_values, state.openings, 0.0
        for _ in range(_MOST_CHORDS):
            twist, rates, step = steps.towards(target, values, openings)
            iterations += 1
            travelled += step
            if not travelled <= most:
                return None  # NaN among them
            pose = displaced_by(pose, twist, unit)
            values = values + rates
            placement = regular.placed(pose, values)
            openings = placement.openings
            arrived = step * travelled <= least**2
            if arrived and travelled > least:
                # Readings in contradiction are weighed against each other by what the drives do
                # here, which is not quite what they did where the decompositions were made.
                misfit = steps.misfit(target, values)
                arrived = misfit * travelled <= least**2
            if arrived:
                break
        found = placed_state(state.chains, regular, placement)
        if found is None:
            return None
        freedom = kept
        state = found
        kept = state.constraints.structure_of(attachment).kept(compliance)
        # In an overconstrained mechanism the freedom to fit shows only once the loops close.
        if arrived and kept == freedom:
            closed = Closed(state, attachment, kept, True, iterations)
            if closed.closes:
                return closed
    return None
