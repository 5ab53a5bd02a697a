# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The picture of a demonstration: error and forces with and without recovery."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fault_tolerance.analysis.demonstration import PhaseRecord
from fault_tolerance.mechanism.arrays import FloatArray

# Okabe and Ito's blue and vermilion: told apart by everybody, and in grey print by lightness.
COLOURS = {'recovered': '#0072B2', 'unrecovered': '#D55E00'}
LABELS = {'recovered': 'with recovery', 'unrecovered': 'without recovery'}
# A force of exactly zero has no place on a logarithmic axis.
_LEAST_FORCE = 1e-4
_LEAST_ERROR = 1e-3


def demonstration_figure(passes: Mapping[str, Sequence[PhaseRecord]], period: float) -> Figure:
    """Return the figure of a demonstration.

    Parameters
    ----------
    passes : mapping of str to sequence of PhaseRecord
        The records 'recovered' and 'unrecovered', of the same phases.
    period : float
        Seconds of the reference, marked on the error.
    """
    figure = Figure(figsize=(11.0, 6.2), layout='constrained')
    axes = figure.subplot_mosaic(
        [['errors', 'path'], ['forces', 'path']], width_ratios=(2.6, 1.0)
    )
    errors, forces = axes['errors'], axes['forces']
    forces.sharex(errors)
    errors.tick_params(labelbottom=False)
    lengths = [
        max(float(records[index].time.max(initial=0.0)) for records in passes.values())
        for index in range(len(passes['recovered']))
    ]
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    _shade(errors, forces, passes['recovered'], starts)
    # Drawn first is drawn below: the recovered line must stay in sight.
    for name in sorted(passes, reverse=True):
        _draw_errors(errors, passes[name], starts, name, period)
        _draw_forces(forces, passes[name], starts, lengths, name)
    errors.set_ylabel('pointing error, µrad')
    errors.set_yscale('log')
    forces.set_ylabel('largest strut force, N')
    forces.set_yscale('log')
    forces.set_xlabel('time, s (mending and clearing between phases left out)')
    errors.legend(loc='upper left', ncols=2, frameon=False, fontsize=9)
    for chart in (errors, forces):
        chart.grid(True, which='major', axis='y', linewidth=0.4, alpha=0.6)
        chart.set_xlim(0.0, float(starts[-1]))
    _draw_path(axes['path'], passes)
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """Write ``figure`` in the format of the ending of ``path``."""
    figure.savefig(path, dpi=150)


def _shade(
    errors: Axes, forces: Axes, records: Sequence[PhaseRecord], starts: FloatArray
) -> None:
    for index, record in enumerate(records):
        begin, end = float(starts[index]), float(starts[index + 1])
        for axes in (errors, forces):
            if record.phase.failures:
                axes.axvspan(begin, end, color='0.94' if index % 2 else '0.90', linewidth=0)
            axes.axvline(begin, color='0.6', linewidth=0.6)
        name = record.phase.name.replace(', ', ',\n')
        verdict = '' if record.state in ('nominal', 'degraded') else f'\n({record.state})'
        errors.annotate(
            name + verdict,
            (0.5 * (begin + end), 1.0),
            xycoords=('data', 'axes fraction'),
            xytext=(0, 4),
            textcoords='offset points',
            ha='center',
            va='bottom',
            fontsize=8.5,
        )


def _draw_errors(
    axes: Axes, records: Sequence[PhaseRecord], starts: FloatArray, name: str, period: float
) -> None:
    for index, record in enumerate(records):
        length = 1e6 * np.linalg.norm(record.error, axis=1)
        length = np.maximum(length, _LEAST_ERROR)
        axes.plot(
            starts[index] + record.time,
            length,
            color=COLOURS[name],
            linewidth=0.9,
            label=LABELS[name] if index == 0 else None,
        )


def _draw_forces(
    axes: Axes,
    records: Sequence[PhaseRecord],
    starts: FloatArray,
    lengths: Sequence[float],
    name: str,
) -> None:
    for index, record in enumerate(records):
        if not record.efforts.size:
            continue
        largest = np.abs(record.efforts - record.preload).max(axis=1)
        time = np.linspace(0.0, lengths[index], len(largest))
        axes.plot(
            starts[index] + time,
            np.maximum(largest, _LEAST_FORCE),
            color=COLOURS[name],
            linewidth=0.9,
        )


def _draw_path(axes: Axes, passes: Mapping[str, Sequence[PhaseRecord]]) -> None:
    """Draw where the mirror pointed in the first phase with a failure."""
    index = next(
        (i for i, record in enumerate(passes['recovered']) if record.phase.failures), 0
    )
    for name in sorted(passes, reverse=True):
        record = passes[name][index]
        settled = record.time >= record.settled
        path = 1e3 * (record.reference - record.error)[settled]
        axes.plot(path[:, 0], path[:, 1], color=COLOURS[name], linewidth=1.4, label=LABELS[name])
    reference = 1e3 * passes['recovered'][index].reference
    axes.plot(
        reference[:, 0],
        reference[:, 1],
        color='black',
        linewidth=0.8,
        linestyle=(0, (4, 3)),
        label='reference',
    )
    axes.set_aspect('equal')
    axes.set_title(f'mirror path, {passes["recovered"][index].phase.name}', fontsize=10)
    axes.set_xlabel('tilt about x, mrad')
    axes.set_ylabel('tilt about y, mrad')
    axes.grid(True, linewidth=0.4, alpha=0.6)
    axes.legend(loc='upper center', bbox_to_anchor=(0.5, -0.18), frameon=False, fontsize=9)
