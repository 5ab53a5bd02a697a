# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The picture of a map: where the platform may go so that no single failure is fatal."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from fault_tolerance.analysis.line_styles import BLUE, GREEN, ORANGE, VERMILION
from fault_tolerance.design.grids import Axis
from fault_tolerance.design.maps import ToleranceMap
from fault_tolerance.kinematics.verdict import failures_in_words
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.tolerances import EQUAL_MEASURES

RESOLUTION = 150
"""Dots per inch."""

_PANEL = (4.0, 3.5)
_MOST_SLICES = 6
COLOURS, _POOR = 'cividis', 'cividis_r'
_LEAST_CONTRAST = 0.02
_OUT = '0.88'
_EDGE: dict[str, Any] = {'colors': VERMILION, 'linewidths': 1.6}
_PROVEN: dict[str, Any] = {'colors': 'white', 'linewidths': 1.1, 'linestyles': ((0, (4, 1.6)),)}


def map_figure(found: ToleranceMap) -> Figure:
    """Return the picture of the map ``found``."""
    count = len(found.grid.axes)
    draw = (_curves, _charts, _slices)[count - 1]
    figure = Figure(layout='constrained')
    FigureCanvasAgg(figure)
    draw(figure, found)
    title = f'{found.mechanism.name}: the next failure'
    if found.failures:
        title += f', after {failures_in_words(found.failures)}'
    figure.suptitle(title, fontsize=12, fontweight='bold', x=0.01, ha='left')
    return figure


def scaled(axis: Axis) -> tuple[float, str]:
    """Return what turns the values of ``axis`` into those drawn, and their unit."""
    largest = max(abs(axis.low), abs(axis.high))
    if axis.unit == 'rad':
        return (1e3, 'mrad') if largest < 0.2 else (np.degrees(1.0), 'deg')
    return (1e3, 'mm') if largest < 1.0 else (1.0, 'm')


def label(axis: Axis) -> str:
    """Return the words beside ``axis``: what it is, in which unit."""
    what = 'rotation about' if axis.unit == 'rad' else 'displacement along'
    return f'{what} {axis.name[1:]}, {scaled(axis)[1]}'


def _quantities(found: ToleranceMap) -> list[tuple[str, FloatArray]]:
    """Return what is drawn, with its title; what equals another is drawn once."""
    p, t, h = found.position, found.torque, found.hard
    same = np.array_equal(
        np.round(t, EQUAL_MEASURES), np.round(h, EQUAL_MEASURES), equal_nan=True
    )
    charts = [('p of the worst stuck drive', p)]
    charts += [('t = h of the worst free drive or lost strut', t)] if same else [
        ('t of the worst free drive', t), ('h of the worst lost strut', h),
    ]
    return [*charts, ('condition number', found.condition_number)]


def _curves(figure: Figure, found: ToleranceMap) -> None:
    """Draw the measures over one coordinate."""
    figure.set_size_inches(8.0, 4.6)
    (axis,), (axes, below) = found.grid.axes, figure.subplots(
        2, 1, sharex=True, height_ratios=(2.2, 1.0)
    )
    factor, _ = scaled(axis)
    x, inside = factor * axis.places, found.reachable
    styles = ((BLUE, 'solid', 1.6), (ORANGE, 'solid', 3.6), ('black', (0, (1, 1.2)), 1.4))
    *measures, (name, condition) = _quantities(found)
    for (text, values), (colour, stroke, width) in zip(measures, styles, strict=False):
        axes.plot(x, np.where(inside, values, np.nan), color=colour, linestyle=stroke,
                  linewidth=width, label=text)
    if found.proof is not None:
        axes.stairs(found.proof.least, x, color=GREEN, label='proven: nowhere less', zorder=1)
    below.plot(x, np.where(inside, condition, np.nan), color='black', linewidth=1.2)
    below.set_ylabel(name)
    below.set_xlabel(label(axis))
    axes.set_ylabel('measure')
    axes.set_ylim(0.0, None)
    figure.legend(loc='outside lower left', frameon=False, fontsize=9, ncols=3)
    for one in (axes, below):
        one.fill_between(x, 0, 1, where=~inside, color=_OUT, linewidth=0, step='mid',
                         transform=one.get_xaxis_transform())
        one.set_xlim(x[0], x[-1])
        one.grid(True, linewidth=0.4, color='0.8')


def _charts(figure: Figure, found: ToleranceMap) -> None:
    """Draw each quantity over two coordinates."""
    charts = _quantities(found)
    axes = _panels(figure, len(charts), found.grid.axes)
    for one, (title, values) in zip(axes, charts, strict=True):
        poor = title.startswith('condition')
        shown = np.where(found.reachable, values, np.nan)
        image = chart(one, found.grid.axes, shown, levels_of([shown]), _POOR if poor else COLOURS)
        outline(one, found.grid.axes, found.tolerable & found.reachable, None if (
            found.proof is None) else found.proof.share == 1.0)
        one.set_title(title, fontsize=10)
        figure.colorbar(image, ax=one, format='%.3g')
    place = found.worst_place()
    if place is not None:
        x, y = (scaled(axis)[0] * place['at'][axis.name] for axis in found.grid.axes)
        for one in axes:
            one.plot(x, y, marker='x', color=VERMILION, markersize=7, clip_on=False)
    _legend(figure, found, '' if place is None else (
        f'worst: {place["failure"]}, {place["measure"]:.3g}'
    ))


def _slices(figure: Figure, found: ToleranceMap) -> None:
    """Draw the worst measure over two coordinates, at several places of the third."""
    axes = found.grid.axes
    through = int(np.argmin(found.grid.shape))
    others = tuple(axis for place, axis in enumerate(axes) if place != through)
    axis = axes[through]
    chosen = np.unique(np.linspace(0, axis.count - 1, min(axis.count, _MOST_SLICES)).astype(int))
    worst = np.moveaxis(found.worst, through, 0)
    good = np.moveaxis(found.tolerable & found.reachable, through, 0)
    levels, factor, unit = levels_of(list(worst[chosen])), *scaled(axis)
    panels = _panels(figure, len(chosen), others)
    for panel, index in zip(panels, chosen, strict=True):
        image = chart(panel, others, worst[index], levels, COLOURS)
        outline(panel, others, good[index], None)
        panel.set_title(f'{axis.name} {factor * axis.places[index]:.4g} {unit}', fontsize=10)
    bar = figure.colorbar(image, ax=panels, format='%.3g')
    bar.set_label('smallest of p, t, h of the next failure')
    _legend(figure, found, '')


def _panels(figure: Figure, count: int, axes: Sequence[Axis]) -> list[Axes]:
    columns = count if count < 4 else ceil(count / 2)
    rows = ceil(count / columns)
    figure.set_size_inches(_PANEL[0] * columns, _PANEL[1] * rows + 0.6)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    panels = list(grid.ravel())
    for one in panels[count:]:
        one.set_visible(False)
    for column in range(columns):
        last = -1 if (rows - 1) * columns + column < count else -2
        grid[last, column].set_xlabel(label(axes[0]))
        grid[last, column].tick_params(labelbottom=True)
    for row in grid:
        row[0].set_ylabel(label(axes[1]))
    return panels[:count]


def levels_of(shown: Sequence[FloatArray]) -> FloatArray:
    """Return the levels of contours, from the smallest to the largest of what is shown."""
    values = np.concatenate([one[np.isfinite(one)] for one in shown])
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    # Smaller differences are nothing to look at.
    room = max(_LEAST_CONTRAST * abs(high) - (high - low), 1e-6 * (high == low)) / 2.0
    room = max(room, 0.0)
    return np.asarray(MaxNLocator(8).tick_values(low - room, high + room))


def chart(
    axes: Axes, pair: Sequence[Axis], values: FloatArray, levels: FloatArray, colours: str
) -> QuadMesh:
    """Draw ``values`` over a ``pair`` of coordinates on ``axes``, and return the image.

    In the map of ``colours``, with contours at ``levels``.
    """
    x, y = (scaled(axis)[0] * axis.places for axis in pair)
    axes.set_facecolor(_OUT)
    image = axes.pcolormesh(
        x, y, values.T, vmin=levels[0], vmax=levels[-1], cmap=colours, shading='nearest',
        rasterized=True,
    )
    seen = values[np.isfinite(values)]
    crossed = [one for one in levels if len(seen) and seen.min() < one < seen.max()]
    if crossed:
        lines = axes.contour(x, y, values.T, crossed, colors='black', linewidths=0.5)
        axes.clabel(lines, fmt='%.3g', fontsize=7)
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    if pair[0].unit == pair[1].unit:
        axes.set_aspect('equal')
    return image


def outline(
    axes: Axes, pair: Sequence[Axis], good: BoolArray, proven: BoolArray | None
) -> None:
    """Draw on ``axes`` the edges of where no single failure is fatal (``good``).

    And of where that is ``proven``, over a ``pair`` of coordinates.
    """
    x, y = (scaled(axis)[0] * axis.places for axis in pair)
    if good.any() and not good.all():
        axes.contour(x, y, good.T.astype(float), [0.5], **_EDGE)
    if proven is not None and proven.any():
        # Cells have sides: their outline goes along these.
        fine = np.kron(np.pad(proven, 1).astype(float), np.ones((8, 8)))
        steps = (np.interp((np.arange(len(fine_axis)) + 0.5) / 8 - 1, range(len(edges)), edges)
                 for fine_axis, edges in ((fine, x), (fine.T, y)))
        axes.contour(*steps, fine.T, [0.5], **_PROVEN)


def _legend(figure: Figure, found: ToleranceMap, worst: str) -> None:
    handles = [
        Patch(color=_OUT, label='out of reach'),
        Line2D([], [], color=VERMILION, linewidth=1.6, label='edge of where none is fatal'),
    ]
    if found.proof is not None:
        handles.append(Patch(
            facecolor='0.5', edgecolor='white', linestyle=(0, (4, 1.6)), linewidth=1.1,
            label='proven all over',
        ))
    if worst:
        handles.append(Line2D([], [], color=VERMILION, marker='x', linestyle='', label=worst))
    figure.legend(handles=handles, loc='outside lower left', ncols=4, frameon=False, fontsize=9)
