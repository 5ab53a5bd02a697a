# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Routes over a map that stay where the next failure hurts least.

The widest of all ways, whose smallest measure is the largest, runs along a maximum spanning tree
of the map; of those that are as wide the shortest is taken. A fail-safe one stays where the goal
is still within reach whichever single drive sticks there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.ndimage import generate_binary_structure, label
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, dijkstra, minimum_spanning_tree

from fault_tolerance.design.maps import ToleranceMap
from fault_tolerance.design.pose_measures import PoseMeasures, by_pose, pose_measures
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, IntArray, frozen
from fault_tolerance.tolerances import ROUNDING_TOLERANCE

PER_LEG = 16
"""Samples between two places of a grid, of what is measured along a route."""

SAME_WIDTH = 1e-4
"""Measures that differ by less are the same: no detour is worth that."""

BETWEEN = 3
"""Samples between two neighbours of a map whose poses are measured together."""

SHARE_OF_SPEED = 0.5
"""Of the drives' speed limits, used along a route."""


@dataclass(frozen=True, eq=False)
class Route:
    """A way over a map, in straight lines between poses."""

    found: ToleranceMap
    poses: FloatArray
    """(w, k): coordinates of the map, from start to goal."""
    times: FloatArray
    """(w,): seconds, at half of what the drives' speed limits allow; evenly where they have none.
    """
    way: FloatArray
    """(w,): metres from the start, rotations times the characteristic length."""
    profile: FloatArray
    """(q,): the smallest measure all along it, `PER_LEG` samples from pose to pose; NaN out of
    reach."""

    def __repr__(self) -> str:
        return f'Route({len(self.poses)} poses, smallest measure {self.smallest})'

    @property
    def smallest(self) -> float | None:
        """The smallest measure of the next failure all along; None if it leaves the reach."""
        return least(self.profile)


class _Graph:
    """The poses of a map that are ``allowed``, with neighbours along its axes and diagonals."""

    def __init__(self, found: ToleranceMap, allowed: BoolArray) -> None:
        worst = np.where(allowed, np.nan_to_num(found.worst), 0.0).ravel()
        self.worst = _rounded(worst)
        shape = np.array(found.grid.shape)
        numbers = np.arange(worst.size)
        places = np.stack(np.unravel_index(numbers, found.grid.shape), axis=1)
        pairs, lengths = [], []
        for step in product((-1, 0, 1), repeat=len(shape)):
            if step <= (0,) * len(shape):
                continue  # every pair once
            there = places + step
            inside = ((there >= 0) & (there < shape)).all(axis=1)
            other = np.ravel_multi_index(tuple(there[inside].T), found.grid.shape)
            pairs.append(np.stack([numbers[inside], other], axis=1))
            sizes = [one * axis.step for one, axis in zip(step, found.grid.axes, strict=True)]
            lengths.append(np.full(len(other), np.linalg.norm(sizes * _metric(found))))
        joined, sizes_of = np.concatenate(pairs), np.concatenate(lengths)
        open_ = (self.worst[joined] > 0.0).all(axis=1)
        self.pairs, self.lengths = joined[open_], sizes_of[open_]
        self.widths = self.worst[self.pairs].min(axis=1)
        if by_pose(found.mechanism) and len(self.pairs):
            # A surface where a measure is 0 may lie between two places that know nothing of it.
            ends = found.grid.poses[self.pairs]
            lines = _measured(found, ends[:, 0], ends[:, 1], BETWEEN + 1)
            widths = np.nan_to_num(_smallest(lines)).reshape(-1, BETWEEN + 1).min(axis=1)
            self.widths = np.minimum(self.widths, _rounded(widths))

    def sparse(self, weights: FloatArray, chosen: BoolArray) -> csr_array:
        """Return the graph of the ``chosen`` pairs (e,) with ``weights`` (e,) above 0."""
        first, second = self.pairs[chosen].T
        size = (self.worst.size,) * 2
        result = csr_array((weights[chosen], (first, second)), shape=size)
        # What csgraph of older scipy takes.
        result.indices, result.indptr = (
            one.astype(np.int32) for one in (result.indices, result.indptr)
        )
        return result

    def widest(self, start: int, goal: int) -> float:
        """Return the largest width of any way from ``start`` to ``goal``; 0 if there is none."""
        if start == goal:
            return float(self.worst[start])
        # Measures are at most 1: no weight is 0, which would be no edge.
        graph = self.sparse(2.0 - self.widths, self.widths > 0.0)
        tree = minimum_spanning_tree(graph)
        before = breadth_first_order(tree, start, directed=False)[1]
        way = _way(np.asarray(before, dtype=np.intp), start, goal)
        if not len(way):
            return 0.0
        weights = np.maximum(tree[way[:-1], way[1:]], tree[way[1:], way[:-1]])
        return 2.0 - float(np.max(weights))

    def shortest(self, start: int, goal: int, width: float) -> IntArray:
        """Return the places of the shortest way that is nowhere narrower than ``width``."""
        graph = self.sparse(self.lengths, self.widths >= width - SAME_WIDTH / 2.0)
        before = dijkstra(graph, directed=False, indices=[start], return_predecessors=True)[1]
        return _way(np.asarray(before[0], dtype=np.intp), start, goal)


def widest_route(
    found: ToleranceMap, start: Mapping[str, float], goal: Mapping[str, float],
    allowed: BoolArray | None = None,
) -> Route | None:
    """Return the widest route over the map ``found``, the shortest of those; None without any.

    From the pose ``start`` to the pose ``goal``, coordinates of the map (those left out are 0),
    along the poses ``allowed`` (over the grid; all that are within reach by default).
    FaultToleranceError if an end is not on the map.
    """
    reachable = found.reachable & found.tolerable
    graph = _Graph(found, reachable if allowed is None else reachable & allowed)
    ends = [nearest(found, where) for where in (start, goal)]
    width = graph.widest(ends[0], ends[1])
    if width <= 0.0:
        return None
    way = graph.shortest(ends[0], ends[1], width)
    poses = [_coordinates(found, start), *found.grid.poses[way], _coordinates(found, goal)]
    kept = [one for place, one in enumerate(poses)
            if place == 0 or np.abs(one - poses[place - 1]).max() > ROUNDING_TOLERANCE]
    return _route(found, np.array(kept))


def least(profile: FloatArray) -> float | None:
    """Return the smallest of ``profile``; None if a pose of it is out of reach."""
    return float(profile.min()) if np.isfinite(profile).all() else None


def straight_profile(route: Route) -> FloatArray:
    """Return the smallest measure (q,) along the straight way between the ends of ``route``."""
    ends = route.poses[[0, -1]]
    return _profile(route.found, ends, len(route.profile) - 1)


def fail_safe(found: ToleranceMap, goal: Mapping[str, float]) -> BoolArray:
    """Return where on the map ``found`` the ``goal`` stays within reach if any one drive sticks.

    A drive that is stuck leaves the poses where it has its value: of the poses within one step of
    it, those that hang together with one at the goal, whose secondary coordinates may differ. So
    it is known to the resolution of the map.
    """
    task, grid = found.mechanism.task, found.grid
    major = [place for place, axis in enumerate(grid.axes) if axis.name in task.major]
    wanted = np.unravel_index(nearest(found, goal), grid.shape)
    at_goal = np.ones(grid.shape, dtype=np.bool_)
    for place in major:
        here = np.arange(grid.shape[place]) == wanted[place]
        at_goal &= here.reshape([-1 if one == place else 1 for one in range(len(grid.shape))])
    good = found.reachable & found.tolerable
    result = good.copy()
    touching = generate_binary_structure(len(grid.shape), len(grid.shape))
    for values in found.measures.actuator_values.T:
        value = values.reshape(grid.shape)
        if not np.isfinite(value[good]).any():
            continue
        steps = [np.abs(np.diff(value, axis=axis)) for axis in range(value.ndim)]
        size = max(float(np.nanmax(step, initial=0.0)) for step in steps)
        bins = np.floor(np.nan_to_num(value) / (size or 1.0)).astype(int)
        for number in np.unique(bins[good]):
            there = good & (bins == number)
            parts, _ = label(there, touching)
            result[there & ~np.isin(parts, parts[there & at_goal])] = False
    return result


def nearest(found: ToleranceMap, where: Mapping[str, float]) -> int:
    """Return the number of the pose of ``found`` that is nearest to ``where``.

    FaultToleranceError if that is not on the map.
    """
    indices = []
    for axis, value in zip(found.grid.axes, _coordinates(found, where), strict=True):
        index = round((value - axis.low) / axis.step)
        if not 0 <= index < axis.count:
            reason = f'{axis.name} {value:g} is not on the map ({axis.low:g} to {axis.high:g})'
            raise FaultToleranceError(reason)
        indices.append(index)
    return int(np.ravel_multi_index(indices, found.grid.shape))


def _coordinates(found: ToleranceMap, where: Mapping[str, float]) -> FloatArray:
    for name in where:
        if name not in found.grid.names:
            raise FaultToleranceError(f'{name} is not a coordinate of the map')
    return np.array([where.get(name, 0.0) for name in found.grid.names])


def _route(found: ToleranceMap, poses: FloatArray) -> Route:
    size = np.linalg.norm(np.diff(poses, axis=0) * _metric(found), axis=1)
    at = pose_measures(found.mechanism, found.grid.names, poses, found.failures).actuator_values
    limits = found.mechanism.velocity_limits * SHARE_OF_SPEED
    seconds = np.nan_to_num(np.abs(np.diff(at, axis=0)) / limits).max(axis=1, initial=0.0)
    if not np.isfinite(limits).any():
        seconds = size / max(float(size.sum()), 1e-300)
    times = np.concatenate([[0.0], np.cumsum(seconds)])
    profile = _profile(found, poses, PER_LEG)
    way = np.concatenate([[0.0], np.cumsum(size)])
    return Route(found, frozen(poses), frozen(times), frozen(way), frozen(profile))


def _profile(found: ToleranceMap, poses: FloatArray, count: int) -> FloatArray:
    """Return the smallest measure at ``count`` samples of each line between ``poses``, and end."""
    lines = _measured(found, poses[:-1], poses[1:], count)
    last = pose_measures(found.mechanism, found.grid.names, poses[-1:], found.failures)
    return np.concatenate([_smallest(lines), _smallest(last)])


def _measured(
    found: ToleranceMap, first: FloatArray, second: FloatArray, count: int
) -> PoseMeasures:
    """Return the measures at ``count`` samples of each line, the ``first`` ends (e, k) included.

    The others are ``second``.
    """
    share = np.arange(count)[:, None] / count
    samples = first[:, None] + share * (second - first)[:, None]
    flat = samples.reshape(-1, first.shape[1])
    return pose_measures(found.mechanism, found.grid.names, flat, found.failures)


def _smallest(measures: PoseMeasures) -> FloatArray:
    worst = np.fmin(measures.position.min(axis=1), measures.torque.min(axis=1))
    smallest = np.fmin(worst, measures.hard.min(axis=1))
    return np.asarray(np.where(measures.reachable, smallest, np.nan))


def _rounded(measures: FloatArray) -> FloatArray:
    """Return ``measures`` rounded up, so that what is above 0 stays so."""
    return np.asarray(np.ceil(measures / SAME_WIDTH) * SAME_WIDTH)


def _metric(found: ToleranceMap) -> FloatArray:
    length = found.mechanism.characteristic_length
    return np.array([length if axis.unit == 'rad' else 1.0 for axis in found.grid.axes])


def _way(before: IntArray, start: int, goal: int) -> IntArray:
    """Return the places from ``start`` to ``goal``, given what is ``before`` each; or none."""
    way = [goal]
    while way[-1] != start:
        way.append(int(before[way[-1]]))
        if way[-1] < 0:
            return np.zeros(0, dtype=np.intp)
    return np.array(way[::-1], dtype=np.intp)
