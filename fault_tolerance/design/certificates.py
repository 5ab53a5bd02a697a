# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Cells of poses all of which are proven fault tolerant and within strokes.

By how much the rows of the drives can differ from those at the centre of a cell is bounded; so,
by Weyl's inequality, are singular values and with them the measures (docs/design.md). A cell
where that does not decide is halved along every axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from fault_tolerance.design.batches import Batch
from fault_tolerance.design.legs import CRANK, LEG, Legs, legs_of
from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.task import COORDINATES

HALVINGS = 8
"""How often a cell is halved at most, along all axes together."""

_ROUNDING = 1e-9


class Proof(NamedTuple):
    """What is proven of each of c cells."""

    share: FloatArray
    """(c,): of its volume, where every next single failure is tolerable, within strokes."""
    least: FloatArray
    """(c,): what p, t and h of every next single failure are nowhere below; 0 without a proof."""

    def __repr__(self) -> str:
        return f'Proof({int((self.share == 1.0).sum())} of {len(self.share)} cells)'


def certifiable(mechanism: Mechanism, failures: FailureSet) -> Batch:
    """Return ``mechanism`` with ``failures`` as its rows are bounded here.

    MechanismError if they cannot be.
    """
    legs = legs_of(mechanism)
    reason = ''
    if legs is None:
        reason = 'the struts are not all UPS, SPS, PUS, PSS, RUS or RSS'
    elif len(mechanism.task.coordinates) < len(COORDINATES):
        reason = 'the task does not have all six coordinates'
    elif failures.stuck:
        reason = 'a drive is stuck'
    if legs is None or reason:
        raise MechanismError(mechanism.name, '', f'cells cannot be certified: {reason}')
    return Batch(mechanism, legs, failures)


def proven(batch: Batch, names: Sequence[str], centres: FloatArray, half: FloatArray) -> Proof:
    """Return what holds all over cells of poses of ``batch``.

    The cells are boxes of the coordinates ``names`` (k) around ``centres`` (c, k) with half sides
    ``half`` (k,), radians of the rotation vector and metres; other coordinates are 0.
    """
    places = [COORDINATES.index(name) for name in names]
    cells, share, least = np.arange(len(centres)), np.zeros(len(centres)), np.full(
        len(centres), np.inf
    )
    corners = np.array(list(product((-0.5, 0.5), repeat=len(names))))
    for level in range(HALVINGS // len(names) + 1):
        moves = np.zeros((len(centres), 6))
        moves[:, places] = centres
        sides = np.zeros(6)
        sides[places] = half / 2**level
        lower, outside = _lower_bounds(batch, moves, sides)
        good = lower > 0.0
        np.add.at(share, cells[good], len(corners) ** -float(level))
        np.minimum.at(least, cells[good], lower[good])
        open_ = ~good & ~outside
        centres = (centres[open_, None] + corners * (half / 2**level)).reshape(-1, len(names))
        cells = np.repeat(cells[open_], len(corners))
        if not len(cells):
            break
    return Proof(share, np.where(share == 1.0, least, 0.0))


def _lower_bounds(
    batch: Batch, moves: FloatArray, sides: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return a bound (c,) of all measures in each cell, and which cells are out of reach (c,).

    Of the cells around ``moves`` (c, 6) with half sides ``sides`` (6,); 0 without a proof.
    """
    values, rows = batch.solved(moves)
    force = np.linalg.norm(rows[:, :, 3:], axis=2)
    with np.errstate(invalid='ignore', divide='ignore', over='ignore'):
        change = _changes(batch, values, force, sides)
        low, high = batch.mechanism.position_limits.T
        inside = (values - change.value >= low) & (values + change.value <= high)
        outside = (values + change.value < low) | (values - change.value > high)
        inside, outside = inside[:, batch.there].all(axis=1), outside[:, batch.there].any(axis=1)
        lower = np.zeros(len(moves))
        asked = np.flatnonzero(inside)
        if len(asked) and batch.spare and batch.active.sum() > len(COORDINATES):
            parts = change.moment[asked], change.force[asked]
            lower[asked] = _measure_bounds(batch, rows[asked], *parts)
    return lower, outside


class _Change(NamedTuple):
    """How far drive values (c, N), and forces and moments of their rows (c, N), can change."""

    value: FloatArray
    force: FloatArray
    moment: FloatArray


def _changes(
    batch: Batch, values: FloatArray, force: FloatArray, sides: FloatArray
) -> _Change:
    """Return how far a cell with half ``sides`` (6,) is from its centre at most.

    There the drives are at ``values`` (c, N), with rows whose force is ``force`` (c, N) long.
    """
    legs, order = batch.legs, np.argsort(batch.legs.actuator)
    arm = np.linalg.norm(legs.upper - legs.origin, axis=1)[order]
    turned = arm * float(np.linalg.norm(sides[:3]))
    moved = turned + float(np.linalg.norm(sides[3:]))
    is_leg = (legs.kind == LEG)[order]
    found = [
        np.where(is_leg, one, other)
        for one, other in zip(
            _leg_changes(legs, order, values, force, moved),
            _rod_changes(legs, order, force, moved), strict=True,
        )
    ]
    turns, most = found[0], found[1]
    return _Change(most * moved, turns, arm * turns + turned * (force + turns))


def _leg_changes(
    legs: Legs, order: IntArray, values: FloatArray, force: FloatArray, moved: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return by how much the forces of legs change, and how long they are at most."""
    e, d = (legs.upper - legs.lower)[order], legs.axis[order]
    along = (e * d).sum(1)
    slope = np.abs(values + along)
    length = force * slope
    least = np.sqrt(slope**2 - 2.0 * length * moved + moved**2)
    most = np.sqrt(slope**2 + 2.0 * length * moved + moved**2)
    by = moved / least + length * np.maximum(slope - least, most - slope) / (slope * least)
    # A drive along the line of force: the row is a unit vector.
    straight = np.abs((e * e).sum(1) - along**2) <= _ROUNDING * (e * e).sum(1)
    by = np.where(straight, 2.0 * moved / (2.0 * length - moved), by)
    by = np.where(length > moved, by, np.inf)
    return by, np.where(straight, 1.0 + _ROUNDING, force + by)


def _rod_changes(
    legs: Legs, order: IntArray, force: FloatArray, moved: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return by how much the forces of rods change, and how long they are at most.

    ``F . v_1`` is nowhere below half of what it is at the centre, if it changes by less than the
    other half while it is not: then it cannot get there.
    """
    length = np.linalg.norm(legs.upper - legs.lower, axis=1)[order]
    offset, cranks = (legs.lower - legs.pivot)[order], (legs.kind == CRANK)[order]
    speed = np.where(cranks, np.linalg.norm(np.cross(legs.axis[order], offset), axis=1), 1.0)
    bend = np.where(cranks, speed, 0.0)
    slope = length / force

    def off(least: FloatArray) -> FloatArray:
        driven = length * moved / least
        return np.asarray(length * bend * driven + (moved + speed * driven) * speed)

    half = off(slope / 2.0)
    least = slope - np.where(half < slope / 2.0, half, np.nan)
    by_slope = off(least)
    change = (moved + speed * length * moved / least) / least
    by = change + length * by_slope / (slope * least)
    return np.where(np.isfinite(by), by, np.inf), length / least


def _measure_bounds(
    batch: Batch, rows: FloatArray, moment: FloatArray, force: FloatArray
) -> FloatArray:
    """Return a bound (c,) of p and t of all drives in cells with ``rows`` (c, N, 6) amid them.

    Anywhere in a cell, moments and forces of the rows differ by ``moment`` and ``force`` (c, N).
    """
    found, spare = batch.factored(rows), batch.spare
    free = np.linalg.norm(found.mapping[:, :, :spare], axis=2)
    lengths = np.linalg.norm(found.mapping, axis=2)
    torque = np.sqrt(np.maximum(1.0 - lengths**2, 0.0))
    # A - A_c, times the inverse of L' at the centre, where A is T.
    unit = np.swapaxes(found.inverse, 1, 2) / found.scale[:, :, None]
    turning = np.array(batch.columns) < 3
    moment, force = moment[:, batch.active], force[:, batch.active]

    def shifts(columns: slice) -> tuple[FloatArray, FloatArray]:
        """Return bounds of the change of each row (c, a), and of all together (c,)."""
        turn, push = (
            np.linalg.norm(unit[:, chosen][:, :, columns], 2, axis=(1, 2))
            for chosen in (turning, ~turning)
        )
        by_row = moment * turn[:, None] + force * push[:, None]
        return by_row + _ROUNDING, np.linalg.norm(by_row, axis=1) + _ROUNDING

    each, whole = shifts(slice(None))
    some, part = shifts(slice(spare))
    t = (torque - whole[:, None]) / (1.0 + whole[:, None])
    p = (free - some) / (1.0 + part[:, None]) * (1.0 - whole[:, None]) / (lengths + each)
    lower = np.minimum(t, p).min(axis=1)
    good = found.regular & (whole < 1.0) & (lower > 0.0)
    return np.where(good, lower, 0.0)
