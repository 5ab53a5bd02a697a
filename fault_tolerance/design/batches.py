# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Rows and orthonormal factors of a mechanism on `Legs` at many poses at a time."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fault_tolerance.design.legs import Legs
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure, reconfigured
from fault_tolerance.kinematics.rows import StrutRows, home_rows
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.screws import exponential
from fault_tolerance.mechanism.task import COORDINATES
from fault_tolerance.tolerances import SURE


class Factored(NamedTuple):
    """The rows A (b, a, 6) of the drives that still drive, as ``A = T L'`` with T orthonormal."""

    mapping: FloatArray
    """(b, a, 6): T. Its first columns are what J_m leaves free (docs/design.md)."""
    lower: FloatArray
    """(b, 6, 6): L, each row divided by its ``scale``."""
    scale: FloatArray
    """(b, 6): lengths of the columns of A."""
    inverse: FloatArray
    """(b, 6, 6): of ``lower``."""
    regular: BoolArray
    """(b,): whether there is such a factor; without, everything else is anything."""

    def __repr__(self) -> str:
        return f'Factored({len(self.regular)} poses, {int(self.regular.sum())} regular)'


class Batch:
    """A ``mechanism`` on ``legs`` with ``failures``, whose task has all six coordinates."""

    def __init__(self, mechanism: Mechanism, legs: Legs, failures: FailureSet) -> None:
        self.mechanism, self.failures, self.legs = mechanism, failures, legs
        # Secondary coordinates first: the first columns of T are then what J_m leaves free.
        self.columns = [COORDINATES.index(name) for name in reversed(mechanism.task.by_priority)]
        self.spare = len(COORDINATES) - len(mechanism.task.major)
        lost, idle = set(failures.lost), {*failures.stuck, *failures.free}
        self.there = np.array([one.strut not in lost for one in mechanism.actuators])
        self.active = self.there & [one.name not in idle for one in mechanism.actuators]
        places = {name: place for place, name in enumerate(mechanism.strut_names)}
        self.drive_of = np.argsort([places[one.strut] for one in mechanism.actuators])
        self._strut_of = np.argsort(legs.actuator)
        self._rows = home_rows(mechanism)

    def __repr__(self) -> str:
        return f'Batch({self.mechanism.name!r}, {int(self.active.sum())} drives)'

    def solved(self, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return drive values (B, N) and rows (B, N, 6) at displacements ``moves`` (B, 6)."""
        turns = np.zeros_like(moves)
        turns[:, :3] = moves[:, :3]
        rotations, origins = exponential(turns)[:, :3, :3], moves[:, 3:] + self.mechanism.origin
        values, rows = self.legs.solved(rotations, origins)
        return values[:, self._strut_of], rows[:, self._strut_of]

    def factored(self, rows: FloatArray) -> Factored:
        """Return the factors of the drives that still drive, of ``rows`` (b, N, 6) of all."""
        matrix = rows[:, self.active][:, :, self.columns]
        scale = np.asarray(np.sqrt((matrix * matrix).sum(axis=1)))
        with np.errstate(invalid='ignore', divide='ignore'):
            matrix /= scale[:, None]
        gram = np.swapaxes(matrix, 1, 2) @ matrix
        regular = np.asarray(np.isfinite(gram).all(axis=(1, 2)))
        regular[regular] = np.linalg.det(gram[regular]) > SURE**2
        gram[~regular] = np.eye(gram.shape[1])
        lower = np.asarray(np.linalg.cholesky(gram), dtype=np.float64)
        inverse = np.asarray(np.linalg.inv(lower), dtype=np.float64)
        return Factored(matrix @ np.swapaxes(inverse, 1, 2), lower, scale, inverse, regular)

    def defined(self, values: FloatArray, rows: FloatArray) -> PostFailure:
        """Return what the definition says of drives at ``values`` (N,) with ``rows`` (N, 6)."""
        home = self._rows
        constraints = replace(home.constraints, actuator_rows=rows / home.twist_scale)
        place = replace(home.configuration, actuator_values=values)
        found: StrutRows = replace(home, configuration=place, constraints=constraints)
        return reconfigured(found, self.failures)
