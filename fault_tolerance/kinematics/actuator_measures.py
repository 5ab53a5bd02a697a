# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Measures p and t of any actuators, from J_m and T alone.

By definition (docs/theory.md, eq. 14-15), of one set of actuators or of many. Those of all single
actuators and of all pairs come from the Gram matrices of eq. 21. These subtract; where that costs
digits, and where it has to be decided whether a measure is 0, the definitions are taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.kinematics.subspaces import (
    manipulabilities,
    manipulability,
    null_space,
    rank_of,
    singular_values,
)
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray, frozen
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.tolerances import CANCELLED, RANK_TOLERANCE, SHORT_ROW

# Bound on the numbers in the matrices that are made at a time, so that memory is limited.
_MOST_NUMBERS = 1_000_000


class ActuatorMeasures(NamedTuple):
    """Measures of further failures of the actuators; NaN for those that do not drive."""

    position: FloatArray
    torque: FloatArray
    """(N,) or (N, N): p and t of every actuator, or of every pair: symmetric, single ones on the
    diagonal."""

    def __repr__(self) -> str:
        return f'ActuatorMeasures({" x ".join(str(each) for each in self.position.shape)})'


def position_measure(kinematics: DifferentialKinematics, stuck: Sequence[int]) -> float:
    """Return p for position failures of the actuators at the places ``stuck`` (eq. 14).

    ``w_m(J_m N) / w_m(J_m)`` with N a basis of the null space of their rows of T; 0 when a major
    coordinate of ``kinematics`` is lost.
    """
    major = kinematics.major
    order, scale = len(major), float(singular_values(major).max(initial=0.0))
    nominal = manipulability(major, order, scale)
    unlocked = null_space(kinematics.mapping[list(stuck)], 1.0)
    return manipulability(major @ unlocked, order, scale) / nominal if nominal > 0.0 else 0.0


def torque_measure(kinematics: DifferentialKinematics, free: Sequence[int]) -> float:
    """Return t for torque failures of the actuators at the places ``free`` (eq. 15).

    ``w_n(T_r)`` of the rows of ``kinematics`` that still drive; 0 when the platform is no longer
    held.
    """
    remaining = np.delete(kinematics.mapping, list(free), axis=0)
    return manipulability(remaining, kinematics.mobility, 1.0)


def position_measures(kinematics: DifferentialKinematics, sets: IntArray) -> FloatArray:
    """Return p (q,) of position failures of the actuators at the places ``sets`` (q, f) each.

    As `position_measure`, all at once for the same ``kinematics``.
    """
    major, mapping = kinematics.major, kinematics.mapping
    order, scale = len(major), float(singular_values(major).max(initial=0.0))
    nominal = manipulability(major, order, scale)
    result = np.zeros(len(sets))
    if nominal == 0.0:
        return result
    for part in _parts(len(sets), major.size + mapping.shape[1] ** 2):
        _, sigma, right = np.linalg.svd(mapping[sets[part]], full_matrices=False)
        locked = np.where((sigma > RANK_TOLERANCE)[..., None], right, 0.0)
        # J_m times the projection on the null space: the singular values of J_m N, and zeros.
        left = major - major @ np.swapaxes(locked, 1, 2) @ locked
        result[part] = manipulabilities(left, order, scale) / nominal
    return result


def torque_measures(kinematics: DifferentialKinematics, sets: IntArray) -> FloatArray:
    """Return t (q,) of torque failures of the actuators at the places ``sets`` (q, f) each.

    As `torque_measure`, all at once for the same ``kinematics``.
    """
    mapping = kinematics.mapping
    result = np.zeros(len(sets))
    for part in _parts(len(sets), mapping.size):
        remaining = np.repeat(mapping[None], len(sets[part]), axis=0)
        # A row of zeros contributes as much as one that is gone.
        np.put_along_axis(remaining, sets[part][:, :, None], 0.0, axis=1)
        result[part] = manipulabilities(remaining, kinematics.mobility, 1.0)
    return result


def single_measures(kinematics: DifferentialKinematics) -> ActuatorMeasures:
    """Return p and t of every single actuator of ``kinematics``, (N,) each."""
    return _single_measures(kinematics, *_spare(kinematics))


def pair_measures(kinematics: DifferentialKinematics) -> ActuatorMeasures:
    """Return p and t of every pair of actuators of ``kinematics``, (N, N) each.

    Single ones are on the diagonals.
    """
    active, (spare, least) = kinematics.active, _spare(kinematics)
    moved = kinematics.mapping @ kinematics.mapping.T
    shares, still = moved.diagonal(), 1.0 - moved.diagonal()
    size = np.multiply.outer(shares, shares)
    moved *= moved
    torque = np.multiply.outer(still, still) - moved
    cancelled = torque <= CANCELLED
    torque = np.sqrt(np.maximum(torque, 0.0))
    areas = size - moved
    position, doubtful = np.zeros_like(torque), np.zeros_like(cancelled)
    if spare is not None:
        doubtful = (areas <= CANCELLED * size) | (size <= SHORT_ROW**4)
        if spare.shape[1] > 1:  # otherwise two independent drives take all the freedom there is
            own = spare @ spare.T
            kept = np.multiply.outer(own.diagonal(), own.diagonal()) - own * own
            position = _root_of_ratio(kept, areas, doubtful)
            doubtful |= kept <= least * size
    alone = _single_measures(kinematics, spare, least)
    for values, unsure, measures, diagonal in (
        (position, doubtful, position_measures, alone.position),
        (torque, cancelled, torque_measures, alone.torque),
    ):
        first, second = np.nonzero(unsure)
        open_ = (first < second) & active[first] & active[second]
        pairs = np.stack([first[open_], second[open_]], axis=1)
        if len(pairs):
            found = measures(kinematics, pairs)
            values[pairs[:, 0], pairs[:, 1]] = values[pairs[:, 1], pairs[:, 0]] = found
        values[~active], values[:, ~active] = np.nan, np.nan
        np.fill_diagonal(values, diagonal)
    return ActuatorMeasures(frozen(position), frozen(torque))


def _single_measures(
    kinematics: DifferentialKinematics, spare: FloatArray | None, least: float
) -> ActuatorMeasures:
    """Return p and t of every single actuator, (N,) each; see `_spare`."""
    mapping, active = kinematics.mapping, kinematics.active
    moved = np.einsum('ij,ij->i', mapping, mapping)
    torque = np.sqrt(np.maximum(1.0 - moved, 0.0))
    position, doubtful = np.zeros_like(moved), np.zeros_like(active)
    if spare is not None:
        doubtful = moved <= SHORT_ROW**2
        if spare.shape[1]:
            kept = np.einsum('ij,ij->i', spare, spare)
            position = _root_of_ratio(kept, moved, doubtful)
            doubtful |= kept <= least * moved
    for values, unsure, measures in (
        (position, doubtful, position_measures),
        (torque, 1.0 - moved <= CANCELLED, torque_measures),
    ):
        places = np.flatnonzero(unsure & active)
        if len(places):
            values[places] = measures(kinematics, places[:, None])
        values[~active] = np.nan
    return ActuatorMeasures(frozen(position), frozen(torque))


def _spare(kinematics: DifferentialKinematics) -> tuple[FloatArray | None, float]:
    """Return what eq. 21 needs of J_m.

    Returns
    -------
    spare : (N, n - m) array or None
        T N with N a basis of the null space of J_m; None if rank J_m < m, where every p is 0.
    least : float
        Smaller squares of p may count as 0, or have lost digits: then by definition.
    """
    major = kinematics.major
    _, sigma, right = decomposed(major)
    order = len(major)
    if rank_of(sigma) < order:
        return None, 0.0
    # J_m keeps at least p times its smallest singular value.
    zero = 10.0 * RANK_TOLERANCE * float(sigma[0] / sigma[-1])
    return kinematics.mapping @ right[order:].T, max(CANCELLED, zero**2)


def _root_of_ratio(above: FloatArray, below: FloatArray, unless: BoolArray) -> FloatArray:
    """Return the root of ``above / below``, between 0 and 1; 0 where ``unless``."""
    share = np.divide(above, below, out=np.zeros_like(below), where=~unless)
    return np.sqrt(np.minimum(np.maximum(share, 0.0), 1.0))


def _parts(count: int, numbers: int) -> Iterator[slice]:
    """Yield slices that go through ``count`` matrices of so many ``numbers``, some at a time."""
    step = max(1, _MOST_NUMBERS // max(numbers, 1))
    for start in range(0, count, step):
        yield slice(start, min(start + step, count))
