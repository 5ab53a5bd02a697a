# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where the mechanism is, what its failures leave of it, and what further ones would cost.

`estimate` and `measures` are called from outside. They never decline: what cannot be computed is
told among the results, and the others are valid.
"""

from __future__ import annotations

from math import inf, isfinite

from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.array_layout import (
    EstimateArrays,
    Model,
    credible,
    estimate_of,
    model_of,
)
from fault_tolerance.kernel.closing import Closing, closed, largest_misfit, place
from fault_tolerance.kernel.failure_measures import (
    columns_of,
    kinds_of,
    next_measures,
    present_measures,
)
from fault_tolerance.kernel.jacobi_svd import copied, decomposed, largest_of, rank_of
from fault_tolerance.kernel.motions import Kinematics
from fault_tolerance.kernel.scratch import matrix, vector
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import COMPLIANCE_BAND, JUMP, MISFIT_BAND


def estimate(
    counts: IntArray,
    numbers: FloatArray,
    failures: FloatArray,
    before: FloatArray,
    readings: FloatArray,
    out: FloatArray,
    work: FloatArray,
) -> None:
    """Write where the mechanism is and what its failures leave of it (`EstimateArrays`).

    Parameters
    ----------
    counts, numbers : arrays
        The model, see `model_of`.
    failures : (s + 2 N,) array
        1 for every strut lost, actuator stuck, and actuator free.
    before : array
        The last estimate: warm start, and what hysteresis remembers.
    readings : (N,) array
        Joint values from home; NaN where there is none.
    out : array
        As long as ``before``.
    work : array
        Of `workspace_size`.
    """
    work[0] = 1.0
    m = model_of(counts, numbers, work)
    failed = copied(failures, vector(work, len(failures)))
    target = credible(readings, vector(work, len(readings)))
    start = copied(before, vector(work, len(before)))
    last, e = estimate_of(m, start), estimate_of(m, copied(start, out))
    found = _located(m, start, failed, target, out)
    facts, strut, joint = e.facts, m.chains.strut, m.chains.joint
    facts[at.CLOSED], facts[at.STEPS] = 1.0 if found.steps > 0 else 0.0, found.steps
    facts[at.LOCATED] = max(facts[at.CLOSED], last.facts[at.LOCATED])
    if found.steps > 0:
        facts[at.OUTSIDE], facts[at.STRAIN] = found.outside, found.strain
        facts[at.MISFIT] = largest_misfit(m, e, failed, target)
        limit = m.law.misfit_limit * (MISFIT_BAND if last.facts[at.CONTRADICTORY] != 0.0 else 1.0)
        facts[at.CONTRADICTORY] = 1.0 if facts[at.MISFIT] > limit else 0.0
    facts[at.UNREAD] = 0.0
    for j in range(len(strut)):
        facts[at.UNREAD] += 0.0 if isfinite(target[j]) else 1.0
        e.actuators[j] = e.values[strut[j], joint[j]] if strut[j] >= 0 else 0.0
    present = _judged(m, e, last, failed)
    copied(failed, e.failed)
    copied(present.driving, e.driving)
    facts[at.MOBILITY] = len(present.motions)
    motions = estimate_of(m, out).motions
    for k in range(len(motions)):
        copied(present.motions[k], motions[k])


def measures(
    counts: IntArray,
    numbers: FloatArray,
    estimated: FloatArray,
    out: FloatArray,
    work: FloatArray,
) -> None:
    """Write p, t, h of the failures present, then p (N,), t (N,), h (s,) of each further one.

    Parameters
    ----------
    counts, numbers : arrays
        The model; its `Drives.scale` and `TaskRows.measure` say in which units.
    estimated : array
        The estimate to go by.
    out : (3 + 2 N + s,) array
    work : array
        Of `workspace_size`.
    """
    work[0] = 1.0
    m = model_of(counts, numbers, work)
    e = estimate_of(m, copied(estimated, vector(work, len(estimated))))
    failed, compliance = e.failed, e.facts[at.COMPLIANCE]
    kinds = kinds_of(m, e, failed, compliance)
    cost = present_measures(m, failed, kinds)
    out[0], out[1], out[2] = cost.position, cost.torque, cost.hard
    next_measures(m, e, failed, compliance, kinds.present, out[3:])


def _located(
    m: Model, start: FloatArray, failed: FloatArray, target: FloatArray, out: FloatArray
) -> Closing:
    """Move the estimate ``out`` from ``start`` to where the mechanism is by its readings.

    From the last one the same assembly mode is followed. After a jump, as after a long gap or
    readings without sense, it may lead to another one that fits as well, upside down for
    instance: then the one that is reached from home counts, and readings that contradict each
    other lead nowhere. Where nothing closes the last place is the one to stay, with no steps.
    """
    last, e, limit = estimate_of(m, start), estimate_of(m, out), m.law.misfit_limit
    if len(m.chains.joints) == 0:
        return Closing(0.0, 0.0, 1)
    known = last.facts[at.LOCATED] != 0.0
    numbers, found = copied(start, vector(m.work, len(out))), Closing(0.0, 0.0, 0)
    there, misfit, far = estimate_of(m, numbers), inf, False
    for attempt in range(0 if known else 1, 2):
        copied(start, numbers)
        if attempt == 1:
            _bring_home(m, there)
        if not known:
            copied(numbers, start)
        other = closed(m, there, failed, target)
        off = largest_misfit(m, there, failed, target)
        if found.steps == 0 or (other.steps > 0 and (off < misfit or off <= limit)):
            found, misfit = other, off
            copied(numbers, out)
            far = _jumps(last, e, failed, m.chains.length)
        if found.steps > 0 and not (misfit > limit or far):
            return found
    if found.steps == 0 or (misfit > limit and far):
        copied(start, out)
        # The loops do close at these readings, but the place is the last one, with its strain.
        return Closing(last.facts[at.OUTSIDE], last.facts[at.STRAIN], found.steps)
    return found


def _bring_home(m: Model, e: EstimateArrays) -> None:
    """Write the place of ``m`` at home to ``e``."""
    for i in range(4):
        for j in range(4):
            e.pose[i, j] = 1.0 if i == j else 0.0
    for i in range(3):
        e.pose[i, 3] = m.chains.origin[i]
    for s in range(len(e.values)):
        for j in range(e.values.shape[1]):
            e.values[s, j] = 0.0
    place(m, e)


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
        for j in range(one.values.shape[1]):
            if failed[s] == 0.0 and abs(one.values[s, j] - other.values[s, j]) > JUMP:
                return True
    return False


def _judged(
    m: Model, e: EstimateArrays, last: EstimateArrays, failed: FloatArray
) -> Kinematics:
    """Write mobility, measures and verdict to ``e``, and return J and T with the failures.

    A constraint that was absorbed in the ``last`` estimate stays so until it exceeds the
    compliance by `COMPLIANCE_BAND`: otherwise the verdict would change with every noisy reading
    while a scan crosses it.
    """
    same, facts, limit = True, e.facts, COMPLIANCE_BAND * m.law.compliance
    for i in range(len(failed)):
        same = same and failed[i] == last.failed[i]
    compliance, mark = m.law.compliance, m.work[0]
    for _ in range(2):
        m.work[0] = mark
        kinds = kinds_of(m, e, failed, compliance)
        nominal, present = kinds.nominal, kinds.present
        facts[at.NOMINAL_FREEDOM] = len(nominal.motions) + nominal.drifting
        facts[at.FREEDOM] = len(present.motions) + present.drifting
        fewer = facts[at.FREEDOM] < last.facts[at.FREEDOM]
        if not (
            kinds.weakest <= limit and facts[at.NOMINAL_FREEDOM] < last.facts[at.NOMINAL_FREEDOM]
        ) and not (same and kinds.weakest_left <= limit and fewer):
            break
        compliance = limit
    cost = present_measures(m, failed, kinds)
    major = matrix(m.work, len(present.motions), len(m.task.major))
    columns_of(m.task, present.motions, m.task.major, False, major)
    sigma = decomposed(m.work, major).sigma
    facts[at.COMPLIANCE], facts[at.DRIFTING] = compliance, present.drifting
    facts[at.MAJOR_RANK] = rank_of(sigma, largest_of(sigma))
    facts[at.POSITION], facts[at.TORQUE] = cost.position, cost.torque
    facts[at.HARD], facts[at.MOTION] = cost.hard, cost.motion
    facts[at.VERDICT] = at.TOLERATED
    if present.drifting > 0:
        facts[at.VERDICT] = at.DRIFTS
    elif facts[at.MAJOR_RANK] < len(m.task.major):
        facts[at.VERDICT] = at.MAJOR_LOST
    elif not min(cost.motion, cost.torque, cost.hard) >= m.law.threshold:
        facts[at.VERDICT] = at.BELOW_THRESHOLD
    return present
