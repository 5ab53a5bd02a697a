# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the demonstration makes of its recordings."""

import json
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from fault_tolerance.analysis.demonstration import (
    PHASES,
    PhaseRecord,
    summary,
    summary_table,
    unrecovered_phases,
)
from fault_tolerance.analysis.figures import demonstration_figure, save_figure
from fault_tolerance.mechanism.catalogue import mechanism_named

MECHANISM = mechanism_named('mirror_4_strut')
STATES = ('nominal', 'degraded', 'degraded', 'degraded', 'degraded', 'stopped')


def record(phase, state, error=1e-6, force=0.5):
    """Return four seconds at 100 Hz with a constant error about x, one force off the preload."""
    time = np.arange(400) / 100.0
    errors = np.zeros((400, 2))
    errors[:, 0] = error
    reference = 1e-3 * np.stack([np.cos(2 * np.pi * time), np.sin(2 * np.pi * time)], axis=1)
    efforts = np.tile([1.0, 2.0, 3.0, 4.0], (400, 1))
    efforts[200, 1] -= force
    preload = np.array([1.0, 2.0, 3.0, 4.0])
    measures = {'position_tolerance': 0.5, 'torque_tolerance': 0.0, 'hard_tolerance': np.inf}
    return PhaseRecord(phase, state, time, errors, reference, efforts, preload, measures, 1.0)


def passes():
    recovered = [record(phase, state) for phase, state in zip(PHASES, STATES, strict=True)]
    return {
        'recovered': recovered,
        'unrecovered': [replace(one, error=300.0 * one.error) for one in recovered],
    }


def test_the_theory_tolerates_all_phases_but_the_last():
    assert [phase.is_tolerable(MECHANISM) for phase in PHASES] == [True] * 5 + [False]


def test_error_is_the_median_over_periods_after_settling():
    one = record(PHASES[0], 'nominal')
    one.error[:100] = 1.0  # settling
    one.error[100:110] = 5e-5  # a hiccup in the first of three periods
    assert one.error_rms(1.0) == pytest.approx(1e-6)
    assert one.peak_force == pytest.approx(0.5)


def test_summary_is_plain_json_with_the_agreed_keys():
    result = summary(MECHANISM, passes(), 1.0)
    again = json.loads(json.dumps(result, allow_nan=False))

    assert again == result
    phase = result['phases'][4]
    assert phase['failures'] == [
        {'name': 'theta_1', 'mode': 'position'},
        {'name': 'theta_3', 'mode': 'torque'},
    ]
    assert (phase['state'], phase['tolerable']) == ('degraded', True)
    assert phase['error_rms_urad'] == pytest.approx({'recovered': 1.0, 'unrecovered': 300.0})
    assert phase['peak_force'] == pytest.approx({'recovered': 0.5, 'unrecovered': 0.5})
    assert phase['measures']['hard_tolerance'] is None


def test_a_run_as_the_theory_says_has_nothing_wrong():
    assert unrecovered_phases(summary(MECHANISM, passes(), 1.0)) == []


@pytest.mark.parametrize(
    ('index', 'change', 'complaint'),
    [
        (1, {'state': 'stopped'}, 'theta_4 stuck: state stopped, expected degraded'),
        (5, {'state': 'degraded'}, 'theta_1, theta_2 stuck: state degraded, expected stopped'),
        (2, {'error': np.full((400, 2), 1e-4)}, 'theta_2 free: pointing error 141'),
        (3, {'error': np.full((400, 2), np.nan)}, 'strut_3 lost: pointing error None'),
    ],
)
def test_what_is_not_as_the_theory_says_is_named(index, change, complaint):
    runs = passes()
    runs['recovered'][index] = replace(runs['recovered'][index], **change)
    (line,) = unrecovered_phases(summary(MECHANISM, runs, 1.0))
    assert line.startswith(complaint)


def test_the_table_shows_every_phase_with_and_without_recovery():
    console = Console(width=120, record=True, file=open('/dev/null', 'w'))
    console.print(summary_table(summary(MECHANISM, passes(), 1.0)))
    text = console.export_text()
    for phase in PHASES:
        assert phase.name in text
    assert text.count('1.0 (300.0)') == len(PHASES)


def test_the_figure_is_a_picture_of_the_stated_size(tmp_path):
    path = tmp_path / 'report.png'
    save_figure(demonstration_figure(passes(), 1.0), path)
    content = path.read_bytes()
    assert content.startswith(b'\x89PNG')
    width, height = (int.from_bytes(content[at : at + 4], 'big') for at in (16, 20))
    assert (width, height) == (1650, 930)
