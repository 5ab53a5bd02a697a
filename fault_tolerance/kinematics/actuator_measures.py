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
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray, frozen
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
    driving = int(np.count_nonzero(active))
    products = mapping.dot(mapping.T)
    crossed = products * products
    position = _position(kinematics, products.diagonal(), crossed)
    torque = _torque(products, crossed, driving - kinematics.mobility)
    for values in (position, torque):
        if driving < len(active):
            values[~active] = values[:, ~active] = np.nan
        frozen(np.sqrt(values, values))
    return ActuatorMeasures(position, torque)


def _position(
    kinematics: DifferentialKinematics, squares: FloatArray, crossed: FloatArray
) -> FloatArray:
    """Return p^2 (N, N) from the squares (N,) of the rows of T, and of their products (N, N)."""
    major, active, count = kinematics.major, kinematics.active, len(squares)
    order, position = len(major), np.zeros((count, count))
    _, sigma, right = decomposed(major)
    if len(sigma) < order or sigma[-1] <= RANK_TOLERANCE * sigma[0]:
        return position
    # By definition where rows are nearly dependent or hardly there, and where p may count as 0:
    # J_m keeps at least p times its smallest singular value.
    small = float(10.0 * RANK_TOLERANCE * sigma[0] / sigma[-1]) ** 2
    squares = np.maximum(squares, SHORT_ROW**4)
    largest = _outer(squares)
    unsure = crossed >= (1.0 - CANCELLED) * largest
    spare = kinematics.mapping.dot(right[order:].T)
    products = spare.dot(spare.T)
    single = products.diagonal() / squares
    if spare.shape[1] > 1:
        position = (_outer(products.diagonal()) - products * products) / largest
        position.flat[:: count + 1] = single
        lost = position <= CANCELLED
        if np.count_nonzero(lost):
            units = spare / np.sqrt(squares)[:, None]
            position = _recovered(position, lost, units, ROUNDING_TOLERANCE)
        position /= np.maximum(1.0 - crossed / largest, CANCELLED)
        unsure |= (position > 0.0) & (position <= small)
    low = single <= small
    if np.count_nonzero(low):
        # What is but rounding errors is 0 by definition too, without asking.
        single *= single > ROUNDING_TOLERANCE**2
        low &= single > 0.0
    position.flat[:: count + 1], unsure.flat[:: count + 1] = single, low
    short = active & (squares <= SHORT_ROW**2)
    if np.count_nonzero(short):
        unsure[short] = unsure[:, short] = True
    if np.count_nonzero(unsure):
        pairs = np.argwhere(unsure & active & active[:, None])
        first, second = pairs.T
        for sets in (pairs[first == second, :1], pairs[first < second]):
            if len(sets):
                i, j = sets[:, 0], sets[:, -1]
                position[i, j] = position[j, i] = position_measures(kinematics, sets) ** 2
    return position


def _torque(products: FloatArray, crossed: FloatArray, redundancy: int) -> FloatArray:
    """Return t^2 (N, N) from the products (N, N) of the rows of T, and the squares of these.

    The rows of B = 1 - T T' are in a space of dimension ``redundancy``. B projects, so it has the
    products of its rows.
    """
    squares = 1.0 - products.diagonal()
    areas = _outer(squares) - crossed if redundancy > 1 else np.zeros(crossed.shape)
    areas.flat[:: len(areas) + 1] = squares
    lost = areas <= CANCELLED
    if np.count_nonzero(lost):
        barred = -products
        barred.flat[:: len(areas) + 1] = squares
        # In less than two dimensions no area is lost: all are 0.
        areas = _recovered(areas, lost & (redundancy > 1), barred, RANK_TOLERANCE)
    return areas


def _outer(values: FloatArray) -> FloatArray:
    """Return the products (N, N) of all pairs of ``values`` (N,)."""
    result: FloatArray = values[:, None].dot(values[None])
    return result


def _recovered(areas: FloatArray, lost: BoolArray, rows: FloatArray, zero: float) -> FloatArray:
    """Return the squares ``areas`` (N, N), from ``rows`` (N, c) where they are ``lost`` (N, N).

    Those come from what is left of one row beside the other, and are 0 where the smaller singular
    value of the two is not above ``zero``. The squares of the lengths are on the diagonal.
    """
    products, zero = rows.dot(rows.T), zero**2
    squares = products.diagonal()
    first, second = lost.nonzero()
    for part in _parts(len(first), rows.shape[1]):
        i, j = first[part], second[part]
        size, other = squares.take(i), squares.take(j)
        share = products[i, j] / np.maximum(size, zero)
        rest = rows.take(j, 0) - share[:, None] * rows.take(i, 0)
        found = size * (rest * rest).sum(1)
        areas[i, j] = found * (found > zero * (size + other))
    # Not the same to the last digit from both sides.
    areas = np.minimum(areas, areas.T)
    areas.flat[:: len(areas) + 1] = squares * (squares > zero)
    return areas


def _parts(count: int, numbers: int) -> Iterator[slice]:
    """Yield slices that go through ``count`` matrices of so many ``numbers``, some at a time."""
    step = max(1, _MOST_NUMBERS // max(numbers, 1))
    for start in range(0, count, step):
        yield slice(start, min(start + step, count))
