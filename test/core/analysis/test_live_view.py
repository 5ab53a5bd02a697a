# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The live view: everything is said in every state and width, and in plain text too."""

import io
from dataclasses import replace

import pytest
from rich.cells import cell_len
from rich.console import Console

from fault_tolerance.analysis.live_view import LiveView, plain_line, sparkline
from fault_tolerance.analysis.snapshot import (
    NOT_TOLERATED,
    Actuator,
    Snapshot,
    Strut,
    Suspect,
    with_prefix,
)
from fault_tolerance.analysis.suspicion_text import alike_text, suspect_text, unseen_text
from fault_tolerance.control.settings import Settings

HEALTHY = Snapshot(
    title='mirror_4_strut',
    state='nominal',
    reason='no failure',
    worst_next='torque:theta_2',
    worst_measure=0.5,
    values={'manipulability retained': 1.0, 'condition number': 1.25},
    actuators=tuple(
        Actuator(f'theta_{n}', position=0.577, torque=0.5, rate=1e-4 * (n - 2), limit=0.05,
                 unit='m/s')
        for n in (1, 2, 3, 4)
    ),
    struts=tuple(Strut(f'strut_{n}', hard=0.5) for n in (1, 2, 3, 4)),
    errors=(2e-7,) * 300,
    fastest=2e-4,
)
DEGRADED = replace(
    HEALTHY,
    state='degraded',
    reason='theta_4 stuck; wx, wy retained, vz coupled',
    failures=('position:theta_4',),
    worst_next='position:theta_1',
    worst_measure=0.0,
    actuators=(
        Actuator('theta_1', position=0.0, torque=0.577, rate=0.05, limit=0.05, unit='m/s'),
        Actuator('theta_4', failure='position', rate=0.0, limit=0.05, unit='m/s'),
    ),
    struts=(Strut('strut_1', hard=0.1), Strut('strut_4', failure='hard')),
)
STOPPED = replace(
    HEALTHY, state='stopped', reason='theta_1, theta_2 stuck; wx cannot be given independently',
    failures=('position:theta_1', 'position:theta_2'), worst_next='', errors=(1e-3, 2e-3),
)
SUSPICIOUS = replace(
    DEGRADED,
    suspects=(Suspect(('position:theta_4', 'encoder:theta_4'), 31.24, 'pose'),),
    alike=(('healthy', *(f'torque:{name}' for name in ('theta_1', 'theta_4')),
            'hard:strut_1', 'hard:strut_4'),
           *((f'position:{name}', f'torque:{name}') for name in ('theta_1', 'theta_4'))),
)
SILENT = Snapshot('fault_tolerance')
STATES = {'healthy': HEALTHY, 'degraded': DEGRADED, 'stopped': STOPPED, 'silent': SILENT,
          'suspicious': SUSPICIOUS}


def shown(snapshot, width, encoding='utf-8', **options):
    """Return what a terminal of this width and encoding shows."""
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding=encoding)
    console = Console(file=file, width=width, force_terminal=True, color_system=None, **options)
    console.print(LiveView(snapshot))
    file.flush()
    return raw.getvalue().decode(encoding)


def test_what_counts_as_intolerable_is_the_default_of_the_controller():
    assert Settings().tolerance_threshold == NOT_TOLERATED
    parts = (Actuator('leg_1', position=0.004, torque=0.0),)
    text = shown(replace(HEALTHY, actuators=parts, worst_measure=0.004), 120)
    assert ' STOP' in text and '0 STOP' in text and '0.004: would stop it' in text


@pytest.mark.parametrize('width', [30, 45, 60, 80, 100, 120, 200])
@pytest.mark.parametrize('snapshot', STATES.values(), ids=STATES)
def test_it_fits_every_terminal(snapshot, width):
    lines = shown(snapshot, width).splitlines()
    assert {cell_len(line) for line in lines} == {width}
    assert len(lines) <= 24


@pytest.mark.parametrize('width', [80, 120])
def test_everything_is_said_of_a_healthy_mechanism(width):
    text = shown(HEALTHY, width)
    for words in ('mirror_4_strut', 'NOMINAL', 'no failure', 'theta_3', 'strut_2', '0 failures',
                  '0.577', '0.500', '200 um/s', '0.2 urad rms', 'manipulability retained 1',
                  'worst next failure: theta_2 free, t = 0.500: would be tolerated'):
        assert words in text, words
    assert text.count('healthy') == 8


def test_what_has_failed_and_what_would_stop_it_is_said_in_words():
    text = shown(DEGRADED, 120)
    for words in ('DEGRADED', 'theta_4 stuck; wx, wy retained, vz coupled', '1 failure present',
                  '0 STOP', 'failed', 'lost', 'limit', 'theta_1 stuck, p = 0.000: would stop it'):
        assert words in text, words
    assert 'would be tolerated' not in text


def test_a_stopped_mechanism_says_why():
    text = shown(STOPPED, 120)
    assert 'STOPPED' in text and 'wx cannot be given independently' in text
    assert 'worst next' not in text and 'can be judged' not in text


def test_before_anything_is_heard_it_waits():
    text = shown(SILENT, 80)
    assert 'waiting for the controller' in text
    assert 'actuator' not in text
    early = replace(SILENT, state='waiting', reason='no joint state yet')
    assert 'no measures yet' in shown(early, 80)


def test_a_controller_that_has_gone_silent_is_noticed():
    assert 'not heard for' not in shown(replace(DEGRADED, age=0.5), 120)
    assert 'not heard for 12 s' in shown(replace(DEGRADED, age=12.2), 120)
    assert 'not heard for 12 s' in plain_line(replace(DEGRADED, age=12.2))


def test_bars_grow_with_the_measure():
    def bar(measure):
        few = (Actuator('theta_1', position=measure, torque=0.0),)
        line = next(line for line in shown(replace(HEALTHY, actuators=few, struts=()), 120)
                    .splitlines() if 'theta_1' in line)
        return line.count('━')

    console = [bar(value) for value in (0.0, 0.25, 0.5, 1.0, 1.7)]
    assert console == sorted(console) and console[3] == console[4] > console[1] > console[0]


def test_rates_point_to_their_side():
    def row(rate):
        few = (Actuator('theta_1', position=0.5, torque=0.5, rate=rate, unit='m/s'),)
        view = replace(HEALTHY, actuators=few, struts=(), fastest=1e-4)
        line = next(line for line in shown(view, 100).splitlines() if 'theta_1' in line)
        left, right = line[line.index('m/s'):].split('┃')
        return left.count('━'), right.count('━')

    assert row(1e-4) == (0, 6)
    assert row(-5e-5) == (3, 0)
    assert row(0.0) == (0, 0)


def test_a_terminal_without_unicode_gets_letters_it_knows():
    for width in (20, 40, 80, 120):
        text = shown(replace(DEGRADED, title=30 * 'long'), width, encoding='ascii')
        assert text.isascii()
        assert 'DEGRADED' in text
    assert '####' in shown(DEGRADED, 120, encoding='ascii')


@pytest.mark.parametrize('encoding', ['utf-8', 'ascii'])
def test_what_is_suspected_and_what_is_not_seen_is_said(encoding):
    text = shown(SUSPICIOUS, 80, encoding)
    for words in ('suspected: log odds 31: theta_4 stuck or encoder frozen (to tell: pose)',
                  'would not be noticed: any drive free, any strut lost',
                  'would look the same: each drive: stuck = free'):
        assert words in text, words
    assert 'suspected: log odds 31: theta_4 stuck or encoder frozen' in plain_line(SUSPICIOUS)
    for words in ('suspected', 'noticed', 'look the same'):
        assert words not in shown(HEALTHY, 80, encoding)


@pytest.mark.parametrize(('candidates', 'words'), [
    (('position:a',), 'a stuck'),
    (('hard:s_1', 'hard:s_2'), 's_1 or s_2 lost'),
    (('torque:a', 'hard:s'), 'a free or s lost'),
    (('order:a+b',), 'a+b swapped'),
    (('runaway:a',), 'a runaway'),
])
def test_a_group_is_named_in_few_words(candidates, words):
    assert suspect_text(Suspect(candidates)) == words


def test_groups_of_several_parts_are_named_too():
    few = replace(HEALTHY, alike=(('healthy', 'torque:theta_1', 'torque:theta_2'),
                                  ('hard:strut_1', 'hard:strut_2'),
                                  ('position:theta_3', 'encoder:theta_3')))
    assert unseen_text(few) == 'theta_1 theta_2 free'
    assert alike_text(few) == 'theta_3: stuck = encoder frozen; strut_1 = strut_2 lost'


def test_the_plain_line_says_the_same_in_one():
    assert plain_line(DEGRADED) == (
        'mirror_4_strut: degraded: theta_4 stuck; wx, wy retained, vz coupled '
        '| error 0.2 urad rms | worst next failure: theta_1 stuck, p = 0.000: would stop it '
        '| rates 0.05 0'
    )
    assert plain_line(SILENT) == 'fault_tolerance: waiting for the controller'
    assert plain_line(replace(STOPPED, errors=(), actuators=())) == (
        'mirror_4_strut: stopped: theta_1, theta_2 stuck; wx cannot be given independently'
    )


def test_the_sparkline_shows_the_largest_of_each_time_on_a_logarithmic_scale():
    assert sparkline([1e-7, 1e-2], 2) == '▁█'
    assert sparkline([1e-7] * 99 + [1e-2], 2) == '▁█'
    assert sparkline([0.0, 1e-9, 1.0], 10) == '▁▁█'
    assert sparkline([1e-7, 1e-2], 2, plain=True) == '.@'
    assert sparkline([], 10) == ''
    heights = [sparkline([10.0**power], 1) for power in range(-7, -1)]
    assert heights == sorted(heights)


@pytest.mark.parametrize(('value', 'unit', 'text'), [
    (1.5, 'm/s', '1.5 m/s'), (-2e-3, 'rad/s', '-2 mrad/s'), (3.14159e-5, 'm/s', '31.4 um/s'),
    (0.0, 'm/s', '0 m/s'), (1e-12, 'm/s', '0 m/s'), (1e-4, '', '0.0001'),
])
def test_quantities_are_written_with_a_prefix(value, unit, text):
    assert with_prefix(value, unit) == text
