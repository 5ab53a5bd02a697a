# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The page of a map: picture, numbers, and what the words mean; it refers to nothing outside."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from fault_tolerance.analysis.report_page import html_page, html_table, inline_figure
from fault_tolerance.design.map_files import map_facts
from fault_tolerance.design.maps import ToleranceMap

_WORDS = (
    ('p, t, h', 'Measures of the worst position failure (a drive stuck), torque failure (a drive '
     'free) and hard failure (a strut lost) that could come next: 0 fatal, 1 nothing lost.'),
    ('out of reach', 'The loops do not close, or a drive is beyond its stroke.'),
    ('none is fatal', 'Whichever single failure comes, the platform is held and the major task '
     'can still be given.'),
    ('proven all over', 'Not at samples only: a bound on how far the rows of the drives can '
     'change within a cell keeps every measure above 0 all over it, and all strokes.'),
    ('condition number', 'Of the major rows of J; it depends on the units of the task.'),
)


def map_page(found: ToleranceMap, report: Mapping[str, Any], drawing: str) -> str:
    """Return the page (HTML) of the map ``found`` with its ``report`` and ``drawing`` (SVG)."""
    volume = report['volume']
    share = 100.0 * volume['fault_tolerant'] / volume['map']
    sentence = f'No single failure is fatal in {share:.1f} % of the map.'
    if report['worst'] is not None:
        sentence += f' Worst: {report["worst"]["failure"]}, {report["worst"]["measure"]:.3g}.'
    words = ''.join(
        f'<dt>{word}</dt><dd>{escape(text)}</dd>' for word, text in _WORDS
        if found.proof is not None or not word.startswith('proven')
    )
    made = f'{report["file"]}, SHA-256 {report["sha256"]}, fault_tolerance {report["version"]}'
    return html_page(
        f'{found.mechanism.name}: map of fault tolerance', sentence, inline_figure(drawing),
        html_table(made, ('', ''), map_facts(report)),
        f'<dl>{words}</dl>',
    )
