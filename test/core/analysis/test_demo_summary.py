# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the demonstration makes of its recordings."""

import json
from dataclasses import replace

import numpy as np
import pytest
from core.runs import NOTICED_AFTER, demonstration
from rich.console import Console

from fault_tolerance.analysis.delays import commanded_after, delay_sentences, detected
from fault_tolerance.analysis.demo_summary import (
    PHASES,
    summary,
    summary_table,
    unrecovered_phases,
)
from fault_tolerance.analysis.recorded_data import Found
from fault_tolerance.analysis.series import Series
from fault_tolerance.mechanism.catalogue import mechanism_named

MECHANISM = mechanism_named('mirror_4_strut')


@pytest.fixture(scope='module')
def run():
    return demonstration()


def test_the_theory_tolerates_all_phases_but_the_last():
    assert [phase.is_tolerable(MECHANISM) for phase in PHASES] == [True] * 7 + [False]
    free = replace(PHASES[6], converts=False)
    assert free.words == ('torque theta_1', 'torque theta_3')
    assert not free.is_tolerable(MECHANISM)


def test_error_is_the_median_over_periods_after_settling(run):
    one = run.main[0]
    error = one.error.values.copy()
    error[:50] = 1.0  # settling
    error[50:55] = 5e-5  # a hiccup in the first of three periods
    one = replace(one, error=Series(one.error.time, error))
    assert one.error_rms(1.0) == pytest.approx(1e-6)
    assert one.error_rms(None) > 5e-6
    assert one.peak_force == pytest.approx(0.5)


def test_summary_is_plain_json_with_the_agreed_keys(run):
    result = summary(run)
    again = json.loads(json.dumps(result, allow_nan=False))

    assert again == result
    assert (result['mechanism'], result['period']) == ('mirror_4_strut', 1.0)
    phase = result['phases'][5]
    assert phase['name'] == 'theta_1 stuck, theta_3 free'
    assert phase['failures'] == [
        {'name': 'theta_1', 'mode': 'position'},
        {'name': 'theta_3', 'mode': 'torque'},
    ]
    assert (phase['state'], phase['tolerable']) == ('degraded', True)
    assert phase['error_rms_urad'] == pytest.approx({'recovered': 1.0, 'unrecovered': 300.0})
    assert phase['peak_force'] == pytest.approx({'recovered': 0.5, 'unrecovered': 0.5})
    assert phase['measures']['hard_tolerance'] is None
    assert phase['measures']['position_tolerance'] == 0.5
    assert [one['converts'] for one in result['phases']] == [False] * 6 + [True, False]


def test_a_run_as_the_theory_says_has_nothing_wrong(run):
    assert unrecovered_phases(summary(run)) == []


@pytest.mark.parametrize(
    ('index', 'change', 'complaint'),
    [
        (1, {'state': 'nominal'},
         'theta_4 stuck, unreported: state nominal, expected degraded'),
        (2, {'state': 'stopped'}, 'theta_4 stuck: state stopped, expected degraded'),
        (6, {'state': 'stopped'}, 'two free drives and a brake: state stopped, expected degr'),
        (7, {'state': 'degraded'}, 'theta_1, theta_2 stuck: state degraded, expected stopped'),
        (3, {'error': 1e-4}, 'theta_2 free: pointing error 141'),
        (4, {'error': np.nan}, 'strut_3 lost: pointing error None'),
        (0, {'found': Found(0.5, 'position', 'theta_1', True, 0.4)},
         'healthy: theta_1 was suspected (position)'),
    ],
)
def test_what_is_not_as_the_theory_says_is_named(run, index, change, complaint):
    one = run.main[index]
    if 'error' in change:
        wrong = np.full_like(one.error.values, change['error'])
        change = {'error': Series(one.error.time, wrong)}
    records = [*run.main]
    records[index] = replace(one, **change)
    changed = replace(run, passes={**run.passes, 'recovered': records})
    (line,) = unrecovered_phases(summary(changed))
    assert line.startswith(complaint)


def test_what_nobody_reported_is_in_the_summary_with_its_delay(run):
    phases = summary(run)['phases']
    assert [phase['detected'] for phase in phases if phase['name'] != PHASES[1].name] == [None] * 7
    found = phases[1]['detected']
    assert (found['name'], found['mode']) == ('theta_4', 'position')
    assert found['delay'] == pytest.approx(NOTICED_AFTER)
    # theta_4 is told 1e-4 m/s times sin(3) at first.
    assert found['delay_from_micrometre'] == pytest.approx(
        NOTICED_AFTER - commanded_after(run, run.main[1]))
    assert delay_sentences(summary(run)) == [
        'Phase 2: theta_4 was named 20 ms after it failed, '
        f'{-1e3 * found["delay_from_micrometre"]:.0f} ms before its first commanded micrometre.'
    ]


def test_a_micrometre_is_commanded_when_the_rates_have_added_up_to_it(run):
    rates = Series(np.array([-0.01, 0.01, 0.02]), np.array([[0.0] * 3 + [rate] for rate in (
        1e-5, -1e-4, 1e-3)]))
    one = replace(run.main[1], setpoints=rates)
    # 0.1 um until 0.01 s, 1 um more until 0.02 s.
    assert commanded_after(run, one) == pytest.approx(0.019)
    slow = Series(rates.time, 1e-4 * rates.values)
    assert commanded_after(run, replace(one, setpoints=slow)) is None
    assert commanded_after(run, replace(one, found=None)) is None
    lost = replace(one, found=one.found._replace(name='strut_4'))
    assert commanded_after(run, lost) == pytest.approx(0.019)
    unknown = replace(run, mechanism=None)
    assert commanded_after(unknown, one) is None
    assert detected(unknown, one)['delay_from_micrometre'] is None


def test_the_table_shows_every_phase_in_80_columns(run):
    console = Console(width=80, record=True, file=open('/dev/null', 'w'))
    console.print(summary_table(summary(run)))
    text = console.export_text()
    lines = [line for line in text.splitlines() if line.strip()]
    # Title, heading, rule, and one line for each phase.
    assert len(lines) == 3 + len(PHASES)
    assert '20 ms' in text
    for phase in PHASES:
        assert phase.name in text
    assert text.count('1.0 (300.0)') == len(PHASES)


def test_the_table_of_a_single_pass_has_no_brackets(run):
    console = Console(width=120, record=True, file=open('/dev/null', 'w'))
    alone = replace(run, passes={'run': run.main})
    console.print(summary_table(summary(alone)))
    text = console.export_text()
    assert '(' not in text and text.count(' 1.0 ') == len(PHASES)
