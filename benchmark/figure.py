# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Cost against the number of struts, drawn from the results."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

_MARKERS = 'osD^vP*Xhp<>'


def draw(rows: Sequence[dict[str, Any]], folder: Path) -> list[Path]:
    """Write ``cost.png`` and ``cost.svg``; none without matplotlib or without such rows."""
    try:
        import matplotlib
    except ImportError:
        return []
    matplotlib.use('Agg')
    from matplotlib import pyplot

    curves: dict[str, dict[int, float]] = defaultdict(dict)
    for row in rows:
        if row['struts'] > 0:
            curves[row['name']][row['struts']] = row['p50_us']
    curves = {name: points for name, points in curves.items() if len(points) > 1}
    if not curves:
        return []
    figure, axes = pyplot.subplots(figsize=(8.0, 5.0), layout='constrained')
    for place, (name, points) in enumerate(sorted(curves.items())):
        struts = sorted(points)
        marker = _MARKERS[place % len(_MARKERS)]
        axes.loglog(struts, [points[n] for n in struts], marker=marker, label=name)
    numbers = sorted({n for points in curves.values() for n in points})
    few = [n for n in numbers if n <= 8 or n >= 2 * 8]
    axes.set_xticks(few, [str(n) for n in few])
    axes.minorticks_off()
    axes.set_xlabel('struts')
    axes.set_ylabel('time, µs (median)')
    axes.grid(alpha=0.3)
    axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize='small')
    files = [folder / 'cost.png', folder / 'cost.svg']
    for file in files:
        figure.savefig(file, dpi=150)
    pyplot.close(figure)
    return files
