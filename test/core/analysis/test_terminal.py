# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Whatever the terminal can show, no output of the package dies of a letter of its own."""

import io
import sys
from dataclasses import replace

import pytest
from core.runs import demonstration
from rich.cells import cell_len
from rich.table import Table
from test_live_view import DEGRADED, STATES, shown

from fault_tolerance.analysis.campaign import TrialRecord, campaign_summary, campaign_table
from fault_tolerance.analysis.demo_summary import summary, summary_table
from fault_tolerance.analysis.terminal import console_for_text, in_ascii
from fault_tolerance.cli import main

WIDTHS = (20, 30, 40, 60, 80, 120, 200)
COMMANDS = (
    ('measures', 'mirror_overactuated', '--failed', 'stuck:theta_4', '--pairs'),
    ('measures', 'gough_stewart_8'),
    ('table', 'fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated'),
    ('check', 'mirror_4_strut', '--failed', 'hard:strut_2'),
)
TRIAL = TrialRecord(
    mechanism='mirror_overactuated', failures='position:theta_3;hard:strut_4', tolerable=True,
    states=('degraded', 'hold'), final_state='hold', largest_rate=0.1, error_rms=3e-6,
    healthy_error_rms=1e-6, peak_force=12.25, recovery_time_us=900.0, seed=3,
)


def printed(content, width, encoding='ascii'):
    """Return what a terminal of this width and encoding shows."""
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding=encoding)
    console_for_text(file=file, width=width, force_terminal=True, color_system=None).print(content)
    file.flush()
    return raw.getvalue().decode(encoding)


@pytest.mark.parametrize('arguments', COMMANDS, ids=lambda arguments: arguments[0])
def test_every_command_prints_in_ascii_whatever_the_width(arguments, monkeypatch):
    for width in WIDTHS:
        raw = io.BytesIO()
        monkeypatch.setenv('COLUMNS', str(width))
        monkeypatch.setattr(sys, 'stdout', io.TextIOWrapper(raw, encoding='ascii'))
        assert main(list(arguments)) == 0, width
        assert (arguments[1] in raw.getvalue().decode('ascii')) or width < 60


def test_every_table_prints_in_ascii_whatever_the_width():
    tables = summary_table(summary(demonstration())), campaign_table(campaign_summary([TRIAL], 1))
    for table in tables:
        for width in WIDTHS:
            assert printed(table, width).isascii()


def test_the_live_view_shows_every_state_in_ascii_whatever_the_names():
    actuators = tuple(replace(one, name=f'gr\u00f6\u00dfe_{one.name}')
                      for one in DEGRADED.actuators)
    states = {**STATES, 'named': replace(DEGRADED, title='\u93e1 mirror', actuators=actuators)}
    for name, snapshot in states.items():
        for width in WIDTHS:
            lines = shown(snapshot, width, encoding='ascii').splitlines()
            assert {len(line) for line in lines} == {width}, (name, width)
    assert 'gr??e_theta_1' in shown(states['named'], 120, encoding='ascii')


def test_what_is_cut_short_ends_with_a_dot_only_where_it_must():
    long = Table.grid()
    long.add_column(no_wrap=True, overflow='ellipsis')
    long.add_row(50 * 'a')
    assert printed(long, 10) == 'aaaaaaaaa.\n'
    assert printed(long, 10, 'utf-8') == 'aaaaaaaaa\u2026\n'


def test_letters_of_others_stay_and_are_refused_where_they_cannot_be_shown():
    assert printed('gr\u00f6\u00dfe', 20, 'latin-1') == 'gr\u00f6\u00dfe\n'
    with pytest.raises(UnicodeEncodeError):
        printed('gr\u00f6\u00dfe', 20)


@pytest.mark.parametrize('text', ['', 'plain', 'gr\u00f6\u00dfe', '\u93e1', 'a\u2026'])
def test_ascii_is_as_wide(text):
    assert in_ascii(text).isascii()
    assert cell_len(in_ascii(text)) == cell_len(text)
