# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Measures p and t of any actuators, from J_m and T alone.

By definition (docs/theory.md, eq. 14-15), of one set of actuators or of many. Those of all single
actuators and of all pairs are lengths of rows and areas between two of them (eq. 21). Areas come
from products of the rows, and where these cancel from what is left of one row beside the other:
so they are good next to 0 too, and exactly 0 where the definition has no rank.
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
    singular_values,
)
from fault_tolerance.mechanism.arrays import FloatArray, IntArray, frozen
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.tolerances import (
    CANCELLED,
    RANK_TOLERANCE,
    ROUNDING_TOLERANCE,
    SHORT_ROW,
)

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
    position, torque = (values.diagonal().copy() for values in pair_measures(kinematics))
    return ActuatorMeasures(frozen(position), frozen(torque))


def pair_measures(kinematics: DifferentialKinematics) -> ActuatorMeasures:
    """Return p and t of every pair of actuators of ``kinematics``, (N, N) each (eq. 21).

    Single ones are on the diagonals.
    """
    mapping, active = kinematics.mapping, kinematics.active
    count, driving = len(active), int(np.count_nonzero(active))
    products = mapping.dot(mapping.T)
    position = _position(kinematics, np.sqrt(products.diagonal()))
    # B = 1 - T T': it projects, so its rows have the lengths t and the products B.
    barred = np.negative(products, out=products)
    barred.flat[:: count + 1] += 1.0
    torque = _areas(barred, barred, driving - kinematics.mobility, RANK_TOLERANCE)
    if driving < count:
        for values in (position, torque):
            values[~active] = values[:, ~active] = np.nan
    return ActuatorMeasures(frozen(position), frozen(torque))


def _position(kinematics: DifferentialKinematics, lengths: FloatArray) -> FloatArray:
    """Return p (N, N) of every pair of drives; ``lengths`` (N,) are of the rows of T."""
    major, active = kinematics.major, kinematics.active
    order, count = len(major), len(active)
    _, sigma, right = decomposed(major)
    if len(sigma) < order or sigma[-1] <= RANK_TOLERANCE * sigma[0]:
        return np.zeros((count, count))
    units = kinematics.mapping / np.maximum(lengths, SHORT_ROW)[:, None]
    spare = units.dot(right[order:].T)
    position = _areas(spare, spare.dot(spare.T), spare.shape[1], ROUNDING_TOLERANCE)
    cosines = units.dot(units.T)
    sines = 1.0 - cosines * cosines
    sines.flat[:: count + 1] = 1.0
    # Where rows are nearly dependent or hardly there, and where p may count as 0, by definition.
    unsure = sines <= CANCELLED
    short = lengths <= SHORT_ROW
    if np.count_nonzero(short):
        unsure[short] = unsure[:, short] = True
    if spare.shape[1] > 1:
        position /= np.sqrt(np.maximum(sines, CANCELLED))
    # J_m keeps at least p times its smallest singular value.
    unsure |= (position > 0.0) & (position <= 10.0 * RANK_TOLERANCE * float(sigma[0] / sigma[-1]))
    if np.count_nonzero(unsure):
        pairs = np.argwhere(unsure & active & active[:, None])
        first, second = pairs.T
        for sets in (pairs[first == second, :1], pairs[first < second]):
            places = sets[:, 0], sets[:, -1]
            position[places] = position[places[::-1]] = position_measures(kinematics, sets)
    return position


def _areas(rows: FloatArray, products: FloatArray, dimension: int, zero: float) -> FloatArray:
    """Return the areas (N, N) that two of ``rows`` span; on the diagonal the lengths of each.

    0 where the smaller singular value of the two is not above ``zero``. Given are the ``products``
    (N, N) of the rows, and the ``dimension`` of the space they are in.
    """
    squares, areas = (rows * rows).sum(1), np.zeros(products.shape)
    squares *= squares > zero**2
    if dimension > 1:
        areas = squares[:, None] * squares - products * products
        lost = areas <= CANCELLED
        lost.flat[:: len(rows) + 1] = False
        if np.count_nonzero(lost):
            first, second = lost.nonzero()
            for part in _parts(len(first), rows.shape[1]):
                i, j = first[part], second[part]
                one, rest, size = rows.take(i, 0), rows.take(j, 0), squares.take(i)
                share = (one * rest).sum(1) / np.maximum(size, zero**2)
                rest -= share[:, None] * one
                found = size * (rest * rest).sum(1)
                areas[i, j] = found * (found > zero**2 * (size + squares.take(j)))
            # Not the same to the last digit from both sides.
            areas = np.minimum(areas, areas.T)
    areas.flat[:: len(rows) + 1] = squares
    return np.sqrt(areas, out=areas)


def _parts(count: int, numbers: int) -> Iterator[slice]:
    """Yield slices that go through ``count`` matrices of so many ``numbers``, some at a time."""
    step = max(1, _MOST_NUMBERS // max(numbers, 1))
    for start in range(0, count, step):
        yield slice(start, min(start + step, count))
