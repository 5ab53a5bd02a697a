# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether the readings there are say where the mechanism is."""

from __future__ import annotations

import numpy as np

from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray
from fault_tolerance.mechanism.configuration import Configuration


def silent_drives(readings: FloatArray, struts: IntArray, lost: FloatArray) -> BoolArray:
    """Return which actuators of attached struts have no reading, (N,).

    Parameters
    ----------
    readings : (N,) array
        NaN where there is none.
    struts : (N,) array of int
        The strut of each actuator; -1 where the mechanism has none.
    lost : array
        Beginning with the struts: 1 where one is lost.

    Returns
    -------
    (N,) array of bool
    """
    return np.asarray(np.isnan(readings) & ~((struts >= 0) & (lost[struts] != 0.0)))


def is_determined(
    configuration: Configuration, failures: FailureSet, readings: FloatArray, least: float
) -> bool:
    """Return whether the readings determine where the attached struts hold the platform.

    Parameters
    ----------
    configuration : Configuration
        Thereabouts.
    failures : FailureSet
    readings : (N,) array
        NaN where there is none.
    least : float
        Smallest singular value of the rows of T that are read, below which they do not.

    Returns
    -------
    bool
    """
    rows = strut_rows(configuration)
    # Encoders read drives that are stuck and limp as well as others.
    mapping = differential_kinematics(rows, FailureSet(lost=failures.lost)).mapping
    sigma = np.linalg.svd(mapping[~np.isnan(readings)], compute_uv=False)
    return len(sigma) == mapping.shape[1] and bool(sigma.min(initial=1.0) > least)
