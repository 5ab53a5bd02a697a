# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The picture of a route: over the map, and what the next failure would leave along it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fault_tolerance.analysis.line_styles import BLUE, VERMILION
from fault_tolerance.design.map_figure import (
    COLOURS,
    RESOLUTION,
    chart,
    label,
    levels_of,
    outline,
    scaled,
)
from fault_tolerance.design.routes import Route, straight_profile

__all__ = ['RESOLUTION', 'route_figure']

_ROUTE: dict[str, Any] = {'color': 'white', 'linewidth': 2.2}
_STRAIGHT: dict[str, Any] = {'color': VERMILION, 'linewidth': 1.2, 'linestyle': (0, (4, 2))}


def route_figure(route: Route) -> Figure:
    """Return the picture of ``route``."""
    found = route.found
    figure = Figure(figsize=(10.5, 4.4), layout='constrained')
    FigureCanvasAgg(figure)
    figure.suptitle(
        f'{found.mechanism.name}: widest route', fontsize=12, fontweight='bold', x=0.01, ha='left'
    )
    if len(found.grid.axes) == 1:
        _along(figure.subplots(), route)
    else:
        over, along = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
        _over(figure, over, route)
        _along(along, route)
    return figure


def _over(figure: Figure, axes: Axes, route: Route) -> None:
    """Draw the route over the first two coordinates of the map."""
    found, pair = route.found, route.found.grid.axes[:2]
    worst, good = found.worst, found.tolerable & found.reachable
    title = 'smallest of p, t, h of the next failure'
    if worst.ndim == 3:
        worst, good = np.fmax.reduce(worst, axis=2), np.asarray(good.any(axis=2))
        title += f', largest over {found.grid.names[2]}'
    image = chart(axes, pair, worst, levels_of([worst]), COLOURS)
    outline(axes, pair, good, None)
    x, y = (scaled(axis)[0] * route.poses[:, place] for place, axis in enumerate(pair))
    axes.plot(x, y, color='black', linewidth=3.6)
    axes.plot(x, y, **_ROUTE)
    axes.plot(x[[0, -1]], y[[0, -1]], **_STRAIGHT)
    axes.plot(x[0], y[0], 'o', color='white', markeredgecolor='black', markersize=7)
    axes.plot(x[-1], y[-1], 's', color='white', markeredgecolor='black', markersize=7)
    axes.set_xlabel(label(pair[0]))
    axes.set_ylabel(label(pair[1]))
    axes.set_title(title, fontsize=10)
    figure.colorbar(image, ax=axes, format='%.3g')


def _along(axes: Axes, route: Route) -> None:
    """Draw the smallest measure along the route, and along the straight line."""
    even = np.linspace(0.0, 1.0, len(route.profile))
    share = np.interp(even, np.linspace(0.0, 1.0, len(route.way)), route.way / route.way[-1])
    axes.plot(100.0 * share, route.profile, color=BLUE, linewidth=1.8, label='route')
    axes.plot(100.0 * even, straight_profile(route), label='straight', **_STRAIGHT)
    axes.set_xlim(0.0, 100.0)
    axes.set_ylim(0.0, None)
    axes.set_xlabel('way from start (circle) to goal (square), %')
    axes.set_ylabel('smallest measure')
    axes.grid(True, linewidth=0.4, color='0.8')
    axes.legend(frameon=False, fontsize=9)
