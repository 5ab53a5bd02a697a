# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""All single and double measures at once, from two N x N matrices.

With ``K0 = T T^t`` and ``K = T N N^t T^t`` (N a basis of the null space of J_m)

    t_i^2 = 1 - K0_ii,                  p_i^2 = K_ii / K0_ii,
    t_ij^2 = (1 - K0_ii)(1 - K0_jj) - K0_ij^2,
    p_ij^2 = (K_ii K_jj - K_ij^2) / (K0_ii K0_jj - K0_ij^2)

(docs/theory.md, eq. 21). They subtract from 1: a relative error of 2e-8 at t = 1e-4, and useless
at 1e-8. Live numbers, therefore, never the decision whether a failure is tolerable. J_m must
have full rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.kinematics.measures import position_measure
from fault_tolerance.kinematics.subspaces import null_space
from fault_tolerance.mechanism.arrays import FloatArray

# Rows of T this close to dependent make p_ij a quotient of rounding errors.
_DEPENDENT = 1e-6
# An actuator that moves less than this per unit reduced rate does not move.
_IMMOBILE = 1e-9


@dataclass(frozen=True, eq=False)
class ClosedFormMeasures:
    """Measures of every single and double further failure; NaN where one has failed already.

    Attributes
    ----------
    position, torque : (N,) array
    position_pairs, torque_pairs : (N, N) array
        Symmetric; the diagonal repeats the single measures.
    """

    position: FloatArray
    torque: FloatArray
    position_pairs: FloatArray
    torque_pairs: FloatArray


def single_measures(kinematics: DifferentialKinematics) -> tuple[FloatArray, FloatArray]:
    """Return p and t of every actuator, (N,) each; NaN for those that do not drive."""
    mapping = kinematics.mapping
    spare = mapping @ null_space(kinematics.major)
    moved = np.einsum('ij,ij->i', mapping, mapping)
    kept = np.einsum('ij,ij->i', spare, spare)
    mobile = moved > _IMMOBILE**2
    position = np.where(mobile, np.sqrt(kept / np.where(mobile, moved, 1.0)), 1.0)
    torque = np.sqrt(np.maximum(1.0 - moved, 0.0))
    for measure in (position, torque):
        measure[~kinematics.active] = np.nan
    return np.minimum(position, 1.0), torque


def closed_form_measures(kinematics: DifferentialKinematics) -> ClosedFormMeasures:
    """Return p and t of every actuator and of every pair."""
    mapping = kinematics.mapping
    spare = mapping @ null_space(kinematics.major)
    all_, own = mapping @ mapping.T, spare @ spare.T
    position, torque = single_measures(kinematics)
    moved, kept = np.diag(all_), np.diag(own)
    products = np.multiply.outer(moved, moved)
    determinant = products - all_**2
    dependent = determinant <= _DEPENDENT * products
    numerator = np.maximum(np.multiply.outer(kept, kept) - own**2, 0.0)
    position_pairs = np.sqrt(numerator / np.where(dependent, 1.0, determinant))
    still = 1.0 - moved
    torque_pairs = np.sqrt(np.maximum(np.multiply.outer(still, still) - all_**2, 0.0))
    failed = ~kinematics.active
    position_pairs[failed], torque_pairs[failed] = np.nan, np.nan
    position_pairs[:, failed], torque_pairs[:, failed] = np.nan, np.nan
    for first, second in np.argwhere(np.triu(dependent, 1)).tolist():
        if kinematics.active[first] and kinematics.active[second]:
            value = position_measure(kinematics, (first, second))
            position_pairs[first, second] = position_pairs[second, first] = value
    np.fill_diagonal(position_pairs, position)
    np.fill_diagonal(torque_pairs, torque)
    return ClosedFormMeasures(position, torque, np.minimum(position_pairs, 1.0), torque_pairs)
