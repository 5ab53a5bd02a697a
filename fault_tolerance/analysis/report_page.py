# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The report of a run as files: the figure as PNG and SVG, and a self-contained HTML page."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from io import StringIO
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from fault_tolerance.analysis.delays import delay_sentences, milliseconds
from fault_tolerance.analysis.demo_summary import summary, unrecovered_phases
from fault_tolerance.analysis.figures import report_figure
from fault_tolerance.analysis.line_styles import LABELS
from fault_tolerance.analysis.phases import TOLERANCES
from fault_tolerance.analysis.runs import RECOVERED, Run
from fault_tolerance.analysis.terminal import number

RESOLUTION = 150
"""Dots per inch of the PNG."""

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #111; background: #fff;
       max-width: 76rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: 0; }
p.verdict { font-size: 1.15rem; margin-top: .3rem; }
figure { margin: 1.5rem 0; }
figure svg { width: 100%; height: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: .4rem; color: #444; }
th, td { padding: .25rem .9rem .25rem 0; text-align: right; border-bottom: 1px solid #ccc; }
th:nth-child(-n+3), td:nth-child(-n+3) { text-align: left; }
dt { font-weight: 600; } dd { margin: 0 0 .4rem 0; }
@media print { body { max-width: none; margin: 0; font-size: 11px; }
               figure { page-break-inside: avoid; } }
"""


def write_report(run: Run, folder: Path) -> list[Path]:
    """Write report.png, .svg and .html of ``run`` to ``folder`` and return their paths."""
    figure = report_figure(run)
    drawing = figure_as_svg(figure)
    folder.mkdir(parents=True, exist_ok=True)
    png, svg, html = (folder / f'report.{ending}' for ending in ('png', 'svg', 'html'))
    figure.savefig(png, dpi=RESOLUTION)
    svg.write_text(drawing, encoding='utf-8')
    html.write_text(report_page(run, drawing), encoding='utf-8')
    return [png, svg, html]


def figure_as_svg(figure: Figure) -> str:
    """Return ``figure`` as SVG, the same for the same figure."""
    text = StringIO()
    # Letters as shapes: they look the same where the font is missing.
    with matplotlib.rc_context({'svg.fonttype': 'path', 'svg.hashsalt': 'fault_tolerance'}):
        figure.savefig(text, format='svg', metadata={'Date': None})
    return text.getvalue()


def report_page(run: Run, drawing: str) -> str:
    """Return the page (HTML) of ``run`` with ``drawing`` (SVG); it refers to nothing outside."""
    result = summary(run)
    title = f'{run.mechanism_name or "a run"}: failures and recovery'
    parts = _noticed(result), inline_figure(drawing), _table(result), _explanations(result)
    return html_page(title, verdict(result), *parts)


def html_page(title: str, sentence: str, *parts: str) -> str:
    """Return a page (HTML) with a ``title``, what is to be known in a ``sentence``, and ``parts``.

    The ``parts`` are HTML; title and sentence are text.
    """
    title = escape(title)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{title}</title>\n<style>{_STYLE}</style>\n</head>\n'
        f'<body>\n<h1>{title}</h1>\n'
        f'<p class="verdict">{escape(sentence)}</p>\n' + '\n'.join(filter(None, parts))
        + '\n</body>\n</html>\n'
    )


def inline_figure(drawing: str) -> str:
    """Return the ``drawing`` (SVG) as part of a page."""
    # Declarations and metadata have no place inside a page.
    inline = re.sub(r'<metadata>.*?</metadata>', '', drawing[drawing.index('<svg'):], flags=re.S)
    return f'<figure>{inline}</figure>'


def html_table(caption: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table (HTML) with a ``caption`` over ``heads`` and ``rows``, all of them text."""
    head = ''.join(f'<th>{escape(one)}</th>' for one in heads)
    body = '\n'.join(
        '<tr>' + ''.join(f'<td>{escape(cell)}</td>' for cell in row) + '</tr>' for row in rows
    )
    return f'<table>\n<caption>{escape(caption)}</caption>\n<tr>{head}</tr>\n{body}\n</table>'


def verdict(result: Mapping[str, Any]) -> str:
    """Return in a sentence what the run of ``result`` (from `summary`) showed."""
    broken = [phase for phase in result['phases'] if phase['failures']]
    borne = [phase for phase in broken if phase['state'] == 'degraded']
    stopped = [phase for phase in broken if phase['state'] == 'stopped']
    words = f'{len(broken)} {"state" if len(broken) == 1 else "states"} of failure: '
    words += f'{len(borne)} carried on with, {len(stopped)} stopped.'
    if all(RECOVERED in phase['error_rms_urad'] for phase in result['phases']):
        wrong = unrecovered_phases(dict(result))
        words += ' ' + (
            'Not as the theory says: ' + '; '.join(wrong) if wrong else 'All as the theory says.'
        )
    return words


def _noticed(result: Mapping[str, Any]) -> str:
    """Return a paragraph on what was noticed without a report; empty if nothing was."""
    sentences = delay_sentences(result)
    if not sentences:
        return ''
    words = 'Where a failure is unreported the controller has only the encoders to go by: it '
    words += 'compares how far the drives were told to go with how far they went. '
    return f'<p>{escape(words + " ".join(sentences))}</p>'


def _table(result: Mapping[str, Any]) -> str:
    passes = list(result['phases'][0]['error_rms_urad'])
    heads = ['', 'what has failed', 'state', 'noticed after', 'p', 't', 'h']
    for what in ('error rms, µrad', 'largest force, N'):
        heads += [f'{what}{f", {LABELS[one]}" if len(passes) > 1 else ""}' for one in passes]
    rows = [
        [
            str(index), phase['name'], phase['state'], milliseconds(phase['detected'], '–'),
            *(number(phase['measures'].get(name), '.3f', '–') for name in TOLERANCES),
            *(number(phase['error_rms_urad'][one], '.1f', '–') for one in passes),
            *(number(phase['peak_force'][one], '.2f', '–') for one in passes),
        ]
        for index, phase in enumerate(result['phases'], 1)
    ]
    caption = 'p, t, h: measure of the worst position, torque or hard failure that could come '
    return html_table(f'{caption}next.', heads, rows)


def _explanations(result: Mapping[str, Any]) -> str:
    period = result['period']
    counted = (
        'over everything recorded of a phase' if period is None
        else f'the median over whole turns of {period:g} s, once it has settled'
    )
    entries = (
        ('pointing error', f'Angle between where the mirror points and the reference; {counted}.'),
        ('noticed after', 'From the failure until the controller named it, without a report.'),
        ('largest force', 'Of all actuators, beyond the mean just before the phase.'),
        ('degraded', 'Goes on with kinematics derived anew without what has failed.'),
        ('brake', 'Of two limp drives one is held by its brake: stuck is borne, limp is not.'),
        ('stopped', 'What is left cannot do the task: all rates are zero.'),
    )
    items = ''.join(f'<dt>{word}</dt><dd>{escape(text)}</dd>' for word, text in entries)
    return f'<dl>{items}</dl>'
