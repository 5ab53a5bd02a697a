# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Colours and lines of a report."""

from __future__ import annotations

from typing import Any

from fault_tolerance.analysis.runs import ONLY, RECOVERED, UNRECOVERED

# Okabe and Ito's colours, safe for colour-blind readers. In grey print widths differ: without
# recovery wide and pale, so that it shows where the thin dark line with recovery lies on it.
BLUE, VERMILION, ORANGE, GREEN, PURPLE = '#0072B2', '#D55E00', '#E69F00', '#009E73', '#CC79A7'
STYLES: dict[str, dict[str, Any]] = {
    RECOVERED: {'color': BLUE, 'linewidth': 1.3},
    UNRECOVERED: {'color': '#F2A477', 'linewidth': 3.4},
    ONLY: {'color': BLUE, 'linewidth': 1.3},
}
LABELS = {RECOVERED: 'with recovery', UNRECOVERED: 'without recovery', ONLY: 'as recorded'}
REFERENCE: dict[str, Any] = {'color': 'black', 'linewidth': 0.9, 'linestyle': (0, (1.0, 1.6))}
STROKES: tuple[Any, ...] = ('solid', (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)))
ACTUATOR_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, 'black')
MEASURE_STYLES: tuple[tuple[str, dict[str, Any]], ...] = (
    ('p, worst stuck next', {'color': BLUE, 'linewidth': 1.6}),
    ('t, worst free next', {'color': ORANGE, 'linewidth': 4.0, 'solid_capstyle': 'butt'}),
    ('h, worst lost next', {'color': 'black', 'linewidth': 1.4, 'linestyle': (0, (1, 1.2))}),
    ('manipulability kept', {'color': GREEN, 'linewidth': 1.2, 'linestyle': (0, (6, 2))}),
)
