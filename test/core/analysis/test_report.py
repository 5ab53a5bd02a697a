# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The report of a run: files of the stated size, nothing covered, nothing from outside."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest
from core.runs import demonstration, recording

from fault_tolerance.analysis.demo_summary import PHASES
from fault_tolerance.analysis.figures import report_figure
from fault_tolerance.analysis.line_styles import STYLES
from fault_tolerance.analysis.phases import Phase
from fault_tolerance.analysis.report_page import figure_as_svg, report_page, write_report
from fault_tolerance.analysis.runs import run_of
from fault_tolerance.analysis.series import Series

SIZE = (2175, 2051)
PANELS = ['pointing error\nµrad', 'largest strut force\nbeyond preload, N',
          'commanded rate\nwith recovery, mm/s', 'measures\n(0: intolerable)']


@pytest.fixture(scope='module')
def run():
    return demonstration()


@pytest.fixture(scope='module')
def figure(run):
    figure = report_figure(run)
    figure.draw_without_rendering()
    return figure


@pytest.fixture(scope='module')
def folder(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp('report') / 'new'
    assert [path.name for path in write_report(run, folder)] == [
        'report.png', 'report.svg', 'report.html']
    return folder


def charts(figure):
    return [axes for axes in figure.axes if axes.get_ylabel() in PANELS]


def texts_of(figure):
    """Return everything written, with the boxes it fills."""
    renderer = figure.canvas.get_renderer()
    written = [*figure.texts, *(text for one in figure.legends for text in one.get_texts())]
    for axes in figure.axes:
        legend = axes.get_legend()
        written += [axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
        written += legend.get_texts() if legend else []
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            written += [tick.label1 for tick in axis.get_major_ticks()
                        if low <= tick.get_loc() <= high]
    return [
        (text.get_text(), text.get_window_extent(renderer))
        for text in written if text.get_text().strip() and text.get_visible()
    ]


def test_the_picture_has_the_stated_size(folder):
    content = (folder / 'report.png').read_bytes()
    assert content.startswith(b'\x89PNG')
    assert tuple(int.from_bytes(content[at : at + 4], 'big') for at in (16, 20)) == SIZE


def test_the_drawing_is_well_formed_and_always_the_same(folder):
    drawing = (folder / 'report.svg').read_text(encoding='utf-8')
    assert ElementTree.fromstring(drawing).tag == '{http://www.w3.org/2000/svg}svg'
    small = demonstration(phases=PHASES[:1], states=('nominal',))
    once, twice = (figure_as_svg(report_figure(small)) for _ in range(2))
    assert once == twice


def test_nothing_written_covers_anything_else(figure):
    found = texts_of(figure)
    assert len(found) > 60
    for (one, box), (other, second) in combinations(found, 2):
        assert not box.overlaps(second), (one, other)
    for text, box in found:
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1, text


def test_every_phase_is_named_over_its_path(figure):
    titles = [' '.join(axes.get_title().split()) for axes in figure.axes[:8]]
    assert titles == [
        '1 healthy', '2 theta_4 stuck, unreported', '3 theta_4 stuck', '4 theta_2 free',
        '5 strut_3 lost', '6 theta_1 stuck, theta_3 free', '7 two free drives and a brake',
        '8 theta_1, theta_2 stuck: stopped']


def test_every_failure_is_shaded_and_numbered(figure):
    assert [axes.get_ylabel() for axes in charts(figure)] == PANELS
    for axes in charts(figure):
        shades = sorted(patch.get_x() for patch in axes.patches)
        assert shades == pytest.approx([4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 28.0])
    numbers = [(text.get_text(), text.xy[0]) for text in charts(figure)[0].texts]
    assert numbers == [(str(n + 1), pytest.approx(4.0 * n)) for n in range(8)]


def test_what_is_drawn_is_what_was_recorded(run, figure):
    lines = {}
    for line in charts(figure)[0].lines:
        lines.setdefault(line.get_color(), []).append(line.get_ydata())
    for name, error in (('recovered', 1.0), ('unrecovered', 300.0)):
        assert len(lines[STYLES[name]['color']]) == len(PHASES)
        assert np.concatenate(lines[STYLES[name]['color']]) == pytest.approx(error)
    forces = [line.get_ydata().max() for line in charts(figure)[1].lines
              if line.get_color() == STYLES['recovered']['color']]
    assert forces == pytest.approx([0.5] * 8)
    path = figure.axes[0].lines[1].get_xydata()
    assert path == pytest.approx(1e3 * run.main[0].path.values[50:])


def luminance(colour):
    red, green, blue = (int(colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5))
    return 0.299 * red + 0.587 * green + 0.114 * blue


def test_the_two_passes_differ_in_grey_print():
    one, other = STYLES['recovered'], STYLES['unrecovered']
    assert luminance(other['color']) - luminance(one['color']) > 0.25
    assert other['linewidth'] > 2.0 * one['linewidth']


def test_a_limit_is_drawn_where_it_is_near_and_told_where_it_is_far(run):
    def words(one):
        axes = charts(report_figure(one))[2]
        return [text.get_text().replace('\n', ' ') for text in axes.get_legend().get_texts()]

    assert words(run)[-1] == 'limit ±50 mm/s, far outside'
    fast = [replace(one, rates=Series(one.rates.time, 300.0 * one.rates.values))
            for one in run.main]
    near = replace(run, passes={'recovered': fast, 'unrecovered': fast})
    assert words(near)[-1] == 'limit ±50 mm/s (thick)'
    levels = [line.get_ydata()[0] for line in charts(report_figure(near))[2].lines
              if line.get_linewidth() == 1.6]
    assert levels == [-50.0, 50.0]


def test_what_was_not_recorded_is_left_out(run):
    nothing = Series(np.zeros(0), np.zeros((0, 2)))
    bare = [replace(one, error=nothing, reference=nothing, efforts=nothing) for one in run.main]
    figure = report_figure(replace(run, passes={'run': bare}))
    assert [axes.get_ylabel() for axes in figure.axes] == [
        'commanded rate\nmm/s', 'measures\n(0: intolerable)']


def test_the_first_moments_of_what_nobody_reported_are_drawn(run, figure):
    *_, last = figure.axes
    assert last.get_ylabel() == 'first moments\nerror, µrad'
    assert 'since theta_4 failed in phase 2' in last.get_xlabel()
    words = [text.get_text() for text in last.get_legend().get_texts()]
    assert 'named: 20 ms' in words and any('first µm told' in one for one in words)
    by_colour = {line.get_color(): line for line in last.lines}
    for name, error in (('recovered', 1.0), ('unrecovered', 300.0)):
        line = by_colour[STYLES[name]['color']]
        assert line.get_ydata() == pytest.approx(error)
        assert line.get_xdata().max() < 200.0
    unnoticed = [replace(one, found=None) for one in run.main]
    figure = report_figure(replace(run, passes={**run.passes, 'recovered': unnoticed}))
    assert 'first moments' not in figure.axes[-1].get_ylabel()


def test_many_phases_and_long_names_stay_apart():
    names = [f'{"very_" * 6}long_name_of_strut_{n} lost' for n in range(9)]
    phases = [Phase(name, (('hard', 'strut_1'),)) for name in names]
    figure = report_figure(run_of({'': recording(phases=phases, states=['degraded'] * 9)}))
    figure.draw_without_rendering()
    for (one, box), (other, second) in combinations(texts_of(figure), 2):
        assert not box.overlaps(second), (one, other)


class Links(HTMLParser):
    """Collects everything a page could fetch."""

    def __init__(self, page):
        super().__init__()
        self.found, self.tags = [], set()
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        for name, value in attributes:
            if name.rpartition(':')[2] in ('href', 'src', 'srcset', 'action', 'data', 'poster'):
                self.found.append(value)


def test_the_page_needs_nothing_from_outside(folder):
    page = (folder / 'report.html').read_text(encoding='utf-8')
    links = Links(page)
    assert links.found and all(link.startswith('#') for link in links.found)
    assert not links.tags & {'script', 'link', 'img', 'iframe', 'object', 'embed', 'base'}
    assert '@import' not in page
    assert all(one.startswith('#') for one in re.findall(r'url\(([^)]*)\)', page))
    # Names of vocabularies are no links, and there are no others.
    without_names = re.sub(r'xmlns(:\w+)?="[^"]*"', '', page)
    assert '//' not in without_names.replace('/* ', '')
    assert len(page) > 100_000


def test_the_page_has_figure_and_table(folder):
    page = (folder / 'report.html').read_text(encoding='utf-8')
    assert page.count('<svg') == 1 and page.count('<table>') == 1
    rows = re.findall(r'<tr>(.*?)</tr>', page)
    cells = [re.findall(r'<t[dh]>(.*?)</t[dh]>', row) for row in rows]
    assert len(cells) == 1 + len(PHASES)
    assert cells[2] == ['2', 'theta_4 stuck, unreported', 'degraded', '20 ms', '0.500', '0.500',
                        '–', '1.0', '300.0', '0.50', '0.50']
    assert cells[3][1:4] == ['theta_4 stuck', 'degraded', '–']
    assert '7 states of failure: 6 carried on with, 1 stopped. All as the theory says.' in page
    assert 'Phase 2: theta_4 was named 20 ms after it failed' in page


def test_the_page_says_what_went_wrong_and_escapes_names(run):
    records = [replace(one, state='stopped', phase=replace(one.phase, name='<b>&'))
               for one in run.main]
    wrong = replace(run, passes={**run.passes, 'recovered': records})
    page = report_page(wrong, '<?xml?><svg></svg>')
    assert 'Not as the theory says: &lt;b&gt;&amp;: state stopped, expected nominal' in page
    assert '<b>' not in page
