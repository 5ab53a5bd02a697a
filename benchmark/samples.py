# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From samples to the rows of the results."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

import numpy as np


def row(
    name: str,
    repeats: Sequence[Sequence[float]],
    *,
    mechanism: str = '',
    struts: int = 0,
    note: str = '',
    **further: Any,
) -> dict[str, Any]:
    """Return one row of the results.

    Parameters
    ----------
    name : str
    repeats : sequence of sequence of float
        Microseconds: the samples of every repeat.
    mechanism : str
    struts : int
    note : str
    further : values as JSON has them
    """
    middle = [float(np.percentile(samples, 50)) for samples in repeats]
    late = [float(np.percentile(samples, 99)) for samples in repeats]
    return {
        'name': name,
        'mechanism': mechanism,
        'struts': struts,
        'p50_us': round(median(middle), 3),
        'p95_us': round(median(float(np.percentile(samples, 95)) for samples in repeats), 3),
        'p99_us': round(median(late), 3),
        'p50_us_of_repeats': [round(value, 3) for value in middle],
        'repeats': len(repeats),
        'note': note,
        **further,
    }


def ratio(rows: Sequence[dict[str, Any]], name: str, over: str) -> float | None:
    """Return the median ratio of two rows' p50, repeat by repeat; None if one is not there.

    What the machine does beside befalls both halves of a repeat, so it drops out.
    """
    found = {one['name']: one['p50_us_of_repeats'] for one in rows if one['name'] in (name, over)}
    if len(found) < 2:
        return None
    return median(a / b for a, b in zip(found[name], found[over], strict=True))


def main(run: Callable[..., list[dict[str, Any]]]) -> None:
    """Run one benchmark alone: ``python -m benchmark.NAME [--quick] [--repeats N]``."""
    parser = argparse.ArgumentParser()
    parser.add_argument('--quick', action='store_true', help='a short run, which says little')
    parser.add_argument('--repeats', type=int, default=5)
    given = parser.parse_args()
    for one in run(given.repeats, quick=given.quick):
        print(json.dumps(one))
