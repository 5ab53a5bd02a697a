# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The picture of a run: where the mirror pointed, and over time error, forces, rates, measures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fault_tolerance.analysis.first_moments import draw_first_moments, noticed_phase
from fault_tolerance.analysis.line_styles import (
    ACTUATOR_COLOURS,
    LABELS,
    MEASURE_STYLES,
    REFERENCE,
    STROKES,
    STYLES,
)
from fault_tolerance.analysis.phases import PhaseRecord
from fault_tolerance.analysis.runs import RECOVERED, UNRECOVERED, Run
from fault_tolerance.analysis.series import Series
from fault_tolerance.mechanism.arrays import FloatArray

# A logarithmic axis has no place for zero: what is less than this is on its lower edge.
_LEAST = {'error': 1e-2, 'force': 1e-4}
_MOST_PATHS = 8

_WIDTH, _LEFT, _RIGHT = 14.5, 0.95, 1.9  # inches, as all that follows
_TITLE, _HEADS, _PANEL, _GAP, _BOTTOM = 0.62, 0.5, 1.75, 0.16, 0.55


def report_figure(run: Run) -> Figure:
    """Return the figure of ``run``; what was not recorded is left out."""
    panels = _panels(run)
    count = min(len(run.main), _MOST_PATHS) if any(len(one.path) for one in run.main) else 0
    side = (_WIDTH - _LEFT - _RIGHT) / max(count, 3)
    paths = (side + 0.45 if count else 0.0) + _HEADS
    noticed = noticed_phase(run)
    further = 0.0 if noticed is None else _PANEL + _BOTTOM + _GAP
    height = _TITLE + paths + len(panels) * (_PANEL + _GAP) + _BOTTOM + further
    figure = Figure(figsize=(_WIDTH, height))
    FigureCanvasAgg(figure)
    title, subtitle = _words(run)
    left, width = _LEFT / _WIDTH, (_WIDTH - _LEFT - _RIGHT) / _WIDTH
    text: dict[str, Any] = {'x': left, 'va': 'center'}
    figure.text(y=1.0 - 0.26 / height, s=title, fontsize=13, fontweight='bold', **text)
    figure.text(y=1.0 - 0.5 / height, s=subtitle, fontsize=9.5, color='0.3', **text)
    if count:
        _draw_paths(figure, run, count, side, 1.0 - (_TITLE + _HEADS) / height)
    charts = []
    for index, draw in enumerate(panels):
        top = height - _TITLE - paths - index * (_PANEL + _GAP)
        axes = figure.add_axes((left, (top - _PANEL) / height, width, _PANEL / height))
        draw(axes, run)
        charts.append(axes)
    starts = _starts(run)
    for axes in charts:
        _shade(axes, run.main, starts)
        axes.tick_params(labelbottom=axes is charts[-1])
        _explain(axes)
    if charts:
        _number(charts[0], run.main, starts)
        between = '' if run.period is None else ' (mending and clearing between phases left out)'
        charts[-1].set_xlabel(f'time, s{between}')
    if noticed is not None:
        axes = figure.add_axes((left, _BOTTOM / height, width, _PANEL / height))
        draw_first_moments(axes, run, noticed)
        _explain(axes)
        charts.append(axes)
    figure.align_ylabels(charts)
    return figure


def _words(run: Run) -> tuple[str, str]:
    name = run.mechanism_name or 'a mechanism'
    if UNRECOVERED not in run.passes:
        named = ', '.join(f'{n} {one.phase.name}' for n, one in enumerate(run.main, 1))
        return f'{name}: a recorded run', _folded(named, 170).partition('\n')[0]
    return f'{name}: failures with recovery and without', (
        'With recovery the kinematics are derived anew without what has failed; '
        'without, the commands go on as if nothing had.'
    )


def _explain(axes: Axes) -> None:
    """Put the legend beside the chart; what was drawn last, and lies on top, comes first."""
    handles, labels = axes.get_legend_handles_labels()
    if axes.get_yscale() == 'log':  # where the passes are compared
        handles, labels = handles[::-1], labels[::-1]
    axes.legend(
        handles, labels, loc='upper left', bbox_to_anchor=(1.002, 1.04), frameon=False,
        fontsize=8.5, handlelength=2.8, handletextpad=0.5,
    )


def _panels(run: Run) -> list[Callable[[Axes, Run], None]]:
    """Return the functions that draw what there is data for."""
    panels: list[tuple[Callable[[Axes, Run], None], Callable[[PhaseRecord], Series]]] = [
        (_draw_errors, lambda record: record.error),
        (_draw_forces, lambda record: record.forces),
        (_draw_rates, lambda record: record.rates),
        (_draw_measures, lambda record: record.course),
    ]
    records = run.main
    return [draw for draw, of in panels if any(np.isfinite(of(r).values).any() for r in records)]


def _starts(run: Run) -> FloatArray:
    """Return where the phases begin on the common axis, and where the last one ends."""
    together = zip(*run.passes.values(), strict=True)
    lengths = [max(record.duration for record in records) for records in together]
    return np.concatenate([[0.0], np.cumsum(lengths)])


def _shade(axes: Axes, records: Sequence[PhaseRecord], starts: FloatArray) -> None:
    for index, record in enumerate(records):
        begin, end = float(starts[index]), float(starts[index + 1])
        if record.phase.failures:
            axes.axvspan(begin, end, color='0.95' if index % 2 else '0.90', linewidth=0, zorder=0)
        axes.axvline(begin, color='0.55', linewidth=0.7, zorder=1)
    axes.grid(True, which='major', axis='y', linewidth=0.4, color='0.75', zorder=1)
    axes.set_xlim(0.0, float(starts[-1]))


def _number(axes: Axes, records: Sequence[PhaseRecord], starts: FloatArray) -> None:
    """Write the numbers of the phases, where there is room for them."""
    for index in range(len(records)):
        begin, length = float(starts[index]), float(starts[index + 1] - starts[index])
        if length > 0.02 * float(starts[-1]):
            axes.annotate(
                str(index + 1), (begin, 1.0), xycoords=('data', 'axes fraction'),
                xytext=(4, -3), textcoords='offset points', va='top', fontsize=8.5,
                fontweight='bold', zorder=9,
                bbox={'boxstyle': 'circle,pad=0.15', 'facecolor': 'white', 'edgecolor': '0.4',
                      'linewidth': 0.7},
            )


def _draw_passes(
    axes: Axes, run: Run, least: float, values: Callable[[PhaseRecord], Series]
) -> None:
    # Drawn first is drawn below: the recovered line must stay in sight.
    for name in reversed(run.passes):
        series = map(values, run.passes[name])
        courses = [(one.time, np.maximum(one.values[:, 0], least)) for one in series]
        _draw_courses(axes.plot, run, courses, label=LABELS[name], zorder=3, **STYLES[name])
    axes.set_yscale('log')
    if axes.dataLim.y0 <= least:
        axes.set_ylim(bottom=least)


def _draw_courses(
    draw: Callable[..., Any], run: Run, courses: Sequence[tuple[FloatArray, FloatArray]],
    label: str, **style: Any,
) -> None:
    """Draw the times and values of each phase where it is on the common axis, labelled once."""
    for index, (begin, (time, values)) in enumerate(zip(_starts(run), courses, strict=False)):
        draw(begin + time, values, label=None if index else label, **style)


def _draw_errors(axes: Axes, run: Run) -> None:
    def micro(record: PhaseRecord) -> Series:
        length = 1e6 * np.linalg.norm(record.error.values, axis=1)
        return Series(record.error.time, length[:, None])

    _draw_passes(axes, run, _LEAST['error'], micro)
    axes.set_ylabel('pointing error\nµrad')


def _draw_forces(axes: Axes, run: Run) -> None:
    _draw_passes(axes, run, _LEAST['force'], lambda record: record.forces)
    axes.set_ylabel('largest strut force\nbeyond preload, N')


def _draw_rates(axes: Axes, run: Run) -> None:
    rates = [one.rates for one in run.main]
    largest = max(float(np.abs(one.values).max(initial=0.0)) for one in rates)
    factor, unit = _scale(largest, _rate_unit(run))
    for column, name in enumerate(run.actuators[:rates[0].values.shape[1]]):
        courses = [(one.time, factor * one.values[:, column]) for one in rates]
        _draw_courses(
            axes.plot, run, courses, label=name, linewidth=1.2, zorder=3,
            color=ACTUATOR_COLOURS[column % len(ACTUATOR_COLOURS)],
            linestyle=STROKES[column % len(STROKES)],
        )
    _draw_limits(axes, run.rate_limits, largest, factor, unit)
    words = f'{LABELS[RECOVERED]}, ' if UNRECOVERED in run.passes else ''
    axes.set_ylabel(f'commanded rate\n{words}{unit}')


def _draw_limits(
    axes: Axes, limits: FloatArray, largest: float, factor: float, unit: str
) -> None:
    """Draw the limits that are near, and say where the others are."""
    least = float(limits.min(initial=np.inf))
    bound = 1.35 * factor * (largest or 1.0)
    if not np.isfinite(least):
        words = 'no rate limit'
    elif least > 3.0 * largest:
        words = f'limit ±{factor * least:.3g} {unit}, far outside'
    else:
        bound = 1.35 * factor * max(least, largest)
        for sign in (-1.0, 1.0):
            axes.axhline(sign * factor * least, color='black', linewidth=1.6, zorder=2)
        words = f'limit ±{factor * least:.3g} {unit} (thick)'
    axes.set_ylim(-bound, bound)
    if not (largest or np.isfinite(least)):
        axes.set_yticks([0.0])
    # Above the legend's column, so that nothing is covered.
    axes.plot([], [], linestyle='none', label=_folded(words, 22))


def _draw_measures(axes: Axes, run: Run) -> None:
    for column, (label, style) in enumerate(MEASURE_STYLES):
        # Each value holds until the next one, the last until the end.
        courses = [
            (np.append(one.course.time, one.duration),
             np.append(one.course.values[:, column], one.course.values[-1:, column]))
            for one in run.main
        ]
        zorder = 3 + 0.1 * column
        _draw_courses(axes.step, run, courses, label, where='post', zorder=zorder, **style)
    highest = max(float(one.course.values.max(initial=0.0)) for one in run.main)
    axes.set_ylim(-0.05, 1.05 * highest if np.isfinite(highest) and highest > 1.0 else 1.08)
    axes.set_ylabel('measures\n(0: intolerable)')


def _draw_paths(figure: Figure, run: Run, count: int, side: float, top: float) -> None:
    """Draw where the mirror pointed, one square above its phase."""
    width, height = figure.get_size_inches()
    wanted = max(float(np.abs(one.reference.values).max(initial=0.0)) for one in run.main)
    factor, unit = _scale(wanted, 'rad')
    bound = 1.3 * factor * (wanted or 1.0)
    first: Axes | None = None
    for index in range(count):
        inset = 0.05 * side
        axes = figure.add_axes((
            (_LEFT + index * side + inset) / width, top - (side - inset) / height,
            (side - 2.0 * inset) / width, (side - 2.0 * inset) / height,
        ))
        for name in reversed(run.passes):
            record = run.passes[name][index]
            path = factor * record.path.values[record.path.time >= record.settled]
            axes.plot(path[:, 0], path[:, 1], **STYLES[name])
            # A mirror that stands still is a point.
            if len(path) and np.ptp(path, axis=0).max() < 0.02 * bound:
                size = 4.0 + 2.0 * STYLES[name]['linewidth']
                axes.plot(*path[-1], 'o', markersize=size, color=STYLES[name]['color'])
        reference = factor * run.main[index].reference.values
        axes.plot(reference[:, 0], reference[:, 1], **REFERENCE)
        axes.set_xlim(-bound, bound)
        axes.set_ylim(-bound, bound)
        axes.set_aspect('equal')
        axes.grid(True, linewidth=0.4, color='0.8')
        axes.tick_params(labelsize=8, labelleft=index == 0)
        axes.set_xlabel(f'tilt about x, {unit}', fontsize=8.5, labelpad=2)
        axes.set_title(_heading(index, run.main[index], side), fontsize=9.5, pad=5)
        first = first or axes
    assert first is not None
    first.set_ylabel(f'tilt about y, {unit}', fontsize=8.5, labelpad=2)
    handles = [Line2D([], [], label=LABELS[name], **STYLES[name]) for name in run.passes]
    handles.append(Line2D([], [], label='reference', **REFERENCE))
    figure.legend(
        handles=handles, loc='upper left', fontsize=8.5, frameon=False, handlelength=2.8,
        handletextpad=0.5, title='mirror path', alignment='left', borderpad=0.0,
        bbox_to_anchor=((width - _RIGHT + 0.09) / width, top),
    )


def _heading(index: int, record: PhaseRecord, side: float) -> str:
    kept = record.state in ('', 'nominal', 'degraded')
    name = record.phase.name + ('' if kept else f': {record.state}')
    return f'{index + 1}  {_folded(name, int(11.0 * side))}'


def _folded(text: str, width: int) -> str:
    return '\n'.join(wrap(text, max(width, 8), max_lines=3, placeholder=' ...'))


def _rate_unit(run: Run) -> str:
    if run.mechanism is None:
        return 'm/s or rad/s'
    kinds = {one.kind for one in run.mechanism.actuators}
    units = (('prismatic', 'm/s'), ('revolute', 'rad/s'))
    return ' or '.join(unit for kind, unit in units if kind in kinds)


def _scale(largest: float, unit: str) -> tuple[float, str]:
    """Return a factor and the unit after it in which ``largest`` is a handy number."""
    if ' or ' in unit or largest >= 0.5 or largest <= 0.0:
        return 1.0, unit
    return (1e3, f'm{unit}') if largest >= 5e-6 else (1e6, f'µ{unit}')
