# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What motions of one drive at a time show where drives strain each other (r > 0).

With the healthy couplings P of `couplings`, encoder gains g, drive gains c, and E = 1 where an
encoder sits at the load (0 at the motor), the readings of all single-drive motions are

    R = diag(g) (E P + (1 - E)) diag(c)

with columns exchanged where commands are, and rows where names are. The coupled entries tell g and
c apart: a wrong `sign` turns both, a drive or an encoder the wrong way round only one of them. How
stiff the drives are relative to each other is seldom known, so sizes are judged coarsely here, and
finely by the motions that strain nothing (`whole_motions`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray

COUPLED = 0.05
"""Entries of P below it are too small to be told anything by."""

AT_LOAD, AT_MOTOR = 0.4, 0.15
"""From the first share of the expected coupling on an encoder sits at the load, up to the second
at the motor (or the structure gives way long before the drives do)."""

_TURNED = 0.05
"""What an explanation costs for each encoder or drive that it turns round."""

FITS = 0.25
"""Share of the readings that a model of them may leave unexplained."""

_GROSS = float(np.log(2.5))
"""Gains nearer to 1 than this are left to the motions that strain nothing."""

_WEAKER = 0.3
"""So much smaller couplings may be where structures give way as drives do."""


@dataclass(frozen=True, eq=False)
class MatrixFit:
    """One explanation of the readings of single drives.

    Attributes
    ----------
    cause : str
        What is exchanged, if the followers are: ``order`` of commands, ``names`` or ``either``.
    followers : (N,) array of int
        Which actuator's reading moves with each command.
    load : (N,) array
        How much of the coupling expected at the load each encoder shows; NaN: cannot be told.
    encoders, drives : (N,) array
        Gains: 1 where all is well.
    own : (N,) array
        How far each joint goes of what its drive is told, with its sign.
    residual : float
        Share of the readings left unexplained.
    misfit : float
        The same where a structure that gives way may make couplings smaller, and own motions
        larger, than those of a rigid one.
    """

    cause: str
    followers: IntArray
    load: FloatArray
    encoders: FloatArray
    drives: FloatArray
    own: FloatArray
    residual: float
    misfit: float


def best_fit(
    matrix: FloatArray, projection: FloatArray, floor: FloatArray, usable: BoolArray
) -> MatrixFit | None:
    """Return the simplest good explanation: the file's order unless another is clearly better.

    Parameters
    ----------
    matrix : (N, N) array
        Travel of every reading per travel commanded of every drive.
    projection : (N, N) array
        P of `couplings`.
    floor : (N, N) array
        What would have been seen.
    usable : (N, N) array of bool
        Of readings and drives that moved at all.
    """
    fits = []
    identity = np.arange(len(matrix))
    for followers in _permutations(matrix, usable):
        for cause in ('order', 'names'):
            if (followers == identity).all() and cause == 'names':
                continue
            fits.append(_fit(matrix, projection, floor, usable, followers, cause))
    if not fits:
        return None
    best = min(fits, key=_cost)
    if _cost(fits[0]) <= max(1.3 * _cost(best), 0.1):
        return fits[0]
    rivals = [one for one in fits if one.cause != best.cause
              and (one.followers == best.followers).all() and one.misfit <= FITS]
    if rivals and _cost(rivals[0]) < 2.0 * _cost(best) + 0.02:
        return replace(best, cause='either')
    return best


def _cost(fit: MatrixFit) -> float:
    """Return what an explanation leaves unexplained, and a bit for each thing turned round."""
    turned = (fit.encoders < 0.0).sum() + (fit.drives < 0.0).sum()
    return fit.residual + _TURNED * float(turned)


def _permutations(matrix: FloatArray, usable: BoolArray) -> Iterator[IntArray]:
    """Yield in which order drives may be: the file's, and the one the largest entries say."""
    count = len(matrix)
    yield np.arange(count)
    sizes = np.where(usable, np.abs(matrix), 0.0)
    # Gains of encoders and drives cancel where rows and columns are brought to one size.
    for _ in range(20):
        sizes = sizes / np.maximum(np.sqrt((sizes**2).sum(axis=1, keepdims=True)), 1e-300)
        sizes = sizes / np.maximum(np.sqrt((sizes**2).sum(axis=0, keepdims=True)), 1e-300)
    rows, columns = linear_sum_assignment(-(sizes**2) - 1e-6 * np.eye(count))
    followers = np.empty(count, dtype=np.intp)
    followers[columns] = rows
    if (followers != np.arange(count)).any():
        yield followers


def _fit(
    matrix: FloatArray, projection: FloatArray, floor: FloatArray, usable: BoolArray,
    followers: IntArray, cause: str,
) -> MatrixFit:
    """Return gains and encoder sides that explain ``matrix`` best, with drives or names exchanged.

    ``followers`` (N,) are the actuators whose readings move with each command.
    """
    if cause == 'order':
        # Command i moves drive followers[i].
        columns = np.argsort(followers)
        aligned, seen, least = matrix[:, columns], usable[:, columns], floor[:, columns]
    else:
        # Actuator i reads under the name of followers[i].
        aligned, seen, least = matrix[followers], usable[followers], floor[followers]
    load = _load_shares(aligned, projection, seen, least)
    at_load = np.where(np.isnan(load), 1.0, load > 0.5 * (AT_LOAD + AT_MOTOR))[:, None]
    expected = at_load * projection + (1.0 - at_load) * np.eye(len(matrix))
    strong = seen & (np.abs(expected) > COUPLED) & (aligned != 0.0)
    encoders, drives = _gains(aligned, expected, strong)
    relative = aligned / np.outer(encoders, drives)
    size = max(float(np.linalg.norm(np.where(seen, expected, 0.0))), 1e-300)
    ends = np.array([_WEAKER * expected, expected])
    low, high = ends.min(axis=0) - 0.02, ends.max(axis=0) + 0.02
    np.fill_diagonal(high, 1.0)
    error, outside = (np.where(seen, one - relative, 0.0)
                      for one in (expected, np.clip(relative, low, high)))
    residual, misfit = (float(np.linalg.norm(one)) / size for one in (error, outside))
    own = np.where(np.diag(seen), np.diag(aligned), 0.0)
    return MatrixFit(cause, followers, load, encoders, drives, own, residual, misfit)


def _load_shares(
    aligned: FloatArray, projection: FloatArray, seen: BoolArray, least: FloatArray
) -> FloatArray:
    """Return how much of the expected coupling each encoder shows (N,): NaN where none would be.

    Relative to its own motion, and, so that gains of drives cancel, by pairs.
    """
    count = len(aligned)
    shares = np.full(count, np.nan)
    sizes, own = np.abs(aligned), np.abs(np.diag(aligned))
    for k in range(count):
        others = [i for i in range(count) if i != k and seen[k, i] and own[i] > 0.0
                  and abs(projection[k, i]) > COUPLED
                  and abs(projection[k, i]) > 2.0 * least[k, i]]
        if not others or own[k] == 0.0:
            continue
        alone = [sizes[k, i] / own[k] * projection[k, k] / abs(projection[k, i]) for i in others]
        pairs = [
            np.sqrt(sizes[k, i] * sizes[i, k] / (own[k] * own[i])
                    * projection[k, k] * projection[i, i]) / abs(projection[k, i])
            for i in others
        ]
        shares[k] = max(float(np.median(alone)), float(np.median(pairs)))
    return shares


def _gains(
    aligned: FloatArray, expected: FloatArray, strong: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return gains of encoders and drives (N,) each, such that most encoders are right.

    Sizes by medians, signs along the strongest couplings. In a part of the machine that is
    coupled to no other, one size and one sign common to all encoders and all drives is not seen.
    """
    count = len(aligned)
    ratio = np.where(strong, aligned, 1.0) / np.where(strong, expected, 1.0)
    logs = np.where(strong, np.log(np.abs(ratio)), np.nan)
    size = np.zeros((2, count))
    signs = np.ones((2, count))
    for part in parts_of(strong):
        rows, columns = part
        for _ in range(20):
            for j in columns:
                size[1, j] = np.nanmedian(logs[rows, j] - size[0, rows])
            for k in rows:
                size[0, k] = np.nanmedian(logs[k, columns] - size[1, columns])
        shift = float(np.median(size[0, rows]))
        size[0, rows] -= shift
        size[1, columns] += shift
        # Structures that give way change couplings, and look like small gains.
        common = float(np.median(size[1, columns]))
        base = common if abs(common) > _GROSS else 0.0
        size[0, rows] = np.where(np.abs(size[0, rows]) > _GROSS, size[0, rows], 0.0)
        size[1, columns] = np.where(
            np.abs(size[1, columns] - common) > _GROSS, size[1, columns], base
        )
        _propagate(np.sign(ratio), np.abs(expected) * strong, part, signs)
    encoders, drives = signs * np.exp(size)
    return encoders, drives


def parts_of(strong: BoolArray) -> Iterator[tuple[list[int], list[int]]]:
    """Yield the parts of a machine that hang together: their encoders and drives.

    ``strong`` (N, N) says which encoder shows which drive.
    """
    left = set(np.flatnonzero(strong.any(axis=1)).tolist())
    while left:
        rows, columns = {left.pop()}, set[int]()
        while True:
            reached = set(np.flatnonzero(strong[sorted(rows)].any(axis=0)).tolist())
            back = set(np.flatnonzero(strong[:, sorted(reached)].any(axis=1)).tolist())
            if reached == columns and back == rows:
                break
            rows, columns = back | rows, reached
        left -= rows
        yield sorted(rows), sorted(columns)


def _propagate(
    signs: FloatArray, weights: FloatArray, part: tuple[list[int], list[int]], found: FloatArray
) -> None:
    """Set the signs ``found`` (2, N) of one part, along the largest of ``weights`` (N, N)."""
    rows, columns = part
    known: tuple[set[int], set[int]] = ({rows[0]}, set())
    while len(known[0]) < len(rows) or len(known[1]) < len(columns):
        edges = [
            (weights[k, j], k, j) for k in rows for j in columns
            if weights[k, j] > 0.0 and (k in known[0]) != (j in known[1])
        ]
        _, k, j = max(edges)
        if k in known[0]:
            found[1, j] = signs[k, j] * found[0, k]
            known[1].add(j)
        else:
            found[0, k] = signs[k, j] * found[1, j]
            known[0].add(k)
    negative = (found[0, rows] < 0.0).sum() + (found[1, columns] < 0.0).sum()
    if 2 * negative > len(rows) + len(columns):
        found[0, rows] *= -1.0
        found[1, columns] *= -1.0
