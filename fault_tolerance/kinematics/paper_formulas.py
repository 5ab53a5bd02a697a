# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The paper's own route: post-failure kinematics and measures from nominal J and T alone.

Valid under the paper's conditions (independent failures, not at a singularity), where they equal
what the rows give; kept as public functions and as an independent check of them. Source: Yi,
McInroy and Chen, *Fault Tolerance of Parallel Manipulators Using Task Space and Kinematic
Redundancy*, IEEE Transactions on Robotics 22(5), 2006, eqs. (6), (7), (9), (11), (12), (14).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fault_tolerance.kinematics.subspaces import manipulability, null_space, rank, rank_of
from fault_tolerance.mechanism.arrays import FloatArray


def after_position_failure(
    jacobian: FloatArray, mapping: FloatArray, stuck: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """Return J (l, n - f) and T (N, n - f) with the actuators ``stuck`` locked, eqs. (6), (7).

    From ``jacobian`` (l, n) and ``mapping`` (N, n), J and T without failures.
    """
    unlocked = null_space(mapping[list(stuck)], 1.0)
    return jacobian @ unlocked, mapping @ unlocked


def after_torque_failure(
    jacobian: FloatArray, mapping: FloatArray, free: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """Return J (l, n) and T (N - f, n) without the actuators ``free``, eqs. (11), (12).

    From ``jacobian`` (l, n) and ``mapping`` (N, n), J and T without failures. If the remaining
    rows of T have lost rank, the platform is not held and only the columns that
    are still driven are returned.
    """
    remaining = np.delete(mapping, list(free), axis=0)
    left, sigma, right = np.linalg.svd(remaining, full_matrices=False)
    driven = rank_of(sigma, 1.0)
    return jacobian @ (right[:driven].T / sigma[:driven]), left[:, :driven]


def position_measure_by_theorem_2(
    major: FloatArray, mapping: FloatArray, stuck: Sequence[int]
) -> float:
    """Return p of the actuators ``stuck`` from T and the null space of J_m, eq. (9).

    Dependent failures make the paper's quotient 0/0; the rank of their rows counts, not their
    number. More independent failures than spare degrees of freedom give 0.

    Parameters
    ----------
    major : (m, n) array
        J_m, of rank m.
    mapping : (N, n) array
        T.
    stuck : sequence of int
    """
    failed = mapping[list(stuck)]
    independent = rank(failed, 1.0)
    spare = null_space(major)
    below = manipulability(failed, independent, 1.0)
    return manipulability(failed @ spare, independent, 1.0) / below


def torque_measure_by_theorem_4(mapping: FloatArray, free: Sequence[int]) -> float:
    """Return t of the actuators ``free`` from the rest of T, ``mapping`` (N, n), eq. (14)."""
    remaining = np.delete(mapping, list(free), axis=0)
    return manipulability(remaining, mapping.shape[1], 1.0)
