# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The picture of detection on a recording: the odds of the best hypotheses over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import shorten

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fault_tolerance.analysis.line_styles import BLUE, GREEN, ORANGE, PURPLE, VERMILION
from fault_tolerance.analysis.series import Evidence, Span

RESOLUTION = 150
"""Dots per inch."""

MOST_CURVES = 6
"""Hypotheses that are drawn."""

_LONGEST = 60
_COLOURS = (VERMILION, BLUE, GREEN, PURPLE, ORANGE, 'black')
_STROKES = ('solid', (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)), (0, (8, 2)), (0, (3, 3)))


def write_odds_figure(evidence: Evidence, picture: Path) -> None:
    """Write the figure of ``evidence`` to ``picture`` (.png)."""
    figure = odds_figure(evidence)
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=RESOLUTION)


def odds_figure(evidence: Evidence) -> Figure:
    """Return the figure of ``evidence``."""
    figure = Figure(figsize=(11.0, 5.2), layout='constrained')
    FigureCanvasAgg(figure)
    strip, axes = figure.subplots(
        2, 1, sharex=True, gridspec_kw={'height_ratios': (1.0, 5.5), 'hspace': 0.02}
    )
    figure.suptitle(
        f'{evidence.title}: failures that nobody has reported', fontsize=13, fontweight='bold',
        x=0.01, ha='left',
    )
    _draw_spans(strip, evidence)
    limit = float(np.nanmax(evidence.threshold)) if len(evidence.time) else 1.0
    _draw_odds(axes, evidence, limit)
    for begin, end, _ in evidence.failures:
        axes.axvspan(begin, end, color='0.92', linewidth=0, zorder=0)
    for number, (moment, sentence) in enumerate(evidence.findings, 1):
        axes.axvline(
            moment, color='black', linewidth=1.0, linestyle=(0, (4, 2)), zorder=4,
            label=shorten(f'{number}: {sentence}', _LONGEST, placeholder='...'),
        )
        axes.annotate(
            str(number), (moment, 1.0), xycoords=('data', 'axes fraction'), xytext=(4, -4),
            textcoords='offset points', va='top', fontsize=9, fontweight='bold',
        )
    # Linear to the threshold, where it is decided; evidence afterwards may be any size.
    axes.set_yscale('symlog', linthresh=limit, linscale=2.0)
    axes.set_ylim(0.0, 2.0 * max(limit, _largest(evidence)))
    ticks = [0.0, 10.0, 20.0, *(10.0**k for k in range(2, 8) if 10.0**k > limit)]
    axes.set_yticks([one for one in ticks if one < axes.get_ylim()[1]])
    axes.yaxis.set_major_formatter(lambda value, _: f'{value:g}')
    axes.minorticks_off()
    axes.set_xlim(0.0, max(float(evidence.time[-1]) if len(evidence.time) else 0.0, 1e-3))
    axes.set_xlabel('time since the first joint state, s')
    axes.set_ylabel('log odds against healthy')
    axes.grid(True, axis='y', linewidth=0.4, color='0.75', zorder=1)
    figure.legend(
        *axes.get_legend_handles_labels(), loc='outside lower left', frameon=False, fontsize=8.5,
        ncols=3,
    )
    return figure


def chosen(evidence: Evidence) -> list[str]:
    """Return the names of the hypotheses to draw, those that rose highest in ``evidence``."""
    peaks = {
        name: float(np.nanmax(values)) for name, values in evidence.odds.items()
        if np.isfinite(values).any()
    }
    rising = [name for name in peaks if peaks[name] > 0.0]
    return sorted(rising, key=lambda name: -peaks[name])[:MOST_CURVES]


def _largest(evidence: Evidence) -> float:
    return max((float(np.nanmax(evidence.odds[name])) for name in chosen(evidence)), default=0.0)


def _draw_odds(axes: Axes, evidence: Evidence, limit: float) -> None:
    """Draw the hypotheses and the threshold; the best one lies on top."""
    for place, name in enumerate(chosen(evidence)):
        axes.plot(
            evidence.time, evidence.odds[name], label=name, color=_COLOURS[place],
            linestyle=_STROKES[place], linewidth=1.6 - 0.1 * place, zorder=3.5 - 0.1 * place,
        )
    axes.plot(
        evidence.time, evidence.threshold, color='0.35', linewidth=1.0, zorder=2,
        label=f'threshold ({limit:.1f})',
    )


def _draw_spans(axes: Axes, evidence: Evidence) -> None:
    """Draw when which state, and which reported failures, were there, as bars with their names."""
    rows: Sequence[tuple[str, Sequence[Span], str]] = (
        ('state', evidence.states, '#BBD7EA'), ('reported', evidence.failures, '0.85'),
    )
    whole = max(float(evidence.time[-1]) if len(evidence.time) else 0.0, 1e-3)
    for place, (_, spans, colour) in enumerate(rows):
        for begin, end, text in spans:
            left, right = max(begin, 0.0), min(end, whole)
            if right <= left:
                continue
            axes.barh(place, right - left, left=left, height=0.86, color=colour)
            room = int(110 * (right - left) / whole)
            if room > 3:
                axes.text(
                    left, place, f' {text if len(text) <= room else text[: room - 2] + ".."}',
                    va='center', ha='left', fontsize=8.5, clip_on=True,
                )
    axes.set_ylim(1.5, -0.5)
    axes.set_yticks(range(len(rows)), [name for name, *_ in rows])
    axes.tick_params(labelbottom=False, length=0)
    for side in ('top', 'right', 'bottom', 'left'):
        axes.spines[side].set_visible(False)
