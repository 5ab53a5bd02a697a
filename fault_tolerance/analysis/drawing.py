# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism on paper: struts, joints, drives and their names, with what has failed."""

from __future__ import annotations

from math import cos, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fault_tolerance.analysis.paper import STEEL, Paper, View
from fault_tolerance.analysis.scene import Scene, scene_of
from fault_tolerance.analysis.sketch import (
    CROSS,
    DRIVE,
    FAINT,
    FREE,
    FREE_DASHES,
    HINGE,
    LOST_DOTS,
    PLATFORM,
    SPHERE,
    STUCK,
    Sketch,
)
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import failures_in_words
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import Configuration

_AZIMUTH, _ELEVATION = radians(-62.0), radians(24.0)
_HEIGHT, _WIDTH, _LEAST_WIDTH = 7.0, 9.0, 8.4  # inches
_TITLE, _LEGEND = 0.5, 0.5
_PLAN_WIDTH = (2.4, 4.2)


def mechanism_figure(configuration: Configuration, failures: FailureSet | None = None) -> Figure:
    """Return a drawing of the mechanism at ``configuration`` with ``failures`` marked.

    A planar mechanism is seen along its axes, any other one at an angle and from above.
    """
    scene = scene_of(configuration)
    failures = failures or FailureSet()
    views = [_view_at_an_angle(), View(np.eye(3))]
    if scene.normal is not None:
        views = [_view_along(scene.normal)]
    figure = Figure()
    FigureCanvasAgg(figure)
    charts = figure.subplots(1, len(views), squeeze=False)[0]
    figure.suptitle(_title(scene, failures), fontsize=12)
    figure.legend(
        handles=_legend(scene, failures), loc='lower center', ncols=6, frameon=False,
        fontsize=8.5,
    )
    papers = [Paper(axes, view) for axes, view in zip(charts, views, strict=True)]
    for index, paper in enumerate(papers):
        Sketch(paper, scene, failures, plan=index > 0).draw()
    for axes in charts[1:]:
        axes.set_title('from above', fontsize=9, color=STEEL)
    _fit(figure, papers)
    # Names are placed on pixels, so everything else must have its place first.
    figure.draw_without_rendering()
    for paper in papers:
        paper.write_names()
    return figure


def _fit(figure: Figure, papers: list[Paper]) -> None:
    """Give the figure the size its views need: the first is the large one."""
    shapes = [paper.extent for paper in papers]
    height = min(_HEIGHT, _WIDTH * shapes[0][1] / shapes[0][0])
    widths = [height * shape[0] / shape[1] for shape in shapes]
    widths = [widths[0], *(float(np.clip(width, *_PLAN_WIDTH)) for width in widths[1:])]
    whole = height + _TITLE + _LEGEND
    figure.set_size_inches(max(sum(widths), _LEAST_WIDTH), whole)
    papers[0].grid.set_width_ratios(widths)
    figure.subplots_adjust(
        left=0.01,
        right=0.99,
        bottom=_LEGEND / whole,
        top=1.0 - _TITLE / whole,
        wspace=0.03,
    )


def save_figure(figure: Figure, path: Path) -> None:
    """Write ``figure`` in the format of the ending of ``path``."""
    figure.savefig(path, dpi=150)


def _view_at_an_angle() -> View:
    right = np.array([-sin(_AZIMUTH), cos(_AZIMUTH), 0.0])
    level = np.array([cos(_AZIMUTH), sin(_AZIMUTH), 0.0])
    out = cos(_ELEVATION) * level + np.array([0.0, 0.0, sin(_ELEVATION)])
    return View(np.array([right, np.cross(out, right), out]))


def _view_along(normal: FloatArray) -> View:
    # x to the right where possible, as on paper.
    hint = np.eye(3)[0] if abs(normal[0]) < 0.9 else np.eye(3)[1]
    right = hint - (hint @ normal) * normal
    right = right / np.linalg.norm(right)
    return View(np.array([right, np.cross(normal, right), normal]))


def _title(scene: Scene, failures: FailureSet) -> str:
    return f'{scene.name}: {failures_in_words(failures)}' if failures else scene.name


def _legend(scene: Scene, failures: FailureSet) -> list[Any]:
    letters = {joint.letter for strut in scene.struts for joint in strut.joints}
    mark: dict[str, Any] = {'color': 'black', 'linestyle': 'none'}
    hinge = {'color': 'black', 'linewidth': HINGE}
    if scene.normal is not None:
        hinge = {**mark, 'marker': 'o', 'markersize': 5, 'markerfacecolor': 'white'}
    cross = {**mark, 'marker': '+', 'markersize': CROSS, 'markeredgewidth': 2.2}
    sphere = {**mark, 'marker': 'o', 'markersize': SPHERE, 'markerfacecolor': 'white'}
    base = {**mark, 'marker': '^', 'markersize': 10, 'color': '0.8', 'markeredgecolor': FAINT}
    stuck = {**mark, 'marker': 'x', 'markersize': 8, 'color': STUCK, 'markeredgewidth': 2.2}
    free = {'color': FREE, 'linestyle': FREE_DASHES, 'linewidth': 2}
    entries = [
        (True, 'driven (arrow: positive)', {'color': DRIVE, 'linewidth': 6}),
        ('R' in letters, 'revolute joint', hinge),
        ('U' in letters, 'universal joint', cross),
        ('S' in letters, 'spherical joint', sphere),
        (True, 'base', base),
        (True, 'platform', {'color': PLATFORM, 'linewidth': 8, 'alpha': 0.5}),
        (bool(failures.stuck), 'stuck', stuck),
        (bool(failures.free), 'free', free),
        (bool(failures.lost), 'lost', {'color': FAINT, 'linestyle': LOST_DOTS}),
    ]
    return [Line2D([], [], label=label, **style) for shown, label, style in entries if shown]
