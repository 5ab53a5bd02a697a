# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where the mechanism is, what its failures leave of it, and what further ones would cost.

`estimate` and `measures` are called from outside. They never decline: what cannot be computed is
told among the results, and the others are valid.
"""

from __future__ import annotations

import numpy as np

from fault_tolerance.kernel import model as at
from fault_tolerance.kernel.closing import Closing, Location, closed, largest_misfit, located
from fault_tolerance.kernel.elimination import Elimination
from fault_tolerance.kernel.factorisation import largest_of, rank_of, singular_values
from fault_tolerance.kernel.margins import (
    Measures,
    any_of,
    kinematics_of,
    next_measures,
    present_measures,
    task_rows,
)
from fault_tolerance.kernel.model import EstimateArrays, Model, estimate_of, model_of
from fault_tolerance.kernel.motions import Kinematics, kept_constraints, structure_of
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.tolerances import COMPLIANCE_BAND, JUMP, MISFIT_BAND


def estimate(
    counts: IntArray,
    numbers: FloatArray,
    failures: FloatArray,
    before: FloatArray,
    readings: FloatArray,
    out: FloatArray,
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
        Of `estimate_size`.
    """
    m = model_of(counts, numbers)
    last, failed, target = estimate_of(m, before.copy()), failures.copy(), readings.copy()
    for i in range(at.FACTS):
        out[i] = 0.0
    found = _located_by(m, last, failed, target)
    facts = out[:at.FACTS]
    facts[at.CLOSED] = 1.0 if found.steps > 0 else 0.0
    facts[at.LOCATED] = max(facts[at.CLOSED], last.facts[at.LOCATED])
    facts[at.STEPS] = found.steps
    facts[at.OUTSIDE], facts[at.STRAIN] = last.facts[at.OUTSIDE], last.facts[at.STRAIN]
    facts[at.MISFIT], facts[at.CONTRADICTORY] = last.facts[at.MISFIT], last.facts[at.CONTRADICTORY]
    if found.steps > 0:
        facts[at.OUTSIDE], facts[at.STRAIN] = found.outside, found.strain
        facts[at.MISFIT] = largest_misfit(m, found.location.values, failed, target)
        limit = m.law.misfit_limit * (MISFIT_BAND if last.facts[at.CONTRADICTORY] != 0.0 else 1.0)
        facts[at.CONTRADICTORY] = 1.0 if facts[at.MISFIT] > limit else 0.0
    present = _judged(m, found, failed, last, facts)
    facts[at.MOBILITY] = present.mapping.shape[1]
    _write(m, out, found.location, failed, present)


def measures(
    counts: IntArray, numbers: FloatArray, estimated: FloatArray, out: FloatArray
) -> None:
    """Write p, t, h of the failures present, then p (N,), t (N,), h (s,) of each further one.

    Parameters
    ----------
    counts, numbers : arrays
        The model; its `Drives.scale` and `TaskRows.measure` say in which units.
    estimated : array
        The estimate to go by.
    out : (3 + 2 N + s,) array
    """
    m = model_of(counts, numbers)
    e = estimate_of(m, estimated.copy())
    struts, failed, compliance = _struts(m, e), e.failed, e.facts[at.COMPLIANCE]
    none = np.zeros(len(failed))
    whole, attached = structure_of(struts, none), structure_of(struts, failed)
    nominal = kinematics_of(m, struts, whole, none, compliance)
    present = kinematics_of(m, struts, attached, failed, compliance)
    cost = present_measures(m, struts, whole, failed, compliance, nominal, present)
    out[0], out[1], out[2] = cost.position, cost.torque, cost.hard
    further = next_measures(m, struts, failed, compliance, present)
    for i in range(len(further)):
        out[3 + i] = further[i]


def _located_by(
    m: Model, last: EstimateArrays, failed: FloatArray, target: FloatArray
) -> Closing:
    """Return where the mechanism is by its readings, from the last estimate or from home.

    From the last one the same assembly mode is followed. After a jump, as after a long gap or
    readings without sense, it may lead to another one that fits as well, upside down for
    instance: then the one that is reached from home counts, and readings that contradict each
    other lead nowhere. Where nothing closes the last place is the one to stay, with no steps.
    """
    start = Location(last.pose, last.values, last.openings, _struts(m, last))
    if len(m.chains.joints) == 0:
        return Closing(start, structure_of(start.struts, failed), 0.0, 0.0, 1)
    limit, found = m.law.misfit_limit, closed(m, start, failed, target)
    misfit = largest_misfit(m, found.location.values, failed, target)
    if found.steps == 0 or misfit > limit or _jumps(start, found.location, m.chains.length):
        home = np.eye(4)
        for i in range(3):
            home[i, 3] = m.chains.origin[i]
        place = located(m, home, np.zeros(m.chains.actuator.shape))
        other = closed(m, place, failed, target)
        off = largest_misfit(m, other.location.values, failed, target)
        if other.steps > 0 and (found.steps == 0 or off < misfit or off <= limit):
            found, misfit = other, off
    lost = misfit > limit and _jumps(start, found.location, m.chains.length)
    if found.steps == 0 or lost:
        return Closing(start, structure_of(start.struts, failed), 0.0, 0.0, found.steps)
    return found


def _jumps(one: Location, other: Location, length: float) -> bool:
    """Return whether two locations are farther apart than a mechanism goes in one cycle."""
    shift = turn = 0.0
    for i in range(3):
        shift += (one.pose[i, 3] - other.pose[i, 3]) ** 2
        for j in range(3):
            turn += (one.pose[i, j] - other.pose[i, j]) ** 2
    if shift > (JUMP * length) ** 2 or turn > JUMP * JUMP:
        return True
    for s in range(len(one.values)):
        for j in range(one.values.shape[1]):
            if abs(one.values[s, j] - other.values[s, j]) > JUMP:
                return True
    return False


def _struts(m: Model, e: EstimateArrays) -> Elimination:
    """Return the factorised struts of an estimate, derived again where they are not regular."""
    if e.facts[at.REGULAR] == 0.0:
        return located(m, e.pose, e.values).struts
    count, most = m.chains.actuator.shape
    order, ranks = np.empty((count, most), np.int64), np.empty((count, 2), np.int64)
    for s in range(count):
        for j in range(most):
            order[s, j] = int(e.order[s, j])
        for j in range(2):
            ranks[s, j] = int(e.ranks[s, j])
    spare = np.zeros((len(m.drives.scale), 0))
    return Elimination(e.q, e.r, order, ranks, e.rows, spare, True)


def _judged(
    m: Model, found: Closing, failed: FloatArray, last: EstimateArrays, facts: FloatArray
) -> Kinematics:
    """Write mobility, measures and verdict, and return J and T with the failures.

    A constraint that was absorbed stays so until it exceeds the compliance by `COMPLIANCE_BAND`:
    otherwise the verdict would change with every noisy reading while a scan crosses it.
    """
    same = True
    for i in range(len(failed)):
        same = same and failed[i] == last.failed[i]
    broken, compliance = any_of(failed), m.law.compliance
    struts, attached = found.location.struts, found.structure
    whole = attached
    if any_of(failed[: len(m.chains.joints)]):
        whole = structure_of(struts, np.zeros(len(failed)))
    none, cost = np.zeros(len(failed)), Measures(1.0, 1.0, 1.0, 1.0)
    for _ in range(2):
        nominal = present = kinematics_of(m, struts, whole, none, compliance)
        if broken:
            present = kinematics_of(m, struts, attached, failed, compliance)
            cost = present_measures(m, struts, whole, failed, compliance, nominal, present)
        facts[at.NOMINAL_FREEDOM] = nominal.mapping.shape[1] + nominal.drifting
        facts[at.FREEDOM] = present.mapping.shape[1] + present.drifting
        limit = COMPLIANCE_BAND * m.law.compliance
        undecided = (
            _weakest_kept(whole.sigma, compliance) <= limit
            and facts[at.NOMINAL_FREEDOM] < last.facts[at.NOMINAL_FREEDOM]
        ) or (
            same
            and _weakest_kept(attached.sigma, compliance) <= limit
            and facts[at.FREEDOM] < last.facts[at.FREEDOM]
        )
        if not undecided:
            break
        compliance = limit
    sigma = singular_values(task_rows(m.task, present.jacobian, m.task.major, False))
    facts[at.COMPLIANCE], facts[at.DRIFTING] = compliance, present.drifting
    facts[at.MAJOR_RANK] = rank_of(sigma, largest_of(sigma))
    facts[at.POSITION], facts[at.TORQUE] = cost.position, cost.torque
    facts[at.HARD], facts[at.MOTION] = cost.hard, cost.motion
    facts[at.REGULAR] = 1.0 if struts.regular else 0.0
    worst = min(cost.motion, cost.torque, cost.hard)
    facts[at.VERDICT] = at.TOLERATED
    if present.drifting > 0:
        facts[at.VERDICT] = at.DRIFTS
    elif facts[at.MAJOR_RANK] < len(m.task.major):
        facts[at.VERDICT] = at.MAJOR_LOST
    elif broken and not worst >= m.law.threshold:
        facts[at.VERDICT] = at.BELOW_THRESHOLD
    return present


def _weakest_kept(sigma: FloatArray, compliance: float) -> float:
    """Return the smallest singular value that is not absorbed; infinite if there is none."""
    kept = kept_constraints(sigma, compliance)
    return sigma[kept - 1] if kept > 0 else np.inf


def _write(
    m: Model, out: FloatArray, location: Location, failed: FloatArray, present: Kinematics
) -> None:
    """Write a location and its kinematics into an estimate, in the order of `estimate_of`."""
    actuators, n = np.zeros(len(m.chains.strut)), len(m.chains.strut)
    for j in range(n):
        if m.chains.strut[j] >= 0:
            actuators[j] = location.values[m.chains.strut[j], m.chains.joint[j]]
    struts = location.struts
    end = _put(out, at.FACTS, failed)
    end = _put(out, end, location.pose.ravel())
    end = _put(out, end, location.values.ravel())
    end = _put(out, end, actuators)
    end = _put(out, end, location.openings.ravel())
    end = _put(out, end, struts.q.ravel())
    end = _put(out, end, struts.r.ravel())
    end = _put(out, end, struts.order.ravel())
    end = _put(out, end, struts.ranks.ravel())
    end = _put(out, end, struts.rows.ravel())
    _put(out, end, present.jacobian.ravel())
    _put(out, end + 6 * n, present.mapping.ravel())
    _put(out, end + 6 * n + n * n, present.follow.ravel())


def _put(out: FloatArray, begin: int, values: FloatArray | IntArray) -> int:
    """Write values (k,) from a place on; return where they end."""
    for i in range(len(values)):
        out[begin + i] = values[i]
    return begin + len(values)
