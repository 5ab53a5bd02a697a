# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A drawing of points in space in one view, and the placement of names clear of its lines."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, log10
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.gridspec import GridSpecBase
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

from fault_tolerance.analysis.labels import placed_labels
from fault_tolerance.mechanism.arrays import FloatArray

STEEL = '0.35'
_MOST_NAMES = 50
_LEADER_FROM = 22.0  # pixels


@dataclass(frozen=True, eq=False)
class View:
    """A parallel projection: rows of ``axes`` (3, 3) point right, up and at the reader."""

    axes: FloatArray

    def flat(self, points: FloatArray) -> FloatArray:
        """Return ``points`` (..., 3), metres in base axes, on the paper (..., 2)."""
        return np.asarray(points @ self.axes[:2].T)

    def nearness(self, points: FloatArray) -> FloatArray:
        """Return how near to the reader ``points`` (..., 3) are, metres."""
        return np.asarray(points @ self.axes[2])


@dataclass(frozen=True, eq=False)
class Name:
    """Something to be written at ``place`` (3,).

    Where there are too many names, those of the highest ``rank`` are left out.
    """

    rank: int
    text: str
    place: FloatArray
    colour: str
    bold: bool = False


@dataclass(frozen=True, eq=False)
class _Ink:
    """A line from ``ends[0]`` to ``ends[1]`` (2, 2), half as wide as ``half_width`` points."""

    ends: FloatArray
    half_width: float
    weight: float


class Paper:
    """Draws lines, marks and names; everything added is remembered as an obstacle to names.

    Points are in base axes, metres; what has a higher ``level`` is drawn over the rest.
    """

    def __init__(self, axes: Axes, view: View) -> None:
        self.view = view
        self._axes = axes
        self._ink: list[_Ink] = []
        self._names: list[Name] = []

    @property
    def extent(self) -> FloatArray:
        """Width and height of what is drawn, metres."""
        return np.array([np.ptp(self._axes.get_xlim()), np.ptp(self._axes.get_ylim())])

    @property
    def grid(self) -> GridSpecBase:
        """The grid of the figure."""
        place = self._axes.get_subplotspec()
        assert place is not None
        return place.get_gridspec()

    def line(self, points: FloatArray, level: float, **style: Any) -> None:
        """Draw a line through ``points`` (k, 3) at ``level``, in a ``style`` of matplotlib."""
        flat = self.view.flat(points)
        style = {'color': STEEL, 'solid_capstyle': 'round', **style}
        self._axes.plot(*flat.T, zorder=level, **style)
        corners = [*flat[: -1 : max(1, len(flat) // 8)], flat[-1]]
        for ends in zip(corners, corners[1:], strict=False):
            self._ink.append(_Ink(np.array(ends), 0.5 * style['linewidth'], 1.0))

    def mark(
        self, place: FloatArray, marker: Any, size: float, level: float, **style: Any
    ) -> None:
        """Draw ``marker`` of ``size`` points at ``place`` (3,), ``level``, in ``style``."""
        flat = self.view.flat(place)
        style |= {'marker': marker, 'markersize': size, 'linestyle': 'none'}
        self._axes.plot(*flat, zorder=level, **style)
        self._ink.append(_Ink(np.array([flat, flat]), 0.5 * size, 1.0))

    def area(self, corners: FloatArray, level: float, weight: float, **style: Any) -> None:
        """Draw the hull of ``corners`` (k, 3) at ``level``, in a polygon's ``style``.

        Its edges may be covered with a name at the cost ``weight``.
        """
        flat = self.view.flat(corners)
        # QJ: corners seen edge-on are moved a little, so that they have a hull as well.
        outline = flat[ConvexHull(flat, qhull_options='QJ').vertices]
        self._axes.add_patch(Polygon(outline, zorder=level, **style))
        for ends in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            self._ink.append(_Ink(np.array(ends), 0.5, weight))

    def pointer(
        self, ends: FloatArray, level: float, colour: str, dashes: Any, shift: float = 0.0
    ) -> None:
        """Draw an arrow along ``ends`` (2, 3) at ``level``, ``shift`` metres aside.

        ``colour`` and ``dashes`` are those of a line in matplotlib.
        """
        flat = self.view.flat(ends)
        along = flat[1] - flat[0]
        length = float(np.linalg.norm(along))
        if shift:
            flat = flat + shift * np.array([along[1], -along[0]]) / length
            self._ink.append(_Ink(flat, 3.0, 1.0))
        arrow = {'arrowstyle': '-|>', 'color': colour, 'linewidth': 1.3, 'linestyle': dashes}
        arrow |= {'shrinkA': 0, 'shrinkB': 0}
        self._axes.annotate('', flat[1], flat[0], arrowprops=arrow, zorder=level)

    def name(self, name: Name) -> None:
        """Add ``name``, placed when the drawing is complete."""
        self._names.append(name)

    def finish(self) -> None:
        """Set the scale and add what tells it."""
        self._axes.set_aspect('equal')
        self._axes.margins(x=0.24, y=0.15)
        self._axes.set_axis_off()
        self._axes.autoscale_view()
        self._axes.autoscale(False)
        low, high = self._axes.get_ylim()
        # Room for the scale and the axes below.
        self._axes.set_ylim(low - 0.08 * (high - low), high)
        self._scale_bar()
        self._triad()

    def write_names(self) -> None:
        """Write the names where there is room for them, once everything has its final size."""
        names = self._readable_names()
        if not names:
            return
        figure = self._axes.figure
        renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
        written = [
            self._axes.text(
                0.0, 0.0, name.text, fontsize=8.5 if name.bold else 7.5,
                fontweight='bold' if name.bold else 'normal', color=name.colour,
                ha='center', va='center', zorder=30.0,
            )
            for name in names
        ]
        boxes = [text.get_window_extent(renderer) for text in written]
        sizes = np.array([(box.width + 3.0, box.height + 1.0) for box in boxes])
        to_pixels = self._axes.transData
        anchors = to_pixels.transform(self.view.flat(np.array([name.place for name in names])))
        point = figure.dpi / 72.0
        lines = [
            (*to_pixels.transform(ink.ends).ravel(), ink.half_width * point) for ink in self._ink
        ]
        weights = np.array([ink.weight for ink in self._ink])
        area = self._axes.get_window_extent(renderer)
        bounds = (area.x0, area.y0, area.x1, area.y1)
        centres = placed_labels(anchors, sizes, np.array(lines), weights, bounds)
        back = to_pixels.inverted()
        for text, centre, anchor, size in zip(written, centres, anchors, sizes, strict=True):
            text.set_position(tuple(back.transform(centre)))
            nearest = centre + np.clip(anchor - centre, -0.5 * size, 0.5 * size)
            if np.linalg.norm(anchor - nearest) > _LEADER_FROM:
                ends = back.transform(np.array([nearest, anchor]))
                self._axes.plot(*ends.T, color='0.55', linewidth=0.6, zorder=9.0)

    def _readable_names(self) -> list[Name]:
        for rank in sorted({name.rank for name in self._names}, reverse=True):
            names = [name for name in self._names if name.rank <= rank]
            if len(names) <= _MOST_NAMES:
                return names
        return []

    def _scale_bar(self) -> None:
        (left, right), (low, high) = self._axes.get_xlim(), self._axes.get_ylim()
        length = _round_length(0.25 * (right - left))
        end = right - 0.03 * (right - left)
        level = low + 0.02 * (high - low)
        ends = np.array([[end - length, level], [end, level]])
        self._axes.plot(*ends.T, color='black', linewidth=2.5, solid_capstyle='butt')
        self._axes.annotate(
            _metres(length), (end - 0.5 * length, level), (0, 4), textcoords='offset points',
            ha='center', va='bottom', fontsize=8,
        )
        self._ink.append(_Ink(ends, 14.0, 1.0))

    def _triad(self) -> None:
        """Draw the directions of the base axes in a corner."""
        (left, _), (low, _) = self._axes.get_xlim(), self._axes.get_ylim()
        length = 0.06 * float(self.extent.max())
        corner = np.array([left + 0.6 * length, low + 0.9 * length])
        for name, axis in zip('xyz', np.eye(3), strict=True):
            step = length * self.view.flat(axis)
            if np.linalg.norm(step) < 0.1 * length:
                continue
            ends = np.array([corner, corner + step])
            self._axes.plot(*ends.T, color='black', linewidth=1.1)
            place = corner + 1.3 * step
            self._axes.annotate(
                name, tuple(place), ha='center', va='center', fontsize=8, fontstyle='italic'
            )
            self._ink.append(_Ink(ends, 8.0, 1.0))


def _round_length(length: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten not above ``length``."""
    power = 10.0 ** floor(log10(length))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= length))


def _metres(length: float) -> str:
    if length >= 1.0:
        return f'{length:g} m'
    return f'{1e2 * length:g} cm' if length >= 0.01 else f'{1e3 * length:g} mm'
