# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The chart of the first moments after a failure that nobody reported."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from fault_tolerance.analysis.delays import commanded_after
from fault_tolerance.analysis.line_styles import LABELS, STYLES, VERMILION
from fault_tolerance.analysis.runs import Run

_SHORTEST = 0.2
_DELAYS_SHOWN = 5.0
# A logarithmic axis has no place for zero.
_LEAST = 1e-2


def noticed_phase(run: Run) -> int | None:
    """Return the index of the first phase in which a silent failure was noticed.

    Parameters
    ----------
    run : Run

    Returns
    -------
    int or None
        None if there is no such phase.
    """
    noticed = [
        index for index, one in enumerate(run.main)
        if one.phase.silent and one.found is not None and len(one.error)
    ]
    return noticed[0] if noticed else None


def draw_first_moments(axes: Axes, run: Run, index: int) -> None:
    """Draw the error of the phase ``index`` until some time after its failure was noticed.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    run : Run
    index : int
        Of a phase in which something was found.
    """
    found = run.main[index].found
    assert found is not None
    end = max(_SHORTEST, _DELAYS_SHOWN * found.time)
    for name in reversed(run.passes):
        error = run.passes[name][index].error
        shown = error.time < end
        length = np.maximum(1e6 * np.linalg.norm(error.values[shown], axis=1), _LEAST)
        axes.plot(
            1e3 * error.time[shown], length, marker='.', zorder=3,
            label=LABELS[name], **STYLES[name],
        )
    commanded = commanded_after(run, run.main[index])
    if commanded is not None:
        axes.axvline(
            1e3 * commanded, color='0.3', linestyle=(0, (1, 1.2)), linewidth=1.4, zorder=2,
            label=f'first µm told: {1e3 * commanded:.0f} ms',
        )
    axes.axvline(
        1e3 * found.time, color=VERMILION, linestyle=(0, (6, 2)), linewidth=1.6, zorder=4,
        label=f'named: {1e3 * found.time:.0f} ms',
    )
    axes.set_yscale('log')
    axes.set_xlim(0.0, 1e3 * end)
    axes.grid(True, which='major', linewidth=0.4, color='0.75', zorder=1)
    axes.set_ylabel('first moments\nerror, µrad')
    axes.set_xlabel(
        f'time, ms, since {found.name} failed in phase {index + 1}, and nobody reported it'
    )
