# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The best design: a search all over the ranges, then a polish.

The worst of many measures has edges where two of them change places, and best designs lie on such
edges. So it is not climbed: a number below all measures is raised, with the measures as
constraints, by sequential quadratic programming from the best designs of a differential evolution.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize
from scipy.stats import qmc

from fault_tolerance.design.specification import Specification
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.executors import Watch, mapped
from fault_tolerance.kinematics.reconfiguration import PostFailure, after
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import EQUAL_MEASURES

_STEPS = 300
_ENOUGH = 1e-10
_PENALTY = 10.0
_EQUAL = 1e-7


@dataclass(frozen=True, eq=False)
class Design:
    """A mechanism, and what makes it good."""

    specification: Specification
    values: FloatArray
    """Of the free numbers."""
    start: tuple[float, ...]
    worst: tuple[float, ...]
    """The worst of each objective, in the mechanism to begin with and in this one."""

    def __repr__(self) -> str:
        return f'Design({self.specification.name!r}, {self.worst})'


def states(specification: Specification, values: FloatArray) -> list[PostFailure]:
    """Return the mechanism of ``specification`` with free numbers ``values``, at all its poses.

    FaultToleranceError if there is none, or it cannot be there.
    """
    mechanism, grid = specification.mechanism(values), specification.grid
    if grid is None:
        return [after(mechanism)]
    return [
        after(mechanism, pose=dict(zip(grid.names, map(float, pose), strict=True)))
        for pose in grid.poses
    ]


def best_design(
    specification: Specification, executor: Executor | None = None, watch: Watch | None = None
) -> Design:
    """Return the best design that ``specification`` allows.

    The work is spread over ``executor``; the result is the same. ``watch`` is told how many
    designs have been tried, of how many at most. FaultToleranceError if no design was found that
    meets the constraints.
    """
    judge = _Judge(specification)
    low, high = np.array([(one.low, one.high) for one in specification.free]).T
    rng = np.random.default_rng(specification.seed)
    drawn = qmc.LatinHypercube(len(low), seed=rng).random(max(specification.population, 5))
    # The design to begin with is among the first.
    drawn[0] = np.clip((specification.start - low) / (high - low), 0.0, 1.0)

    tried: list[tuple[float, FloatArray]] = []

    def spread(
        function: Callable[[FloatArray], float], items: Iterable[FloatArray]
    ) -> list[float]:
        designs = [np.array(one) for one in items]
        costs = mapped(function, designs, executor)
        tried.extend(zip(costs, designs, strict=True))
        if watch is not None:
            watch(len(tried), len(drawn) * (specification.generations + 1))
        return costs

    differential_evolution(
        judge.cost, Bounds(low, high), init=low + drawn * (high - low), polish=False, seed=rng,
        maxiter=specification.generations, updating='deferred', workers=spread, tol=1e-6,
    )
    starts = [one for _, one in sorted(tried, key=itemgetter(0))[: specification.polish]]
    polished = mapped(partial(_polished, judge, low, high), starts, executor)
    candidates = [*polished, *starts]
    costs = [judge.cost(one) for one in candidates]
    best = candidates[int(np.argmin(costs))]
    measures, margins = judge.judged(best)
    name = specification.name
    if margins.min(initial=0.0) < -1e-6:
        raise FaultToleranceError(f'{name}: no design was found that meets the constraints')
    if measures.min(initial=1.0) <= 0.0:
        reason = 'no design was found that bears every failure (with less symmetry there may be)'
        raise FaultToleranceError(f'{name}: {reason}')
    worst = (judge.worst(values) for values in (specification.start, best))
    return Design(specification, best, *map(tuple, worst))


def trade_off(design: Design, executor: Executor | None = None) -> list[tuple[float, ...]]:
    """Return the worst of both objectives in the designs that none beats in both (Pareto).

    As many weights as the specification of ``design`` asks for, from 4 to 1 to 1 to 4, each
    polished from the design; sorted. The work is spread over ``executor``.
    """
    tilts = np.geomspace(0.25, 4.0, design.specification.tradeoff)
    found = [design.worst, *mapped(partial(_tilted, design), tilts, executor)]
    unbeaten = [
        one for one in found
        if not any(
            min(np.subtract(other, one)) >= -_EQUAL and max(np.subtract(other, one)) > _EQUAL
            for other in found
        )
    ]
    places = {tuple(np.round(one, EQUAL_MEASURES - 2)): one for one in unbeaten}
    return sorted(places.values())


def _tilted(design: Design, tilt: float) -> tuple[float, ...]:
    """Return the worst of each objective where the first one counts ``tilt`` times less."""
    specification = design.specification
    judge = _Judge(specification, tilt)
    low, high = np.array([(one.low, one.high) for one in specification.free]).T
    values = _polished(judge, low, high, design.values)
    better = min((values, design.values), key=judge.cost)
    return tuple(judge.worst(better))


class _Judge:
    """Judges designs: a vector of measures to be large, and one of margins to be positive."""

    def __init__(self, specification: Specification, tilt: float = 1.0) -> None:
        self.specification = specification
        posts = states(specification, specification.start)
        self._scales = [
            one.scale or one.bound(posts[0]) or 1.0 for one in specification.objectives
        ]
        self._scales[0] *= tilt
        self._sizes = [one.count(posts[0]) * len(posts) for one in specification.objectives]
        self._margins = len(_margins(specification, posts))

    def judged(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return all measures over their scales, and the margins, of the design ``values``."""
        try:
            posts = states(self.specification, values)
        except FaultToleranceError:
            return np.zeros(sum(self._sizes)), np.full(self._margins, -1.0)
        parts = [
            np.concatenate([one.values(post) for post in posts]) / scale
            for one, scale in zip(self.specification.objectives, self._scales, strict=True)
        ]
        return np.concatenate(parts), _margins(self.specification, posts)

    def cost(self, values: FloatArray) -> float:
        """Return what is to be small: the worst measure, negative, and missing margins."""
        measures, margins = self.judged(values)
        return float(-measures.min() - _PENALTY * margins.min(initial=0.0))

    def worst(self, values: FloatArray) -> list[float]:
        """Return the worst of each objective, as it is."""
        measures, _ = self.judged(values)
        parts = np.split(measures, np.cumsum(self._sizes)[:-1])
        return [float(part.min()) * scale for part, scale in zip(parts, self._scales, strict=True)]


def _polished(judge: _Judge, low: FloatArray, high: FloatArray, start: FloatArray) -> FloatArray:
    """Return the best design near ``start``: the largest z with every measure above z."""
    size = high - low

    def apart(point: FloatArray) -> FloatArray:
        measures, margins = judge.judged(low + size * point[:-1])
        return np.concatenate([measures - point[-1], margins])

    def height(point: FloatArray) -> tuple[float, FloatArray]:
        slope = np.zeros(len(point))
        slope[-1] = -1.0
        return float(-point[-1]), slope

    first: FloatArray = np.append((start - low) / size, judge.judged(start)[0].min())
    ends = [*[(0.0, 1.0)] * len(low), (-np.inf, np.inf)]
    above: Any = {'type': 'ineq', 'fun': apart}
    options: Any = {'maxiter': _STEPS, 'ftol': _ENOUGH}
    found = minimize(
        height, first, jac=True, method='SLSQP', bounds=ends, constraints=above, options=options,
    )
    return np.asarray(low + size * np.clip(found.x[:-1], 0.0, 1.0))


def _margins(specification: Specification, posts: list[PostFailure]) -> FloatArray:
    """Return by how much the constraints are met: characteristic lengths, all to be positive."""
    mechanism = posts[0].mechanism
    found = []
    if specification.distance > 0.0:
        apart = strut_distances(mechanism) - specification.distance
        found.append(apart / mechanism.characteristic_length)
    if specification.strokes:
        low, high = mechanism.position_limits.T
        scale = mechanism.rate_scale / mechanism.characteristic_length
        for post in posts:
            at = post.configuration.actuator_values
            room = np.minimum(at - low, high - at) * scale
            found.append(np.minimum(room, 1.0))
    return np.concatenate(found) if found else np.zeros(0)


def strut_distances(mechanism: Mechanism) -> FloatArray:
    """Return the distances of any two struts of ``mechanism`` at home, in metres.

    A strut is the line from its first revolute joint to its last.
    """
    ends = [
        [joint.point for joint in strut.joints if joint.kind == 'revolute'] for strut in
        mechanism.struts
    ]
    lines = [(one[0], one[-1]) for one in ends if one]
    return np.array([
        _distance(*first, *second)
        for place, first in enumerate(lines) for second in lines[:place]
    ])


def _distance(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> float:
    """Return the distance of the line from a to b and that from c to d."""
    along, other, apart = b - a, d - c, a - c
    matrix = np.array([[along @ along, -along @ other], [-along @ other, other @ other]])
    inside = np.linalg.lstsq(matrix, [-along @ apart, other @ apart], rcond=None)[0]
    spots = [np.clip(inside, 0.0, 1.0)]
    # The nearest spots may lie at an end of either line.
    for end in (0.0, 1.0):
        on_other = ((apart + end * along) @ other) / max(float(other @ other), 1e-300)
        on_one = ((c + end * other - a) @ along) / max(float(along @ along), 1e-300)
        spots += [np.array([end, np.clip(on_other, 0, 1)]), np.array([np.clip(on_one, 0, 1), end])]
    return min(float(np.linalg.norm(apart + s * along - t * other)) for s, t in spots)
