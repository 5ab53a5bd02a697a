# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The pictures of a design: its measures before and after, and the mechanism."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fault_tolerance.analysis.drawing import mechanism_figure
from fault_tolerance.analysis.line_styles import BLUE, ORANGE, VERMILION
from fault_tolerance.analysis.report_page import (
    RESOLUTION,
    figure_as_svg,
    html_page,
    html_table,
    inline_figure,
)
from fault_tolerance.design.design_files import HEADS, design_rows
from fault_tolerance.design.objectives import Objective
from fault_tolerance.design.optimum import Design, states
from fault_tolerance.kinematics.reconfiguration import PostFailure


def write_figures(design: Design, report: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write design.png and .html of ``design`` and its ``report`` to ``folder``.

    Returns their paths.
    """
    now = states(design.specification, design.values)
    figure = measures_figure(design, now, report['tradeoff'])
    figures = [figure]
    if now[0].mechanism.struts:
        figures.append(mechanism_figure(now[0].configuration, now[0].failures))
    png, page = folder / 'design.png', folder / 'design.html'
    figure.savefig(png, dpi=RESOLUTION)
    made = f'from {report["file"]}, SHA-256 {report["sha256"]}, version {report["version"]}'
    free = [
        (', '.join(one['path']), f'{one["range"][0]:g} to {one["range"][1]:g}',
         f'{one["value"]:.9g}')
        for one in report['free']
    ]
    parts = (
        *(inline_figure(figure_as_svg(one)) for one in figures),
        html_table(made, HEADS, design_rows(report)),
        html_table('free numbers', ('path', 'range', 'now'), free),
    )
    sentence = '; '.join(f'{row[0]}: {row[2]} (before {row[1]})' for row in design_rows(report))
    page.write_text(html_page(f'{report["design"]}: a design', sentence, *parts), encoding='utf-8')
    return [png, page]


def measures_figure(
    design: Design, now: list[PostFailure], between: Sequence[Sequence[float]] = ()
) -> Figure:
    """Return the figure of all measures of ``design``, ``now`` and before, from worst to best.

    And, where there are designs ``between`` two objectives, of the worst of both in each.
    """
    specification = design.specification
    before = states(specification, specification.start)
    count = len(specification.objectives) + bool(between)
    figure = Figure(figsize=(4.6 * count + 0.8, 3.6), layout='constrained')
    FigureCanvasAgg(figure)
    charts = figure.subplots(1, count, squeeze=False)[0]
    for axes, one in zip(charts, specification.objectives, strict=False):
        _measures(axes, one, before, now)
    if between:
        _trade_off(charts[-1], design, between)
    figure.suptitle(specification.name, fontsize=12, fontweight='bold', x=0.01, ha='left')
    return figure


def _trade_off(axes: Axes, design: Design, between: Sequence[Sequence[float]]) -> None:
    """Draw the worst of both objectives in all designs that none beats in both."""
    axes.plot(*zip(*between, strict=True), 'o-', color=BLUE, linewidth=1.2, label='unbeaten')
    axes.plot(*design.start, 's', color=ORANGE, markersize=8, label='before')
    axes.plot(*design.worst, 'D', color='black', markersize=7, label='now')
    first, second = design.specification.objectives
    axes.set_xlabel(f'worst {first}')
    axes.set_ylabel(f'worst {second}')
    axes.grid(True, linewidth=0.4, color='0.85')
    axes.legend(frameon=False, fontsize=9)


def _measures(
    axes: Axes, objective: Objective, before: list[PostFailure], now: list[PostFailure]
) -> None:
    """Draw the measure of every set of failures at every pose, sorted."""
    for posts, colour, words in ((before, ORANGE, 'before'), (now, BLUE, 'now')):
        values = np.sort(np.concatenate([objective.values(post) for post in posts]))
        axes.step(
            np.linspace(0.0, 100.0, len(values) + 1), [*values, values[-1]], where='post',
            color=colour, linewidth=2.0, label=words,
        )
    for value, words, stroke in (
        (objective.bound(now[0]), 'bound of the worst', 'solid'),
        (objective.packing(now[0]), 'packing', (0, (4, 2))),
    ):
        if value:
            axes.axhline(value, color=VERMILION, linewidth=1.0, linestyle=stroke, label=words)
    axes.set_xlim(0.0, 100.0)
    axes.set_ylim(0.0, None)
    axes.set_xlabel('sets of failures, worst first, %')
    axes.set_ylabel(str(objective))
    axes.grid(True, linewidth=0.4, color='0.85')
    axes.legend(frameon=False, fontsize=9)
