# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where to write names in a drawing so that they cover neither each other nor the lines."""

from __future__ import annotations

from math import pi

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray

_GAPS = (3.0, 9.0, 16.0, 26.0, 40.0, 58.0, 80.0, 110.0)
_DIRECTIONS = 24
_ROUNDS = 4
# What a label may not do costs more than any distance.
_OUTSIDE = 1e5
_ON_LABEL = 1e4
_ON_LINE = 120.0
# Beyond so many pixels the distance counts more and more.
_FAR = 7.0
_LEADER_ON_LABEL = 800.0
_LEADER_ON_LEADER = 200.0


def placed_labels(
    anchors: FloatArray, sizes: FloatArray, lines: FloatArray, weights: FloatArray,
    bounds: tuple[float, float, float, float],
) -> FloatArray:
    """Return the centres of the labels (k, 2), found by a few rounds of moving one at a time.

    All in pixels: ``anchors`` (k, 2) are what the labels name, ``sizes`` (k, 2) their widths and
    heights with margin, ``lines`` (m, 5) those of the drawing as x y x y and half their width,
    ``weights`` (m,) how bad it is to cover each (1 for black ink), ``bounds`` the left, lower,
    right and upper limit.
    """
    count = len(anchors)
    middle = anchors.mean(axis=0) if count else np.zeros(2)
    candidates = [
        _candidates(anchor, size, middle) for anchor, size in zip(anchors, sizes, strict=True)
    ]
    fixed = [
        _fixed_cost(places, anchors[index], sizes[index], lines, weights, bounds)
        for index, places in enumerate(candidates)
    ]
    best = [places[int(np.argmin(cost))] for places, cost in zip(candidates, fixed, strict=True)]
    centres = np.array(best).reshape(count, 2)
    # The most crowded choose first.
    order = np.argsort([-cost.min() for cost in fixed])
    for _ in range(_ROUNDS):
        for index in order.tolist():
            others = np.arange(count) != index
            cost = fixed[index] + _mutual_cost(
                candidates[index], sizes[index], anchors[index],
                centres[others], sizes[others], anchors[others],
            )
            centres[index] = candidates[index][int(np.argmin(cost))]
    return centres


def _candidates(anchor: FloatArray, size: FloatArray, middle: FloatArray) -> FloatArray:
    """Return centres (c, 2) on rounded boxes about the anchor, outward ones first."""
    outward = float(np.arctan2(*(anchor - middle)[::-1]))
    steps = np.arange(_DIRECTIONS)
    turns = np.where(steps % 2 == 0, 1, -1) * ((steps + 1) // 2) * (2.0 * pi / _DIRECTIONS)
    directions = np.stack([np.cos(outward + turns), np.sin(outward + turns)], axis=1)
    half = 0.5 * size
    # From the centre of a box to its edge in a direction.
    with np.errstate(divide='ignore'):
        edge = np.min(half / np.abs(directions), axis=1)
    return np.concatenate([anchor + directions * (edge + gap)[:, None] for gap in _GAPS])


def _fixed_cost(
    centres: FloatArray, anchor: FloatArray, size: FloatArray, lines: FloatArray,
    weights: FloatArray, bounds: tuple[float, float, float, float],
) -> FloatArray:
    """Return what the candidates of one label cost, whatever the other labels do."""
    left, lower, right, upper = bounds
    half = 0.5 * size
    beyond = np.maximum(np.array([left, lower]) + half - centres, 0.0)
    beyond += np.maximum(centres + half - np.array([right, upper]), 0.0)
    cost = _OUTSIDE * (beyond.max(axis=1) > 0.0) + _OUTSIDE * beyond.sum(axis=1)
    away = np.linalg.norm(centres - anchor, axis=1)
    cost += away + (away / _FAR) ** 2
    # Later candidates point less and less outward.
    cost += 0.2 * (np.arange(len(centres)) % _DIRECTIONS)
    for line, weight in zip(lines, weights.tolist(), strict=True):
        cost += _ON_LINE * weight * _meets(line[:4], centres, size + 2.0 * line[4])
    return np.asarray(cost)


def _mutual_cost(
    centres: FloatArray, size: FloatArray, anchor: FloatArray,
    others: FloatArray, other_sizes: FloatArray, other_anchors: FloatArray,
) -> FloatArray:
    """Return what the candidates of one label cost beside the others where they are now."""
    cost = np.zeros(len(centres))
    apart = np.abs(centres[:, None] - others[None]) - 0.5 * (size + other_sizes)[None]
    cost += _ON_LABEL * (apart < 0.0).all(axis=2).sum(axis=1)
    for other, other_size, other_anchor in zip(others, other_sizes, other_anchors, strict=True):
        leader = np.concatenate([other, other_anchor])
        cost += _LEADER_ON_LABEL * _meets(leader, centres, size)
        leaders = np.hstack([centres, np.broadcast_to(anchor, centres.shape)])
        cost += _LEADER_ON_LABEL * _meets(leaders, other, other_size)
        cost += _LEADER_ON_LEADER * _lines_meet_line(leaders, leader)
    return cost


def _meets(lines: FloatArray, centres: FloatArray, size: FloatArray) -> FloatArray:
    """Return 1 where a line x y x y meets the box of ``size`` about a centre.

    There is one of ``lines`` (4,) for many ``centres`` (c, 2), or the other way round.
    """
    half = 0.5 * size
    start, step = lines[..., :2] - centres, lines[..., 2:] - lines[..., :2]
    safe = np.where(np.abs(step) < 1e-9, 1e-9, step)
    first, second = (-half - start) / safe, (half - start) / safe
    enters = np.minimum(first, second).max(axis=1)
    leaves = np.maximum(first, second).min(axis=1)
    return np.asarray((enters < leaves) & (leaves > 0.0) & (enters < 1.0), dtype=np.float64)


def _lines_meet_line(lines: FloatArray, line: FloatArray) -> FloatArray:
    """Return 1 where a line of (c, 4) crosses ``line``."""

    def side(ends: FloatArray, points: FloatArray) -> FloatArray:
        along, towards = ends[..., 2:] - ends[..., :2], points - ends[..., :2]
        return np.asarray(along[..., 0] * towards[..., 1] - along[..., 1] * towards[..., 0])

    theirs = side(line, lines[:, :2]) * side(line, lines[:, 2:]) < 0.0
    ours = side(lines, line[:2]) * side(lines, line[2:]) < 0.0
    return np.asarray(theirs & ours, dtype=np.float64)
