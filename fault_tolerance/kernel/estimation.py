# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Entry points `estimate` (close loops, kinematics with failures, verdict) and `measures`.

They never raise; flags in the result say what is not valid.
"""

from math import inf, isfinite

from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import (
    EstimateArrays,
    Model,
    credible,
    estimate_of,
    model_of,
)
from fault_tolerance.kernel.closing import Closing, close_loops, largest_misfit
from fault_tolerance.kernel.failure_measures import (
    judge,
    next_measures,
    present_measures,
    staged_kinematics,
)
from fault_tolerance.kernel.scratch import set_identity, set_zero, vector
from fault_tolerance.kernel.small_matrices import copy_to
from fault_tolerance.kernel.strut_poses import place_struts
from fault_tolerance.kernel.strut_qr import factorise
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import JUMP, MISFIT_BAND


def estimate(
    counts: IntArray,
    numbers: FloatArray,
    failed: FloatArray,
    before: FloatArray,
    readings: FloatArray,
    out: FloatArray,
    work: FloatArray,
) -> None:
    """Write where the mechanism is and what its failures leave of it (`EstimateArrays`).

    ``counts`` and ``numbers`` are the model (`model_of`), ``failed`` (s + 2 N,) its failures,
    ``readings`` (N,) joint values from home, NaN where there is none. ``before`` is the last
    estimate: warm start, and what hysteresis remembers.
    """
    work[0] = 1.0
    m = model_of(counts, numbers, work)
    failed = copy_to(failed, vector(work, len(failed)))
    target = credible(readings, vector(work, len(readings)))
    start = copy_to(before, vector(work, len(before)))
    last, e = estimate_of(m, start), estimate_of(m, copy_to(start, out))
    closing = _located(m, start, failed, target, out)
    facts, strut, joint = e.facts, m.chains.strut, m.chains.joint
    facts[at.CLOSED] = 1.0 if closing.converged else 0.0
    facts[at.LOCATED] = max(facts[at.CLOSED], last.facts[at.LOCATED])
    if closing.converged:
        facts[at.STRAIN] = closing.strain
        facts[at.MISFIT] = largest_misfit(m, e, failed, target)
        limit = m.law.misfit_limit * (MISFIT_BAND if last.facts[at.CONTRADICTORY] != 0.0 else 1.0)
        facts[at.CONTRADICTORY] = 1.0 if facts[at.MISFIT] > limit else 0.0
    facts[at.UNREAD] = 0.0
    for j in range(len(strut)):
        facts[at.UNREAD] += 0.0 if isfinite(target[j]) else 1.0
        e.actuator_values[j] = e.values[strut[j], joint[j]] if strut[j] >= 0 else 0.0
    present = judge(m, e, last, failed)
    copy_to(failed, e.failed)
    copy_to(present.driving, e.driving)
    motions = estimate_of(m, out).motions  # anew: their number has just been written
    for k in range(len(motions)):
        copy_to(present.motions[k], motions[k])


def measures(
    counts: IntArray,
    numbers: FloatArray,
    estimated: FloatArray,
    out: FloatArray,
    work: FloatArray,
) -> None:
    """Write p, t, h of the failures present, then p (N,), t (N,), h (s,) of each further one.

    At an ``estimated`` configuration of the model in ``counts`` and ``numbers``, whose
    `Actuators.scale` and `TaskRows.measure` say in which units.
    """
    work[0] = 1.0
    m = model_of(counts, numbers, work)
    e = estimate_of(m, copy_to(estimated, vector(work, len(estimated))))
    failed, compliance = e.failed, e.facts[at.COMPLIANCE]
    stages = staged_kinematics(m, e, failed, compliance)
    out[0], out[1], out[2], _ = present_measures(m, failed, stages)
    next_measures(m, e, failed, compliance, stages.present, out[3:])


def _located(
    m: Model, start: FloatArray, failed: FloatArray, target: FloatArray, out: FloatArray
) -> Closing:
    """Move the estimate ``out`` from ``start`` to where the mechanism is by its readings.

    First try from the last estimate (keeps the assembly mode). If the fit is bad or the pose has
    jumped, try from home. If neither closes, keep the last pose.
    """
    last, e, limit = estimate_of(m, start), estimate_of(m, out), m.law.misfit_limit
    if len(m.chains.joints) == 0:
        return Closing(True, 0.0)
    known = last.facts[at.LOCATED] != 0.0
    numbers = copy_to(start, vector(m.work, len(out)))
    there = estimate_of(m, numbers)
    closing, misfit, far = Closing(False, 0.0), inf, False
    for attempt in range(0 if known else 1, 2):
        copy_to(start, numbers)
        if attempt == 1:
            _bring_home(m, there)
        if not known:
            copy_to(numbers, start)  # jumps count from home
        other = close_loops(m, there, failed, target)
        off = largest_misfit(m, there, failed, target)
        if not closing.converged or (other.converged and (off < misfit or off <= limit)):
            closing, misfit = other, off
            copy_to(numbers, out)
            far = _jumps(last, e, failed, m.chains.length)
        if closing.converged and not (misfit > limit or far):
            return closing
    if not closing.converged or (misfit > limit and far):
        copy_to(start, out)
        # If the loops closed, but elsewhere and with a bad fit, this still says converged: by the
        # misfit at the last pose the readings are then contradictory.
        return Closing(closing.converged, last.facts[at.STRAIN])
    return closing


def _bring_home(m: Model, e: EstimateArrays) -> None:
    """Move ``e`` to home."""
    mark = m.work[0]
    s, k = m.chains.actuator.shape
    screws = vector(m.work, 6 * s * k).reshape((s, k, 6))
    set_identity(e.pose)
    for i in range(3):
        e.pose[i, 3] = m.chains.origin[i]
    for i in range(s):
        set_zero(e.values[i])
    place_struts(m, e, screws)
    factorise(m, e, screws)
    m.work[0] = mark


def _jumps(
    one: EstimateArrays, other: EstimateArrays, failed: FloatArray, length: float
) -> bool:
    """Return whether two places are farther apart than a mechanism goes in one cycle.

    A lost strut does not count: it only follows the platform, and may swing any way.
    """
    shift = turn = 0.0
    for i in range(3):
        shift += (one.pose[i, 3] - other.pose[i, 3]) ** 2
        for j in range(3):
            turn += (one.pose[i, j] - other.pose[i, j]) ** 2
    if shift > (JUMP * length) ** 2 or turn > JUMP * JUMP:
        return True
    for s in range(len(one.values)):
        if failed[s] == 0.0:
            for j in range(one.values.shape[1]):
                if abs(one.values[s, j] - other.values[s, j]) > JUMP:
                    return True
    return False
