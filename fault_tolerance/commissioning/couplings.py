# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How drives and readings of a healthy machine hang together, for small motions.

Drives are springs between their setpoints and their joints. Where setpoints move by u, the joints
of a machine with mapping T and drive stiffness K move by ``P u = T (T' K T)^-1 T' K u``: all of a
motion in the range of T, and a share of any other, whose rest strains the machine. Lengths are in
metres throughout: drives that turn count at the characteristic length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.arrays import FloatArray, frozen
from fault_tolerance.mechanism.configuration import fitted_configuration, home_configuration
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import RANK_TOLERANCE


@dataclass(frozen=True, eq=False)
class Couplings:
    """The couplings of a mechanism at one configuration; made by `couplings`.

    Attributes
    ----------
    projection : (N, N) array
        P: motion of each joint per motion of each setpoint, metres per metre.
    redundancy : int
        r = N - n: how many independent ways there are for the drives to strain each other.
    together : (N, m) array
        Motions of all drives that strain nothing, in metres, the largest element 1: columns that
        move the platform along one task coordinate each, and what else the drives can do.
    labels : tuple of str
        The m names of these motions.
    known_stiffness : bool
        Whether the file gives the stiffness of every drive; equal ones are assumed otherwise.
    """

    projection: FloatArray
    redundancy: int
    together: FloatArray
    labels: tuple[str, ...]
    known_stiffness: bool

    def __repr__(self) -> str:
        count = len(self.projection)
        return f'Couplings({count} drives, redundancy {self.redundancy})'


def couplings(mechanism: Mechanism, values: FloatArray) -> Couplings:
    """Return how the drives of ``mechanism`` hang together where its joint ``values`` (N,) are.

    At home where loops do not close at the values.
    """
    configuration = fitted_configuration(mechanism, values)
    if not configuration.converged:
        configuration = home_configuration(mechanism)
    post = reconfigured(strut_rows(configuration).in_metres())
    mapping = np.asarray(post.mapping)
    stiffness = np.array([one.stiffness for one in mechanism.actuators])
    known = bool(np.isfinite(stiffness).all())
    weights = stiffness / mechanism.rate_scale**2 if known else np.ones(len(stiffness))
    weights = weights / weights.max()
    weighted = mapping.T * weights
    projection = mapping @ np.linalg.solve(weighted @ mapping, weighted)
    together, labels = _together(mapping, np.asarray(post.jacobian), mechanism.task.coordinates)
    count, mobility = mapping.shape
    return Couplings(frozen(projection), count - mobility, frozen(together), labels, known)


def _together(
    mapping: FloatArray, jacobian: FloatArray, coordinates: tuple[str, ...]
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return motions (N, m) that span the range of ``mapping`` (N, n), and their names.

    ``jacobian`` (l, n) has a row for each of the task ``coordinates``.
    """
    reduced = np.linalg.pinv(jacobian, rcond=RANK_TOLERANCE)
    _, sigma, right = np.linalg.svd(jacobian)
    rank = int((sigma > RANK_TOLERANCE * max(sigma.max(initial=0.0), 1e-300)).sum())
    columns, labels = [], []
    for index, name in enumerate(coordinates):
        motion = mapping @ reduced[:, index]
        if np.abs(motion).max() > RANK_TOLERANCE:
            columns.append(motion)
            labels.append(name)
    # What the task does not see.
    for number, direction in enumerate(right[rank:], start=1):
        columns.append(mapping @ direction)
        labels.append(f'inner motion {number}')
    motions = [column / np.abs(column).max() for column in columns]
    return np.array(motions).reshape(-1, len(mapping)).T, tuple(labels)
