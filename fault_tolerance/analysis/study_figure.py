# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The figure of a study of detection: how soon, how often wrong, one against the other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fault_tolerance.analysis.study_results import PER_UNIT

SHOWN = 'mirror_4_strut'
"""Whose delays are drawn."""


def draw_study(summary: dict[str, Any], path: Path) -> None:
    """Draw the figures of ``summary`` to ``path``."""
    figure = Figure(figsize=(13.0, 4.2), layout='constrained')
    FigureCanvasAgg(figure)
    delays, heights, trade = figure.subplots(1, 3)
    _delays(delays, summary)
    _heights(heights, summary)
    _trade(trade, summary)
    figure.savefig(path, dpi=150)


def _delays(axes: Axes, summary: dict[str, Any]) -> None:
    """Draw the delay against the amplitude of the motion, median and 95 %."""
    shown = [one for one in summary['failures']
             if one['mechanism'] == SHOWN and not one['probing']]
    for fault in sorted({one['fault'] for one in shown}):
        rows = sorted((one for one in shown if one['fault'] == fault),
                      key=lambda one: float(one['amplitude']))
        sizes = [1e6 * one['amplitude'] for one in rows]
        (line,) = axes.loglog(
            sizes, [_number(one['delay_median']) for one in rows], 'o-', label=fault
        )
        axes.loglog(sizes, [_number(one['delay_p95']) for one in rows], '--',
                    color=line.get_color())
    axes.set_xlabel('circle of 1 Hz, µrad')
    axes.set_ylabel('delay, cycles of 10 ms (dashed: 95 %)')
    axes.set_title(SHOWN)
    axes.legend(frameon=False)
    axes.grid(alpha=0.3)


def _heights(axes: Axes, summary: dict[str, Any]) -> None:
    """Draw how often the evidence of a healthy machine rises to a height, and its bound."""
    for name, one in summary['mechanisms'].items():
        above = np.cumsum(np.array(one['histogram'])[::-1])[::-1] / one['cycles']
        height = np.arange(len(above)) / PER_UNIT
        (line,) = axes.semilogy(height, np.where(above > 0.0, above, np.nan), label=name)
        axes.axvline(one['threshold'], color=line.get_color(), alpha=0.4, linewidth=1.0)
        axes.semilogy(height, (one['hypotheses'] - 1) * np.exp(-height), ':',
                      color=line.get_color())
    axes.set_xlim(0.0, 35.0)
    axes.set_ylim(1e-10, 10.0)
    axes.set_xlabel('height of an excursion (dotted: bound; lines: thresholds)')
    axes.set_ylabel('so high or higher, per cycle')
    axes.set_title(f'{summary["healthy"]["cycles"]:.2g} healthy cycles, models wrong')
    axes.legend(frameon=False, fontsize='small')
    axes.grid(alpha=0.3)


def _trade(axes: Axes, summary: dict[str, Any]) -> None:
    """Draw what is noticed within ten cycles against false alarms, by threshold."""
    healthy = summary['mechanisms'].get(SHOWN)
    if healthy is None:
        return
    above = np.cumsum(np.array(healthy['histogram'])[::-1])[::-1] / healthy['cycles']
    for one in summary['failures']:
        if one['mechanism'] != SHOWN or one['probing'] or one['fault'] != 'stuck':
            continue
        levels = sorted(map(int, one['passed']))
        rates = [max(above[PER_UNIT * level], 0.3 / healthy['cycles']) for level in levels]
        axes.semilogx(rates, [one['passed'][str(level)][1] for level in levels], '.-',
                      label=f'{1e6 * one["amplitude"]:.0f} µrad')
    axes.set_xlabel('excursions so high, per healthy cycle')
    axes.set_ylabel('stuck drives noticed within 10 cycles')
    axes.set_ylim(-0.03, 1.03)
    axes.set_title('thresholds 2 to 25 (left edge: no excursion)')
    axes.legend(frameon=False, fontsize='small')
    axes.grid(alpha=0.3)


def _number(value: float | None) -> float:
    return float('nan') if value is None else value
