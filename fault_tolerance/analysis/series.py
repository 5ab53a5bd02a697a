# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Values over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Series:
    """Samples ``values`` (k, c) with their ascending ``time`` (k,), seconds."""

    time: FloatArray
    values: FloatArray

    def __len__(self) -> int:
        """Return how many samples there are."""
        return len(self.time)

    def since(self, begin: float, end: float = inf) -> Series:
        """Return the part from ``begin`` to before ``end`` (s); times count from ``begin``."""
        chosen = (self.time >= begin) & (self.time < end)
        return Series(self.time[chosen] - begin, self.values[chosen])

    def minus(self, other: Series) -> Series:
        """Return the difference from ``other``, at the times that both have."""
        time, ours, theirs = np.intersect1d(self.time, other.time, return_indices=True)
        return Series(time, self.values[ours] - other.values[theirs])


def series_of(samples: Sequence[tuple[float, Sequence[float]]], columns: int = 0) -> Series:
    """Return the series of ``samples`` (time, values), sorted by time.

    Without samples it is ``columns`` wide. Empty values, and those of another length than the
    last ones, are left out: they are no measurement of the same things.
    """
    samples = [one for one in samples if len(one[1])]
    width = len(samples[-1][1]) if samples else columns
    alike = sorted((one for one in samples if len(one[1]) == width), key=lambda one: one[0])
    return Series(
        np.array([time for time, _ in alike], dtype=np.float64),
        np.array([values for _, values in alike], dtype=np.float64).reshape(-1, width),
    )


class Span(NamedTuple):
    """A text that held from ``begin`` to ``end``, seconds."""

    begin: float
    end: float
    text: str


@dataclass(frozen=True, eq=False)
class Evidence:
    """The evidence for failures that nobody has reported, over ``time`` (k,), seconds.

    ``odds`` by the name of the hypothesis (k,), NaN where it was none; ``threshold`` (k,) is what
    convicts. ``findings`` are moments and sentences.
    """

    title: str
    time: FloatArray
    odds: dict[str, FloatArray]
    threshold: FloatArray
    findings: tuple[tuple[float, str], ...]
    failures: tuple[Span, ...]
    states: tuple[Span, ...]
