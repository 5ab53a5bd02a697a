# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Measures of the next single failure at many poses at a time.

Where every strut is one of `Legs` a pose gives the rows of all drives without closing a loop, and
all poses go through numpy together: ``A' A = L L'`` by Cholesky and ``T = A L'^-1``, whose rows
have the measures in their lengths (docs/theory.md, eq. 21; docs/design.md). Poses where digits
would be lost, and other mechanisms, go through the definition one by one: the two agree to 1e-9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from fault_tolerance.design.batches import Batch
from fault_tolerance.design.legs import legs_of
from fault_tolerance.errors import ClosureError, MechanismError
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet
from fault_tolerance.kinematics.measures import motion_quality
from fault_tolerance.kinematics.reconfiguration import PostFailure, after
from fault_tolerance.kinematics.verdict import is_tolerable
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.task import COORDINATES
from fault_tolerance.tolerances import OVERSHOOT, SURE

BATCH = 1024
"""Poses that go through numpy together: what belongs to them stays in the processor's cache."""


@dataclass(frozen=True, eq=False)
class PoseMeasures:
    """What the next single failure would leave at each of B poses; NaN where it does not close."""

    position: FloatArray
    torque: FloatArray
    """(B, N): p and t of every actuator; NaN for those that have failed."""
    hard: FloatArray
    """(B, s): h of every strut; NaN for those that are lost."""
    smallest_singular_value: FloatArray
    condition_number: FloatArray
    """(B,): of J_m, as in `PresentMeasures`."""
    actuator_values: FloatArray
    """(B, N): radians and metres from home."""
    tolerable: BoolArray
    """(B,): every single further failure is, and the present state."""
    reachable: BoolArray
    """(B,): the loops close, with every drive of a strut still there within its stroke."""

    def __repr__(self) -> str:
        return f'PoseMeasures({len(self.tolerable)} poses, {int(self.tolerable.sum())} tolerable)'


def joined(parts: Sequence[PoseMeasures]) -> PoseMeasures:
    """Return ``parts`` one after the other."""
    columns = ([getattr(part, one.name) for part in parts] for one in fields(PoseMeasures))
    return PoseMeasures(*(frozen(np.concatenate(column)) for column in columns))


def pose_measures(
    mechanism: Mechanism,
    names: Sequence[str],
    values: FloatArray,
    failures: FailureSet | None = None,
) -> PoseMeasures:
    """Return the measures of the next failure at many poses of ``mechanism``.

    Parameters
    ----------
    mechanism : Mechanism
    names : sequence of str
        k task coordinates; what those left out are, `posed_configuration` says.
    values : (B, k) array
        Their displacements from home, radians (of the rotation vector) and metres, base axes.
    failures : FailureSet, optional
        What has failed already, at each of the poses.

    Returns
    -------
    PoseMeasures

    Raises
    ------
    MechanismError
        If one of ``names`` is no task coordinate.
    FailureError
        If ``failures`` name what the mechanism does not have.
    """
    failures = (failures or FailureSet()).of(mechanism)
    for name in names:
        if name not in mechanism.task.coordinates:
            valid = ', '.join(mechanism.task.coordinates)
            reason = f'{name!r} is not a task coordinate; valid: {valid}'
            raise MechanismError(mechanism.name, 'pose', reason)
    legs = legs_of(mechanism)
    if legs is None or not by_pose(mechanism):
        return joined([
            _defined(mechanism, dict(zip(names, map(float, row), strict=True)), failures)
            for row in values
        ])
    moves = np.zeros((len(values), 6))
    moves[:, [COORDINATES.index(name) for name in names]] = values
    batch = Batch(mechanism, legs, failures)
    return joined([
        _measured(batch, moves[start : start + BATCH]) for start in range(0, len(moves), BATCH)
    ])


def by_pose(mechanism: Mechanism) -> bool:
    """Return whether many poses of ``mechanism`` are measured together.

    Coordinates outside the task are chosen by the definition: then those in it are no pose.
    """
    return legs_of(mechanism) is not None and len(mechanism.task.coordinates) == len(COORDINATES)


def measured(post: PostFailure) -> PoseMeasures:
    """Return the measures of the one pose of ``post``, by definition."""
    mechanism, found = post.rows.mechanism, post.next_failure
    _, smallest, condition = motion_quality(post)
    values = post.configuration.actuator_values
    return PoseMeasures(
        found.position[None], found.torque[None], found.hard[None],
        np.array([smallest]), np.array([condition]), values[None],
        np.array([_all_tolerable(post)]),
        within_strokes(mechanism, values[None], post.failures),
    )


def within_strokes(
    mechanism: Mechanism, values: FloatArray, failures: FailureSet
) -> BoolArray:
    """Return at which of the ``values`` (B, N) all drives of ``mechanism`` are within strokes.

    Drives in struts that are lost by ``failures`` do not count; NaN is outside.
    """
    low, high = mechanism.position_limits.T
    held = np.array([one.strut not in failures.lost for one in mechanism.actuators])
    slack = OVERSHOOT * np.where(np.isfinite(high - low), high - low, 0.0)
    inside = (values >= low - slack) & (values <= high + slack)
    return np.asarray((inside | ~held).all(axis=1))


def _defined(
    mechanism: Mechanism, pose: dict[str, float], failures: FailureSet
) -> PoseMeasures:
    """Return the measures at one ``pose`` by definition; NaN where the loops do not close."""
    try:
        return measured(after(mechanism, failures, pose=pose))
    except ClosureError:
        return _nowhere(mechanism, 1)


def _nowhere(mechanism: Mechanism, count: int) -> PoseMeasures:
    drives, struts = len(mechanism.actuators), len(mechanism.struts)
    shapes = ((drives,), (drives,), (struts,), (), (), (drives,))
    p, t, h, sigma, condition, values = (np.full((count, *shape), np.nan) for shape in shapes)
    tolerable, reachable = np.zeros((2, count), dtype=np.bool_)
    return PoseMeasures(p, t, h, sigma, condition, values, tolerable, reachable)


def _all_tolerable(post: PostFailure) -> bool:
    """Return whether ``post`` and every single failure after it are tolerable.

    A measure above 0 says so; one of 0 may belong to drives in series, which move no platform.
    """
    if not is_tolerable(post.rows, post.present):
        return False
    mechanism, found = post.rows.mechanism, post.next_failure
    for mode, names, values in (
        (FailureMode.POSITION, mechanism.actuator_names, found.position),
        (FailureMode.TORQUE, mechanism.actuator_names, found.torque),
        (FailureMode.HARD, mechanism.strut_names, found.hard),
    ):
        for name, value in zip(names, values, strict=True):
            if value == 0.0:
                further = post.failures.and_also(mechanism, Failure(mode, name))
                if not is_tolerable(post.rows, differential_kinematics(post.rows, further)):
                    return False
    return True


def _filled(
    result: PoseMeasures, batch: Batch, rows: FloatArray, closed: IntArray
) -> BoolArray:
    """Put what ``rows`` (b, N, 6) say of the poses ``closed`` (b,) into ``result``.

    Returns which of them are good to all digits; the others are left as they are.
    """
    count, spare, active = int(batch.active.sum()), batch.spare, batch.active
    if batch.failures.stuck or count < len(COORDINATES) or not len(closed):
        return np.zeros(len(closed), dtype=np.bool_)
    found = batch.factored(rows)
    squares = found.mapping**2
    lengths = squares.sum(axis=2)
    # As many drives as coordinates: t is 0, and all of T's rows have the length 1.
    redundant = count > len(COORDINATES)
    torque = np.sqrt(np.maximum(1.0 - lengths, 0.0)) * redundant
    position = np.sqrt(squares[:, :, :spare].sum(axis=2) / lengths)
    # J_m is the inverse of the last block, transposed.
    block = found.scale[:, spare:, None] * found.lower[:, spare:, spare:]
    sigma = np.sqrt(np.abs(np.linalg.eigvalsh(block @ np.swapaxes(block, 1, 2))))
    smallest = np.ones(len(closed))
    for measure, there in ((torque, redundant), (position, spare)):
        if there:
            smallest = np.minimum(smallest, measure.min(axis=1))
    sine = np.diagonal(found.lower, axis1=1, axis2=2).min(axis=1)
    sure = found.regular & (smallest * sine**2 > SURE) & (sigma[:, 0] > 1e-3 * sigma[:, -1])
    drives = np.full((len(closed), len(active)), np.nan)
    drives[:, active] = torque
    # Without structure a strut that is lost is its drive set free; a free one holds nothing.
    hard = np.where(active | ~batch.there, drives, 1.0)[:, batch.drive_of]
    good = closed[sure]
    result.torque[good], result.hard[good] = drives[sure], hard[sure]
    result.position[np.ix_(good, np.flatnonzero(active))] = position[sure]
    result.smallest_singular_value[good] = 1.0 / sigma[sure, -1]
    result.condition_number[good] = sigma[sure, -1] / sigma[sure, 0]
    result.tolerable[good] = redundant and spare > 0
    return np.asarray(sure)


def _measured(batch: Batch, moves: FloatArray) -> PoseMeasures:
    """Return the measures of ``batch`` at displacements ``moves`` (B, 6) from home."""
    result = _nowhere(batch.mechanism, len(moves))
    values, rows = batch.solved(moves)
    result.actuator_values[:] = values
    result.reachable[:] = within_strokes(batch.mechanism, values, batch.failures)
    closed = np.flatnonzero(np.isfinite(values[:, batch.there]).all(axis=1))
    sure = _filled(result, batch, rows[closed], closed)
    for place in closed[~sure]:
        found = measured(batch.defined(values[place], rows[place]))
        for one in fields(PoseMeasures):
            getattr(result, one.name)[place] = getattr(found, one.name)[0]
    return result
