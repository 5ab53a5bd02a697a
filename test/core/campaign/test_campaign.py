# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Failures in closed loop, against the theory; the whole of it is `make campaign`."""

import csv
import io
import json
import time
from dataclasses import replace

import pytest
from rich.console import Console

from fault_tolerance.analysis.campaign import (
    COLUMNS,
    TrialRecord,
    campaign_summary,
    campaign_table,
)
from fault_tolerance.campaign.cases import MECHANISMS
from fault_tolerance.campaign.runner import records, run_campaign, tasks
from fault_tolerance.campaign.trial import Bench, TrialSettings
from fault_tolerance.cli import main
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path

# One line of the raster before the failure, and one after it.
SHORT = TrialSettings(
    warm_up=1.0, healthy=0.5, latest=0.25, settling=0.8, watched=0.5, stopped=0.1
)
GOOD = TrialRecord(
    mechanism='m', failures='position:a', tolerable=True, states=('degraded',),
    final_state='degraded', largest_rate=0.1, error_rms=1.1e-6, healthy_error_rms=1e-6,
    peak_force=0.5, recovery_time_us=900.0, seed=3,
)
STOPPED = replace(
    GOOD, tolerable=False, states=('stopped',), final_state='stopped', largest_rate=0.0,
    error_rms=1.0,
)
CONVERTED = replace(
    STOPPED, with_conversion='degraded', converted_error_rms=1.1e-6, convertible=True,
)


@pytest.mark.slow
def test_single_failures_go_as_the_theory_says(tmp_path):
    todo = tasks(MECHANISMS, SHORT, doubles=False)
    # The legs of the platform come in pairs, all pairs alike.
    legs = tuple(f'_{number}' for number in range(3, 9))
    todo = [
        task for task in todo
        if task.mechanism != 'gough_stewart_8' or not task.failures[0].endswith(legs)
    ]
    found = records(todo, tmp_path)

    assert [record.mistakes for record in found if record.mistakes] == []
    assert {record.mechanism for record in found} == set(MECHANISMS)
    assert len(found) == 9 + 12 + 13 + 6
    assert {record.final_state for record in found} == {'degraded', 'stopped'}
    assert max(record.error_ratio for record in found if record.tolerable) <= 1.2


def test_what_is_intolerable_at_home_only_is_stopped_in_the_same_period_too():
    short = replace(SHORT, warm_up=0.1, healthy=0.1, latest=0.1)
    bench = Bench(mechanism_named('gough_stewart_8'), short)
    for seed, pair in enumerate((
        [('torque', 'leg_1'), ('torque', 'leg_3')], [('torque', 'leg_5'), ('hard', 'strut_7')],
    ), 1):
        record = bench.trial(failure_set(bench.mechanism, pair), seed)
        assert not record.tolerable
        assert record.states == ('stopped',)
        assert record.mistakes == ()


def test_without_recovery_the_campaign_notices():
    bench = Bench(mechanism_named('mirror_4_strut'), replace(SHORT, recovery=False))
    record = bench.trial(failure_set(bench.mechanism, [('position', 'theta_4')]), 1)

    assert record.error_ratio > 20.0
    (mistake,) = record.mistakes
    assert 'times the healthy' in mistake
    assert record.peak_force > 1.0


def test_the_same_seed_gives_the_same_trial_and_another_one_another():
    settings = replace(SHORT, healthy=0.1, warm_up=0.1, settling=0.02, watched=0.05)
    bench = Bench(mechanism_named('mirror_3_strut'), settings)
    stuck = failure_set(bench.mechanism, [('position', 'theta_1')])

    assert bench.trial(stuck, 1) == bench.trial(stuck, 1)
    assert bench.trial(stuck, 1).error_rms != bench.trial(stuck, 2).error_rms


def test_groups_are_tried_and_brakes_convert_what_they_can(tmp_path, capsys):
    """Of two pairs of struts on one amplifier each, the first has brakes."""
    text = mechanism_path('mirror_4_strut').read_text()
    text += 'groups: {braked: [theta_1, theta_2], others: [theta_3, theta_4]}\n'
    head, tail = text.split('  - name: strut_3\n')
    text = f'{head}  - name: strut_3\n{tail.replace("brake: true", "brake: false")}'
    file = tmp_path / 'braked.yaml'
    file.write_text(text)
    settings = replace(SHORT, warm_up=0.5, healthy=0.3, latest=0.01, watched=0.3)
    todo = [one for one in tasks([str(file)], settings, doubles=False, groups=True) if one.group]
    found = records(todo, tmp_path / 'parts')
    assert [(one.group, one.failures) for one in found] == [
        ('braked', 'torque:theta_1;torque:theta_2'), ('others', 'torque:theta_3;torque:theta_4')]
    assert [(one.final_state, one.with_conversion) for one in found] == [
        ('stopped', 'degraded'), ('stopped', 'stopped')]
    assert [one.mistakes for one in found] == [(), ()]
    assert found[0].row(COLUMNS)[-2:] == ('braked', 'degraded')


@pytest.mark.parametrize(('record', 'complaint'), [
    (replace(GOOD, error_rms=1.21e-6), 'error 1.21 times the healthy 1.00 microradians'),
    (replace(GOOD, error_rms=float('nan')), 'error nan times'),
    (replace(GOOD, states=('degraded', 'hold')), 'tolerable, but degraded, then hold and not deg'),
    (replace(GOOD, states=('stopped',)), 'tolerable, but stopped and not degraded'),
    (replace(STOPPED, states=('degraded', 'stopped')), 'intolerable, but degraded, then stopped'),
    (replace(STOPPED, largest_rate=1e-9), 'a rate of 1e-09 was commanded'),
    (replace(CONVERTED, with_conversion='stopped'), 'with conversion stopped and not degraded'),
    (replace(CONVERTED, convertible=False), 'with conversion degraded and not stopped'),
    (replace(CONVERTED, converted_error_rms=1.3e-6), 'with conversion error 1.3 times'),
])
def test_what_is_not_as_it_should_be_is_told(record, complaint):
    assert complaint in '; '.join(record.mistakes)
    assert campaign_summary([record], 1)['mistakes'][0]['failures'] == 'position:a'


def test_what_is_as_it_should_be_is_no_mistake():
    assert GOOD.mistakes == STOPPED.mistakes == CONVERTED.mistakes == ()


def test_the_table_fits_eighty_columns_without_breaking_a_word():
    pair = replace(GOOD, failures='position:theta_3;hard:strut_4', peak_force=12.25)
    named = [replace(pair, mechanism='mirror_overactuated'), replace(GOOD, mechanism='one')]
    console = Console(width=80, file=io.StringIO(), color_system=None)
    console.print(campaign_table(campaign_summary(named, 1)))
    lines = [line.rstrip() for line in console.file.getvalue().splitlines()]

    first = next(k for k, line in enumerate(lines) if 'mirror_overactuated' in line)
    assert lines[first].split() == [
        'mirror_overactuated', '1', '0', '1.100', '12.25', '900', '0', 'theta_3', 'stuck'
    ]
    assert lines[first + 1].split() == ['strut_4', 'lost']
    assert lines[first + 2].split()[-2:] == ['a', 'stuck']
    assert max(map(len, lines)) <= 80


def test_results_are_written_as_the_contract_says(tmp_path, capsys):
    settings = replace(SHORT, warm_up=0.1, healthy=0.1, settling=0.1, watched=0.1, stopped=0.02,
                       clock=time.thread_time)
    code = run_campaign(
        tmp_path, ['mirror_3_strut'], doubles=False, settings=settings
    )

    with (tmp_path / 'results.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS == (
        'mechanism', 'failures', 'tolerable', 'final_state', 'error_rms', 'healthy_error_rms',
        'peak_force', 'recovery_time_us', 'seed', 'group', 'with_conversion',
    )
    assert len(rows) == 9
    # Times are another file's: this one is the same whoever does the work.
    assert {row['recovery_time_us'] for row in rows} == {''}
    with (tmp_path / 'timings.csv').open(newline='') as file:
        timings = list(csv.DictReader(file))
    assert [row['failures'] for row in timings] == [row['failures'] for row in rows]
    assert all(float(row['recovery_time_us']) > 0.0 for row in timings)
    assert {row['tolerable'] for row in rows} == {'true', 'false'}
    assert [row['failures'] for row in rows if row['tolerable'] == 'true'] == [
        'position:theta_1', 'position:theta_2', 'position:theta_3']
    assert all(float(row['error_rms']) > 0.0 for row in rows)
    # Nothing can be braked or released there.
    assert {(row['group'], row['with_conversion']) for row in rows} == {('', '')}
    summary = json.loads((tmp_path / 'summary.json').read_text())
    assert summary['trials'] == 9
    assert summary['mechanisms']['mirror_3_strut']['intolerable'] == 6
    assert code == (1 if summary['mistakes'] else 0)
    assert '9 trials' in capsys.readouterr().out


@pytest.mark.parametrize(('arguments', 'complaint'), [
    (['--workers', '0'], "'0' is not a number of processes, dask://HOST:PORT or mpi"),
    (['--workers', 'dask://'], "'dask://' is not a number of processes"),
    (['--seed', '-1'], "'-1' is not a whole number"),
    (['--mechanism', 'no_such_mirror'], 'no_such_mirror'),
    (['--mechanism', 'serial_3r'], 'cannot point'),
    (['--groups', '--mechanism', 'mirror_3_strut'], 'no groups in mirror_3_strut'),
    (['--reference', 'spiral'], 'spiral'),
])
def test_bad_input_is_refused_in_one_line(arguments, complaint, capsys, tmp_path):
    try:
        code = main(['campaign', *arguments, '--output', str(tmp_path / 'out')])
    except SystemExit as end:
        code = end.code
    assert code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert complaint in line
    assert not (tmp_path / 'out').exists()
