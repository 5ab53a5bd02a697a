# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Resolved rates with task priority: which actuator rates give a task velocity.

The major part of the task is met exactly where that is possible (the shortest solution, by least
squares in the metric of twists where it is not). The secondary part is met as well as the null
space of the major part allows:

    q' = J_m^+ v_m + N (J_s N)^+ (v_s - J_s J_m^+ v_m),    N = null(J_m)

Singular values are taken with rotations times the characteristic length, of the platform and of
rotary drives alike. So they are transmissions: metres per second of the platform per metre per
second of the drives. Major directions with a very small one are left out, never inverted, and
secondary ones well before: the rates stay bounded, and the residual shows what is missing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite

import numpy as np

from fault_tolerance.compiled.activation import Active, Kernels
from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.kinematics.measures import CONDITION_CAP
from fault_tolerance.kinematics.subspaces import rank_of
from fault_tolerance.mechanism.arrays import FloatArray, frozen, frozen_array
from fault_tolerance.mechanism.linear_algebra import decomposed, length
from fault_tolerance.mechanism.task import COORDINATES, Task

SINGULAR_BELOW = 5e-4
"""Directions with a smaller transmission are not driven: nothing so small is ever inverted."""

POOR_BELOW = 0.05
"""Secondary directions with a smaller transmission, relative to the best major one, are left
alone; up to twice that they fade in. To reach for them would take drive speeds, and motions of
the platform outside its task, out of proportion, which disturb the major task."""

LARGEST_SPEED = 1e100
"""Task velocities with a larger component are brought down to it, all components by one factor."""


@dataclass(frozen=True, eq=False)
class ResolvedRate:
    """Actuator rates for a task velocity, with their certificate.

    Attributes
    ----------
    kinematics : DifferentialKinematics
        What the rates were resolved with.
    velocity : (l,) array
        What was asked for, in the task's order, rad/s and m/s.
    major, secondary : (n,) array
        The parts of the reduced rates that serve the major and the secondary task.
    rank : int
        Directions of the major task that can be followed.
    transmission : float
        The smallest transmission of a major direction, 0 where one is lost. Its way to zero is
        the way to a singularity.
    """

    kinematics: DifferentialKinematics
    velocity: FloatArray
    major: FloatArray
    secondary: FloatArray
    rank: int
    transmission: float

    @cached_property
    def reduced(self) -> FloatArray:
        """Reduced actuator rates, (n,)."""
        return frozen(self.major + self.secondary)

    @cached_property
    def rates(self) -> FloatArray:
        """Rates of all actuators in the mechanism's order, (N,); free ones as they follow."""
        return frozen(self.kinematics.rate_map.dot(self.reduced))

    @cached_property
    def achieved(self) -> FloatArray:
        """The task velocity that the rates give, (l,)."""
        return frozen(self.kinematics.jacobian.dot(self.reduced))

    @cached_property
    def residual(self) -> FloatArray:
        """What was asked for less what is achieved, (l,)."""
        return frozen(self.velocity - self.achieved)

    @cached_property
    def twist(self) -> FloatArray:
        """The platform twist that the rates give, (6,): base axes, v of the platform's origin.

        For a mechanism given by numbers, zero outside the task.
        """
        return frozen(twist_map(self.kinematics).dot(self.reduced))

    @property
    def smallest_singular_value(self) -> float:
        """The m-th singular value of J_m in its own units, 0 where there are fewer."""
        return _smallest(self._singular_values, len(self.kinematics.major))

    @property
    def condition_number(self) -> float:
        """The condition number of J_m in its own units, at most 1e12."""
        smallest = self.smallest_singular_value
        largest = float(self._singular_values.max(initial=0.0))
        return largest / smallest if smallest > largest / CONDITION_CAP else CONDITION_CAP

    def scaled(self, scale: float, secondary_scale: float = 1.0) -> ResolvedRate:
        """Return it with the secondary part, and then everything, multiplied by a factor."""
        major = frozen(scale * self.major)
        secondary = frozen((scale * secondary_scale) * self.secondary)
        return replace(self, major=major, secondary=secondary)

    @cached_property
    def _singular_values(self) -> FloatArray:
        return np.asarray(np.linalg.svd(self.kinematics.major, compute_uv=False))


@dataclass(frozen=True, eq=False)
class TaskInverse:
    """What resolves task velocities at one configuration: linear, so worked out once.

    Attributes
    ----------
    kinematics : DifferentialKinematics
    major, secondary : (n, l) array
        Reduced rates per task velocity, the parts that serve the major and the secondary task.
    rank, transmission
        See `ResolvedRate`.
    """

    kinematics: DifferentialKinematics
    major: FloatArray
    secondary: FloatArray
    rank: int
    transmission: float

    def resolved(self, velocity: FloatArray) -> ResolvedRate:
        """Return the actuator rates for a task velocity (l,) in the task's order.

        Raises
        ------
        ArrayError
            If the velocity has the wrong length or is not finite.
        """
        count = len(self.kinematics.task.coordinates)
        asked = velocity
        if velocity.shape != (count,) or velocity.flags.writeable:
            asked = frozen_array(velocity, (count,), 'task velocity')
        values = asked.tolist()
        if not isfinite(sum(values)):
            # It may only be that large numbers add up to too much.
            asked = frozen_array(velocity, (count,), 'task velocity')
        size = max(map(abs, values))
        # A huge velocity must overflow nowhere on the way.
        bounded = asked if size <= LARGEST_SPEED else LARGEST_SPEED * (asked / size)
        return ResolvedRate(
            kinematics=self.kinematics,
            velocity=asked,
            major=frozen(self.major.dot(bounded)),
            secondary=frozen(self.secondary.dot(bounded)),
            rank=self.rank,
            transmission=self.transmission,
        )


class RateResolver:
    """Makes `TaskInverse` of kinematics (docs/theory.md, eq. 22).

    Parameters
    ----------
    task : Task
    twist_scale : (l,) array, optional
        Turns task velocities into metres per second; ones by default.
    rate_scale : (N,) array, optional
        Turns actuator rates into metres per second; ones by default.
    singular_below : float
        See `SINGULAR_BELOW`.
    poor_below : float
        See `POOR_BELOW`.
    """

    def __init__(
        self,
        task: Task,
        *,
        twist_scale: FloatArray | None = None,
        rate_scale: FloatArray | None = None,
        singular_below: float = SINGULAR_BELOW,
        poor_below: float = POOR_BELOW,
    ) -> None:
        weights = np.ones(len(task.coordinates)) if twist_scale is None else twist_scale
        weighted = np.diag(weights)
        self._places = task.major_rows, task.secondary_rows
        self._all_weights = weights
        self._weights = weights[task.major_rows]
        # What takes the major, and the secondary, part of a task velocity, in metres per second.
        self._major, self._secondary = weighted[task.major_rows], weighted[task.secondary_rows]
        self._rate_scale = rate_scale
        self._unit = common(rate_scale)
        self._singular_below = singular_below
        self._poor_below = poor_below

    @property
    def constants(self) -> tuple[FloatArray, float | None, float, float]:
        """What turns task velocities (l,) and drives' rates into metres per second; limits."""
        return self._all_weights, self._unit, self._singular_below, self._poor_below

    def inverse(self, kinematics: DifferentialKinematics) -> TaskInverse:
        """Return what resolves task velocities with ``kinematics``, failures included."""
        unit, coordinates = self._unit, None
        if Active.kernels is not None and unit is not None:
            return self._compiled(Active.kernels, kinematics, unit)
        jacobian = kinematics.jacobian
        if unit is None:
            coordinates = drive_coordinates(kinematics, self._rate_scale)
            jacobian = jacobian.dot(coordinates)
            left, sigma, right = decomposed(self._major.dot(jacobian))
        else:
            # Coordinates differ from the reduced rates by a factor only.
            left, sigma, right = kinematics.decomposed_major(self._weights)
            if unit != 1.0:
                sigma, jacobian = sigma / unit, jacobian / unit
        values: list[float] = sigma.tolist()
        best = values[0] if values else 0.0
        driven = sum(value > self._singular_below for value in values)
        # Per task velocity, in the coordinates of the drives.
        major = (right[:driven].T / sigma[:driven]).dot(left[:, :driven].T).dot(self._major)
        rank = rank_of(sigma, max(1.0, best))
        if rank < len(right) and len(self._secondary):
            free = right[rank:].T
            rows = self._secondary.dot(jacobian)
            least = max(self._singular_below, self._poor_below * best)
            inverse = _bounded_inverse(rows.dot(free), least)
            secondary = free.dot(inverse.dot(self._secondary - rows.dot(major)))
        else:
            secondary = np.zeros(major.shape)
        if coordinates is not None:
            major, secondary = coordinates.dot(major), coordinates.dot(secondary)
        elif unit != 1.0:
            major, secondary = major / unit, secondary / unit
        smallest = values[-1] if len(values) == len(self._weights) else 0.0
        return TaskInverse(kinematics, frozen(major), frozen(secondary), driven, smallest)


    def _compiled(
        self, kernels: Kernels, kinematics: DifferentialKinematics, unit: float
    ) -> TaskInverse:
        decomposition = kinematics.decomposed_major(self._weights)
        major, secondary, driven = kernels.invert_task(
            kinematics.jacobian, *decomposition, self._all_weights, *self._places, unit,
            self._singular_below, self._poor_below,
        )
        sigma = decomposition[1]
        smallest = float(sigma[-1]) / unit if len(sigma) == len(self._weights) else 0.0
        return TaskInverse(kinematics, frozen(major), frozen(secondary), driven, smallest)


def twist_map(kinematics: DifferentialKinematics) -> FloatArray:
    """Return the platform's twist per reduced rates, (6, n).

    For a mechanism given by numbers, zero outside the task: nothing else is known of it.
    """
    found = kinematics.twist_jacobian
    if len(found) != len(COORDINATES):
        found = np.zeros((len(COORDINATES), kinematics.mobility))
        found[kinematics.task.rows] = kinematics.jacobian
    return found


def common(rate_scale: FloatArray | None) -> float | None:
    """Return the one number that all of ``rate_scale`` is, or None if they differ."""
    if rate_scale is None:
        return 1.0
    values = set(rate_scale.tolist())
    return values.pop() if len(values) == 1 else None


def _bounded_inverse(matrix: FloatArray, least: float) -> FloatArray:
    """Return the pseudo-inverse (c, r) of ``matrix`` (r, c) without its small directions.

    Those with gains up to ``least`` count for nothing, those from twice that on in full: between
    the two nothing jumps.
    """
    if len(matrix) == 1:
        size = length(matrix)
        factor = min(size / least - 1.0, 1.0) / size**2 if size > least else 0.0
        return matrix.T * factor
    left, gains, mixed = decomposed(matrix)
    kept = int((gains > least).sum())
    inverse = np.minimum(gains[:kept] / least - 1.0, 1.0) / gains[:kept]
    return np.asarray((mixed[:kept].T * inverse).dot(left[:, :kept].T))


def resolved_rate(
    kinematics: DifferentialKinematics,
    velocity: FloatArray,
    *,
    twist_scale: FloatArray | None = None,
    rate_scale: FloatArray | None = None,
    singular_below: float = SINGULAR_BELOW,
    poor_below: float = POOR_BELOW,
) -> ResolvedRate:
    """Return the actuator rates for one task velocity (l,): see `RateResolver`.

    Raises
    ------
    ArrayError
        If the velocity has the wrong length or is not finite.
    """
    resolver = RateResolver(
        kinematics.task,
        twist_scale=twist_scale,
        rate_scale=rate_scale,
        singular_below=singular_below,
        poor_below=poor_below,
    )
    return resolver.inverse(kinematics).resolved(velocity)


def drive_coordinates(
    kinematics: DifferentialKinematics, rate_scale: FloatArray | None
) -> FloatArray:
    """Return reduced rates (n, n) per coordinates in which lengths are the drives' speed."""
    if rate_scale is None:
        return np.eye(kinematics.mobility)
    if (rate_scale == rate_scale[0]).all():
        return np.eye(kinematics.mobility) / float(rate_scale[0])
    # The columns of T are orthonormal in mixed units, if drives of both kinds are among them.
    triangle = np.linalg.qr(rate_scale[:, None] * kinematics.mapping, mode='r')
    return np.asarray(np.linalg.inv(triangle))


def _smallest(sigma: FloatArray, count: int) -> float:
    """Return the last of ``count`` singular values, 0 where there are fewer."""
    return float(sigma[-1]) if len(sigma) == count else 0.0
