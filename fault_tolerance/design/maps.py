# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Maps: what the next failure would leave, all over a grid of poses."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property, partial, reduce
from typing import Any

import numpy as np

from fault_tolerance.design.certificates import Proof, certifiable, proven
from fault_tolerance.design.grids import Grid
from fault_tolerance.design.pose_measures import PoseMeasures, by_pose, joined, pose_measures
from fault_tolerance.executors import Watch, mapped
from fault_tolerance.kinematics.failures import FailureLike, FailureSet, failure_set
from fault_tolerance.kinematics.measures import worst_failure
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import EQUAL_MEASURES

_AT_A_TIME, _AT_A_TIME_DEFINED, _CELLS_AT_A_TIME = 16384, 64, 1024


@dataclass(frozen=True, eq=False)
class ToleranceMap:
    """What the next single failure would leave of a mechanism, over a grid of poses."""

    mechanism: Mechanism
    grid: Grid
    failures: FailureSet
    """Present all over the map."""
    measures: PoseMeasures
    """Of the poses of the grid, the last axis fastest."""
    proof: Proof | None = None
    """Of the cells between the poses, where that was asked for."""

    def __repr__(self) -> str:
        return f'ToleranceMap({self.mechanism.name!r}, {" x ".join(map(str, self.grid.shape))})'

    @cached_property
    def position(self) -> FloatArray:
        """P of the worst position failure, over the grid; NaN where the loops do not close."""
        return self._worst(self.measures.position)

    @cached_property
    def torque(self) -> FloatArray:
        """T of the worst torque failure, over the grid."""
        return self._worst(self.measures.torque)

    @cached_property
    def hard(self) -> FloatArray:
        """H of the worst hard failure, over the grid."""
        return self._worst(self.measures.hard)

    @cached_property
    def worst(self) -> FloatArray:
        """The smallest of the three, over the grid; NaN where a pose is not reachable."""
        smallest = reduce(np.fmin, (self.position, self.torque, self.hard))
        return frozen(np.where(self.reachable, smallest, np.nan))

    @property
    def smallest_singular_value(self) -> FloatArray:
        """The smallest singular value of J_m, over the grid."""
        return self.measures.smallest_singular_value.reshape(self.grid.shape)

    @property
    def condition_number(self) -> FloatArray:
        """The condition number of J_m, over the grid."""
        return self.measures.condition_number.reshape(self.grid.shape)

    @property
    def tolerable(self) -> BoolArray:
        """Where every single further failure is tolerable, over the grid."""
        return self.measures.tolerable.reshape(self.grid.shape)

    @property
    def reachable(self) -> BoolArray:
        """Where the loops close and all drives are within their strokes, over the grid."""
        return self.measures.reachable.reshape(self.grid.shape)

    def volume_of(self, chosen: BoolArray) -> float:
        """Return the volume that the poses ``chosen``, over the grid, stand for."""
        return float(self.grid.weights[chosen].sum())

    def place(self, index: int) -> dict[str, float]:
        """Return the coordinates of the pose number ``index``."""
        return dict(zip(self.grid.names, map(float, self.grid.poses[index]), strict=True))

    def worst_place(self) -> dict[str, Any] | None:
        """Return where among the reachable poses the next failure hurts most, and which it is."""
        smallest = np.round(self.worst.ravel(), EQUAL_MEASURES)
        if not np.isfinite(smallest).any():
            return None
        index, found = int(np.nanargmin(smallest)), self.measures
        which, value = worst_failure(
            self.mechanism, found.position[index], found.torque[index], found.hard[index]
        )
        return {'at': self.place(index), 'measure': value, 'failure': str(which)}

    def _worst(self, values: FloatArray) -> FloatArray:
        return frozen(np.fmin.reduce(values, axis=1, initial=np.nan).reshape(self.grid.shape))


def tolerance_map(
    mechanism: Mechanism,
    grid: Grid,
    failures: FailureSet | Iterable[FailureLike] = (),
    *,
    certified: bool = False,
    executor: Executor | None = None,
    watch: Watch | None = None,
) -> ToleranceMap:
    """Return the map of ``mechanism`` over ``grid``.

    Parameters
    ----------
    mechanism : Mechanism
    grid : Grid
    failures : FailureSet, or iterable of (mode, name), 'mode:name' or Failure
        Present all over the map, as in `after`.
    certified : bool
        Also prove cells: see `proven`.
    executor : concurrent.futures.Executor, optional
        What to spread the work over; the result is the same.
    watch : Watch, optional
        Is told how far it is.

    Returns
    -------
    ToleranceMap

    Raises
    ------
    MechanismError
        If the coordinates are not of the task, or cells cannot be certified.
    FailureError
        If ``failures`` name what the mechanism does not have.
    """
    grid = grid.required_of(mechanism)
    if not isinstance(failures, FailureSet):
        failures = failure_set(mechanism, failures)
    batch = certifiable(mechanism, failures) if certified else None
    size = _AT_A_TIME if by_pose(mechanism) else _AT_A_TIME_DEFINED
    measure = partial(pose_measures, mechanism, grid.names, failures=failures)
    found = joined(mapped(measure, _parts(grid.poses, size), executor, watch))
    if batch is None:
        return ToleranceMap(mechanism, grid, failures, found)
    half = np.array([axis.step / 2.0 for axis in grid.axes])
    prove = partial(_proven, mechanism, failures, grid.names, half)
    proofs = mapped(prove, _parts(grid.centres, _CELLS_AT_A_TIME), executor, watch)
    shape = tuple(axis.count - 1 for axis in grid.axes)
    proof = Proof(*(np.concatenate(column).reshape(shape) for column in zip(*proofs, strict=True)))
    return ToleranceMap(mechanism, grid, failures, found, proof)


def _proven(
    mechanism: Mechanism, failures: FailureSet, names: tuple[str, ...], half: FloatArray,
    centres: FloatArray,
) -> Proof:
    return proven(certifiable(mechanism, failures), names, centres, half)


def _parts(values: FloatArray, size: int) -> list[FloatArray]:
    return [values[start : start + size] for start in range(0, len(values), size)]
