# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism on paper: struts, joints, drives and their names, with what has failed."""

from __future__ import annotations

from math import cos, radians, sin
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fault_tolerance.analysis.paper import STEEL, Paper, View
from fault_tolerance.analysis.scene import scene_of
from fault_tolerance.analysis.sketch import Sketch, legend
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.verdict import failures_in_words
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
    title = f'{scene.name}: {failures_in_words(failures)}' if failures else scene.name
    figure.suptitle(title, fontsize=12)
    handles = legend(scene, failures)
    figure.legend(handles=handles, loc='lower center', ncols=6, frameon=False, fontsize=8.5)
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
    bottom, top = _LEGEND / whole, 1.0 - _TITLE / whole
    figure.subplots_adjust(left=0.01, right=0.99, bottom=bottom, top=top, wspace=0.03)


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
