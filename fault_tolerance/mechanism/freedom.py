# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the structure of the attached struts leaves the platform, and what the drives make of it.

Closing loops and differential kinematics ask the same two singular value decompositions of a
configuration: that of the structural rows, and that of the drives' rates along the motions which
the structure allows. They are made once and kept with the rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.tolerances import RANK_TOLERANCE


@dataclass(frozen=True, eq=False)
class Structure:
    """The structural rows of the attached struts, decomposed.

    Attributes
    ----------
    rows : (g, 6) array
    struts : (g,) int array
        The strut of each.
    left, sigma, right : arrays
        Their singular value decomposition, with all six right directions.
    """

    rows: FloatArray
    struts: IntArray
    left: FloatArray
    sigma: FloatArray
    right: FloatArray

    def kept(self, compliance: float) -> int:
        """Return how many constraints count when those up to ``compliance`` are absorbed."""
        return kept_constraints(self.sigma, compliance)


@dataclass(frozen=True, eq=False)
class Freedom:
    """The motions the structure allows and the rates of the drives along them.

    Attributes
    ----------
    twists : (6, b) array
        Orthonormal basis of the scaled twists that the structure allows.
    rates : (h, b) array
        Rates of the attached struts' actuators along them.
    left, gains, right : arrays
        Singular value decomposition of ``rates``, with all right directions.
    """

    twists: FloatArray
    rates: FloatArray
    left: FloatArray
    gains: FloatArray
    right: FloatArray

    @cached_property
    def determined(self) -> bool:
        """Whether the drives determine every motion, well enough to fit it to readings."""
        gains = self.gains.tolist()
        if len(gains) < self.twists.shape[1]:
            return False
        return not gains or gains[-1] > RANK_TOLERANCE * gains[0]

    @cached_property
    def fit(self) -> FloatArray:
        """The twist (6, h) that fits actuator rates best, where they determine it."""
        fit: FloatArray = self.twists.dot(self.right.T / self.gains).dot(self.left.T)
        return fit


def kept_constraints(sigma: FloatArray, compliance: float) -> int:
    """Return how many of the singular values ``sigma`` (largest first) are not absorbed."""
    values: list[float] = sigma.tolist()
    if not values:
        return 0
    threshold = max(compliance, RANK_TOLERANCE * values[0])
    if values[-1] > threshold:
        return len(values)
    return sum(value > threshold for value in values)


def freedom(structure: Structure, actuator_rows: FloatArray, kept: int) -> Freedom:
    """Return the freedom that ``kept`` constraints leave.

    Parameters
    ----------
    structure : Structure
    actuator_rows : (h, 6) array
        Of the attached struts' actuators.
    kept : int
    """
    twists = structure.right[kept:].T
    rates = actuator_rows.dot(twists)
    return Freedom(twists, rates, *decomposed(rates))
