# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The measures of all single and double further failures, for any number of struts.

Position and torque come from the closed forms (docs/theory.md, eq. 21) where these are accurate,
from the definitions where they are not: next to dependent rows of T and next to 0, where it also
has to be decided what is 0. The hard measure of each strut needs only that its rows are taken
out of two small decompositions: with ``A = Q R`` and the strut's rows ``Q_i = U S W^t``

    A without the strut's rows  =  (orthogonal) (1 - W (1 - sqrt(1 - S^2)) W^t) R,

6 x 6 however many struts there are.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fault_tolerance.compiled.activation import Active
from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    differential_kinematics,
    failed_parts,
)
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.few_measures import position_of_few, torque_of_few
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.subspaces import manipulability, null_space, range_basis
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.attachment import attachment_of
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.linear_algebra import singular_values
from fault_tolerance.tolerances import RANK_TOLERANCE

# Closed forms of which more than this share cancels have lost more than ten digits of sixteen.
_CANCELLED = 1e-6
# Rows of T shorter than this make p a quotient of small numbers.
_SHORT = 1e-4
# A strut that carries this much of a direction alone cannot be taken out of the decomposition.
_ALONE = 1.0 - 1e-6
_AT_A_TIME = 4096
# Actuators up to which pairs are taken from minors.
_FEW = 16
_NONE = np.zeros(0, dtype=np.intp)


def position_measures(kinematics: DifferentialKinematics, sets: IntArray) -> FloatArray:
    """Return p (q,) of position failures of the actuators at the places ``sets`` (q, f) each.

    By definition (eq. 14), all at a time.
    """
    if not len(sets):
        return np.zeros(0)
    major = kinematics.major
    order, scale = len(major), float(singular_values(major).max(initial=0.0))
    result = np.zeros(len(sets))
    nominal = manipulability(major, order, scale)
    if nominal == 0.0:
        return result
    for part in _parts(len(sets)):
        _, sigma, right = np.linalg.svd(kinematics.mapping[sets[part]])
        ranks = (sigma > RANK_TOLERANCE).sum(axis=1)
        for rank in np.unique(ranks).tolist():
            chosen = np.flatnonzero(ranks == rank)
            unlocked = np.swapaxes(right[chosen, rank:], 1, 2)
            left = _manipulabilities(major @ unlocked, order, scale)
            result[part][chosen] = left / nominal
    return result


def torque_measures(kinematics: DifferentialKinematics, sets: IntArray) -> FloatArray:
    """Return t (q,) of torque failures of the actuators at the places ``sets`` (q, f) each.

    By definition (eq. 15), some at a time.
    """
    if not len(sets):
        return np.zeros(0)
    mapping = kinematics.mapping
    result = np.zeros(len(sets))
    at_a_time = max(1, 4 * _AT_A_TIME // max(len(mapping), 1))
    for part in _parts(len(sets), at_a_time):
        remaining = np.repeat(mapping[None], len(sets[part]), axis=0)
        # What has failed contributes nothing, as if its row were gone.
        np.put_along_axis(remaining, sets[part][:, :, None], 0.0, axis=1)
        result[part] = _manipulabilities(remaining, kinematics.mobility, 1.0)
    return result


def single_measures(kinematics: DifferentialKinematics) -> tuple[FloatArray, FloatArray]:
    """Return p and t of every actuator, (N,) each; NaN for those that do not drive."""
    return _single_measures(kinematics, _spare(kinematics))


def _single_measures(
    kinematics: DifferentialKinematics, spare: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    mapping = kinematics.mapping
    position, torque = np.full((2, len(mapping)), np.nan)
    driving = np.flatnonzero(kinematics.active)
    moved = np.einsum('ij,ij->i', mapping, mapping)[driving]
    still = 1.0 - moved
    torque[driving] = np.sqrt(np.maximum(still, 0.0))
    doubtful = driving[still < _CANCELLED]
    torque[doubtful] = torque_measures(kinematics, doubtful[:, None])
    if spare is None:
        position[driving] = 0.0
        return position, torque
    kept = np.einsum('ij,ij->i', spare, spare)[driving]
    clear = moved > _SHORT**2
    share = kept / np.where(clear, moved, 1.0)
    position[driving] = np.minimum(np.sqrt(share), 1.0)
    if spare.shape[1] == 0:
        position[driving[clear]] = 0.0
    doubtful = driving[~clear | ((share < _CANCELLED) & (spare.shape[1] > 0))]
    position[doubtful] = position_measures(kinematics, doubtful[:, None])
    return position, torque


def pair_measures(kinematics: DifferentialKinematics) -> tuple[FloatArray, FloatArray]:
    """Return p and t of every pair of actuators, (N, N) each, symmetric.

    The diagonal repeats the single measures; NaN for actuators that do not drive.
    """
    if len(kinematics.mapping) <= _FEW:
        return _pairs_of_few(kinematics)
    mapping, spare = kinematics.mapping, _spare(kinematics)
    count = len(mapping)
    position, torque = np.zeros((2, count, count))
    singles = _single_measures(kinematics, spare)
    moved = np.einsum('ij,ij->i', mapping, mapping)
    kept = np.zeros(count) if spare is None else np.einsum('ij,ij->i', spare, spare)
    doubtful: list[tuple[IntArray, IntArray]] = []
    for rows in _parts(count, max(1, 64 * _AT_A_TIME // count)):
        squared = (mapping[rows] @ mapping.T) ** 2
        t_squared = np.multiply.outer(1.0 - moved[rows], 1.0 - moved) - squared
        torque[rows] = np.sqrt(np.maximum(t_squared, 0.0))
        unclear = [t_squared < _CANCELLED]
        if spare is not None:
            size = np.multiply.outer(moved[rows], moved)
            both = size - squared
            unclear.append((both <= _CANCELLED * size) | (size <= _SHORT**4))
            if spare.shape[1] > 1:  # otherwise two independent drives take all there is to spare
                own = (spare[rows] @ spare.T) ** 2
                left = np.multiply.outer(kept[rows], kept) - own
                unclear[1] |= left <= _CANCELLED * size
                ratio = np.divide(left, both, out=np.zeros_like(left), where=~unclear[1])
                position[rows] = np.minimum(np.sqrt(ratio), 1.0)
        doubtful += [_pairs(mask, rows.start, kinematics) for mask in unclear]

    for place, pairs in enumerate(doubtful):
        first, second = pairs
        if not len(first):
            continue
        of_torque = spare is None or place % 2 == 0
        if of_torque:
            # Where one alone is fatal, so are both.
            alone = singles[1]
            open_ = (alone[first] > 0.0) & (alone[second] > 0.0)
            values, found = torque, np.zeros(len(first))
            sets = np.stack([first[open_], second[open_]], axis=1)
            found[open_] = torque_measures(kinematics, sets)
        else:
            values, found = position, position_measures(kinematics, np.stack(pairs, axis=1))
        values[first, second] = values[second, first] = found
    for values, alone in zip((position, torque), singles, strict=True):
        values[~kinematics.active], values[:, ~kinematics.active] = np.nan, np.nan
        np.fill_diagonal(values, alone)
    return position, torque


def _pairs_of_few(kinematics: DifferentialKinematics) -> tuple[FloatArray, FloatArray]:
    count, active = len(kinematics.mapping), kinematics.active
    driving = np.flatnonzero(active)
    mapping = kinematics.mapping
    if len(driving) < count:
        mapping = mapping[driving]
    position, doubtful = position_of_few(kinematics, mapping)
    torque = torque_of_few(mapping)
    if np.logical_or.reduce(doubtful, None):
        first, second = np.nonzero(doubtful)
        pair, alone = first < second, first == second
        first, second = driving[first], driving[second]
        sets = np.stack([first[pair], second[pair]], axis=1)
        values = np.zeros((count, count))
        values[sets[:, 0], sets[:, 1]] = position_measures(kinematics, sets)
        values += values.T
        values[first[alone], first[alone]] = position_measures(kinematics, first[alone, None])
        position[doubtful] = values[first, second]
    if len(driving) == count:
        return position, torque
    whole = np.full((2, count, count), np.nan)
    whole[0][np.ix_(driving, driving)] = position
    whole[1][np.ix_(driving, driving)] = torque
    return whole[0], whole[1]


def hard_measures(
    rows: StrutRows, failures: FailureSet, present: DifferentialKinematics
) -> FloatArray:
    """Return h (s,) of the loss of each strut after ``failures``; NaN for those lost already.

    Parameters
    ----------
    rows : StrutRows
    failures : FailureSet
        Those present already.
    present : DifferentialKinematics
        With them.
    """
    mechanism, kernels = rows.mechanism, Active.kernels
    if (
        kernels is not None
        and rows.actuator_rows is not None
        and mechanism.rates_alike
        and len(mechanism.actuators) <= _FEW
    ):
        part = failed_parts(mechanism, failures)
        return kernels.hard_of_few(  # type: ignore[no-any-return]
            rows.structure, rows.structure_strut, rows.actuator_rows,
            chains_of(mechanism).places[0], part.attachment.attached, part.stuck, part.driving,
            float(rows.rate_scale[0]), rows.twist_scale, rows.task_rows, rows.compliance,
            present.jacobian,
        )
    result = np.full(len(mechanism.struts), np.nan)
    attached = np.flatnonzero(attachment_of(mechanism, failures.lost).attached)
    basis = range_basis(present.jacobian)
    before = manipulability(present.jacobian, basis.shape[1])
    open_ = attached
    if rows.actuator_rows is not None and not failures.stuck:
        after, open_ = _without_each(rows, present, attached, basis)
        result[attached] = np.where(after > 0.0, before / np.where(after > 0.0, after, 1.0), 0.0)
    for place in open_.tolist():
        further = _with_lost(rows, failures, mechanism.strut_names[place])
        kinematics = differential_kinematics(rows, further)
        left = 0.0
        if kinematics.stable:
            left = manipulability(basis.T @ kinematics.jacobian, basis.shape[1])
        result[place] = before / left if left > 0.0 else 0.0
    return result


def _without_each(
    rows: StrutRows, present: DifferentialKinematics, attached: IntArray, basis: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return w_r(P_J J^) without each of the struts ``attached``, and the struts left open."""
    assert rows.actuator_rows is not None
    count = len(rows.mechanism.struts)
    place = {name: index for index, name in enumerate(rows.mechanism.strut_names)}
    owners = np.array([place[one.strut] for one in rows.mechanism.actuators], dtype=np.intp)
    mine = np.isin(rows.structure_strut, attached)
    structure, alone = _reduced(rows.structure[mine], rows.structure_strut[mine], count)
    held = np.isin(owners, attached)
    driving = np.flatnonzero(present.active)
    drives, alone_too = _reduced(rows.actuator_rows[driving], owners[driving], count)
    open_ = attached[(alone | alone_too)[attached]]
    result = np.zeros(len(attached))
    order = basis.shape[1]
    task = basis.T @ (np.eye(len(rows.twist_scale))[rows.task_rows] / rows.twist_scale)
    _, sigma, right = np.linalg.svd(structure[attached])
    threshold = np.maximum(rows.compliance, RANK_TOLERANCE * sigma.max(axis=1, initial=0.0))
    kept = (sigma > threshold[:, None]).sum(axis=1)
    for barred in np.unique(kept).tolist():
        chosen = np.flatnonzero(kept == barred)
        twists = np.swapaxes(right[chosen, barred:], 1, 2)
        rates = drives[attached[chosen]] @ twists
        _, gains, mixed = np.linalg.svd(rates)
        # Whether the drives that are left feel every motion: their yardstick is that of
        # `differential_kinematics`, 1 or what all rates come to.
        width = twists.shape[2]
        if width == 0:
            result[chosen] = 1.0 if order == 0 else 0.0
            continue
        scale = np.maximum(1.0, _yardstick(rows, held, attached[chosen], owners, twists))
        stable = gains[:, -1] > RANK_TOLERANCE * scale
        gains = np.where(stable[:, None], gains, 1.0)
        jacobian = task @ twists @ (np.swapaxes(mixed, 1, 2) / gains[:, None, :])
        found = _manipulabilities(jacobian, order, None)
        result[chosen] = np.where(stable, found, 0.0)
    return result, open_


def _yardstick(
    rows: StrutRows,
    held: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
    struts: IntArray,
    owners: IntArray,
    twists: FloatArray,
) -> FloatArray:
    """Return the size of all rates along ``twists`` (q, 6, b) without one strut each, (q,)."""
    assert rows.actuator_rows is not None
    scaled = rows.actuator_rows * rows.rate_scale[:, None]
    scaled[~held] = 0.0
    grams = np.zeros((len(rows.mechanism.struts), 6, 6))
    np.add.at(grams, owners, scaled[:, :, None] * scaled[:, None, :])
    left = grams.sum(axis=0) - grams[struts]
    squares = np.einsum('qib,qij,qjb->q', twists, left, twists)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def _reduced(
    rows: FloatArray, owners: IntArray, count: int
) -> tuple[FloatArray, np.ndarray[tuple[int, ...], np.dtype[np.bool_]]]:
    """Return 6 x 6 matrices (s, 6, 6) that are ``rows`` (g, 6) without those of each strut.

    Up to an orthogonal matrix on the left. And where this is not accurate, (s,): for struts that
    alone bear a direction.
    """
    basis, triangle = np.linalg.qr(np.vstack([rows, np.zeros((6, rows.shape[1]))]))
    basis = basis[: len(rows)]
    most = int(np.bincount(owners, minlength=1).max(initial=0))
    own = np.zeros((count, most, 6))
    order = np.argsort(owners, kind='stable')
    first = np.searchsorted(owners[order], np.arange(count))
    own[owners[order], np.arange(len(order)) - first[owners[order]]] = basis[order]
    if most == 0:
        return np.repeat(triangle[None], count, axis=0), np.zeros(count, dtype=np.bool_)
    _, sigma, right = np.linalg.svd(own, full_matrices=False)
    alone = sigma.max(axis=1, initial=0.0) > _ALONE
    shrink = 1.0 - np.sqrt(np.maximum(1.0 - sigma**2, 0.0))
    factors = np.eye(6) - np.swapaxes(right, 1, 2) @ (shrink[..., None] * right)
    return factors @ triangle, alone


def _with_lost(rows: StrutRows, failures: FailureSet, strut: str) -> FailureSet:
    """Return ``failures`` with one more strut lost."""
    mechanism = rows.mechanism
    gone = mechanism.actuators_of(strut)
    names = {*failures.lost, strut}
    return FailureSet(
        tuple(name for name in failures.stuck if name not in gone),
        tuple(name for name in failures.free if name not in gone),
        tuple(name for name in mechanism.strut_names if name in names),
    )


def _spare(kinematics: DifferentialKinematics) -> FloatArray | None:
    """Return T N, (N, n - m), with N a basis of the null space of J_m; None if rank J_m < m."""
    major = kinematics.major
    free = null_space(major)
    if free.shape[1] != kinematics.mobility - len(major):
        return None
    return kinematics.mapping @ free


def _manipulabilities(matrices: FloatArray, order: int, scale: float | None) -> FloatArray:
    """Return w_r of each of ``matrices`` (q, r, c): as `manipulability`."""
    if order == 0:
        return np.ones(len(matrices))
    if order > min(matrices.shape[1:]):
        return np.zeros(len(matrices))
    sigma = np.linalg.svd(matrices, compute_uv=False)
    yardstick = sigma[:, 0] if scale is None else scale
    full = (sigma[:, order - 1] > RANK_TOLERANCE * yardstick) & (yardstick > 0.0)
    return np.where(full, np.prod(sigma[:, :order], axis=1), 0.0)


def _pairs(
    mask: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
    start: int,
    kinematics: DifferentialKinematics,
) -> tuple[IntArray, IntArray]:
    """Return the pairs of driving actuators that ``mask`` (r, N) marks, the first one smaller.

    Its rows are those from ``start`` on of a square.
    """
    if not mask.any():
        return _NONE, _NONE
    first, second = np.nonzero(mask)
    first = first + start
    active = kinematics.active
    chosen = (first < second) & active[first] & active[second]
    return first[chosen], second[chosen]


def _parts(count: int, at_a_time: int = _AT_A_TIME) -> Iterator[slice]:
    """Yield slices that go through ``count`` things, some at a time."""
    for start in range(0, count, at_a_time):
        yield slice(start, min(start + at_a_time, count))
