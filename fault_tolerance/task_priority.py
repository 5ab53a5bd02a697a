# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Resolved rates without limits, for users of the library: task priority by itself.

It is that of the control law (kernel/law.py). The controller does not call this module; its
commands, within all limits, are made in control/rate_command.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.kernel.array_layout import TaskRows
from fault_tolerance.kernel.law import asked_velocity, prioritised
from fault_tolerance.kernel.packing import workspace_size
from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.mechanism.arrays import FloatArray, frozen, frozen_array
from fault_tolerance.mechanism.task import COORDINATES
from fault_tolerance.tolerances import SINGULAR_BELOW


@dataclass(frozen=True, eq=False)
class ResolvedRate:
    """Actuator rates for a task velocity, without limits.

    Attributes
    ----------
    velocity : (l,) array
        The velocity requested, in the task's order, rad/s and m/s.
    rates : (N,) array
        Of all actuators, free ones as they follow.
    achieved, residual : (l,) arrays
        The task velocity they give, and what is missing of the requested one.
    twist : (d,) array
        The platform's twist they give.
    rank : int
        Directions of the major task that are driven.
    transmission : float
        The smallest transmission of a major direction, 0 where one is lost.
    """

    velocity: FloatArray
    rates: FloatArray
    achieved: FloatArray
    residual: FloatArray
    twist: FloatArray
    rank: int
    transmission: float

    def __repr__(self) -> str:
        """Return the rates."""
        return f'<ResolvedRate {np.array2string(self.rates, precision=3)}>'


def resolved_rate(
    kinematics: DifferentialKinematics,
    velocity: FloatArray,
    *,
    characteristic_length: float = 1.0,
    rate_scale: FloatArray | None = None,
) -> ResolvedRate:
    """Return the actuator rates for one task velocity by task priority (docs/theory.md, eq. 22).

    Parameters
    ----------
    kinematics : DifferentialKinematics
        At the present configuration, failures included.
    velocity : (l,) array
        In the task's order, rad/s and m/s, base axes.
    characteristic_length : float
        Metres; makes rotations and translations comparable.
    rate_scale : (N,) array, optional
        Metres per unit of each actuator; ones by default.

    Returns
    -------
    ResolvedRate

    Raises
    ------
    ArrayError
        If an array has the wrong shape or is not finite.
    """
    task, mapping = kinematics.task, kinematics.mapping
    requested = frozen_array(velocity, (len(task.coordinates),), 'task velocity')
    scale = np.repeat([characteristic_length, 1.0], 3)
    drives = np.ones(len(mapping)) if rate_scale is None else rate_scale
    drives = frozen_array(drives, (len(mapping),), 'rate_scale')
    # Coordinates in which lengths are the drives' speed.
    _, triangle = np.linalg.qr(drives[:, None] * mapping)
    per_speed = np.linalg.inv(triangle)
    twist = np.zeros((len(COORDINATES), kinematics.mobility))
    twist[task.rows] = kinematics.jacobian
    if len(kinematics.twist_jacobian) == len(COORDINATES):
        twist = kinematics.twist_jacobian
    major, other, ones = task.major_rows, task.secondary_rows, np.ones(len(task.rows))
    rows = TaskRows(task.rows, major, other, np.concatenate([major, other]), scale, ones)
    follow = drives[:, None] * (kinematics.rate_map @ per_speed)
    motions = np.vstack([scale[:, None] * (twist @ per_speed), follow]).T.copy()
    work = np.ones(workspace_size(0, 0, len(drives), len(task.rows)))
    wanted = asked_velocity(rows, requested, np.empty(len(requested)))
    found = prioritised(work, rows, motions, wanted, SINGULAR_BELOW)
    reduced = per_speed @ (found.first + found.second)
    achieved = kinematics.jacobian @ reduced
    complete = len(task.major) <= kinematics.mobility
    return ResolvedRate(
        requested,
        frozen(kinematics.rate_map @ reduced),
        frozen(achieved),
        frozen(requested - achieved),
        frozen(twist @ reduced),
        int(found.driven),
        float(found.svd.sigma[len(task.major) - 1]) if complete else 0.0,
    )
