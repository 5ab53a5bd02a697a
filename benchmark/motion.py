# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Joint values on a closed path, a different configuration at every step."""

from __future__ import annotations

from functools import cache

import numpy as np

from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import fitted_configuration, home_configuration


@cache
def circle(name: str, steps: int = 400, share: float = 0.2) -> FloatArray:
    """Return joint values (steps, N) of a mechanism whose drives swing about home.

    Parameters
    ----------
    name : str
        A shipped mechanism, or a file.
    steps : int
    share : float
        Of the stroke (or of the characteristic length) that is used.
    """
    mechanism = mechanism_named(name)
    home = home_configuration(mechanism)
    mapping = differential_kinematics(strut_rows(home)).mapping
    limits = mechanism.position_limits
    reach = share * min(float(np.abs(limits).min()), mechanism.characteristic_length)
    places = []
    found = home
    for phase in 2.0 * np.pi * np.arange(steps) / steps:
        reduced = np.zeros(mapping.shape[1])
        reduced[:2] = np.cos(phase), np.sin(phase)
        # What the loops do not allow the fit takes out again.
        found = fitted_configuration(mechanism, reach * (mapping @ reduced), (), found)
        places.append(found.actuator_values)
    return np.array(places)
