# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Groups of parts that fail together: what is forecast is what happens."""

import json
import re

import pytest
from core.control.control_cases import fed, report

from fault_tolerance.analysis.reports import measures_report
from fault_tolerance.cli import main
from fault_tolerance.kinematics.common_causes import group_failures, group_outlooks
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_path
from fault_tolerance.mechanism.files import mechanism_from_text

GROUPS = 'groups: {pair: [theta_1, strut_2], mixed: [theta_1, theta_3], one: [theta_4]}\n'


def grouped(groups=GROUPS, name='mirror_4_strut', **when_off):
    text = mechanism_path(name).read_text() + groups
    for drive, word in when_off.items():
        head, tail = text.split(f'{{name: {drive}, ')
        text = f'{head}{{name: {drive}, when_off: {word}, {tail}'
    return mechanism_from_text(text)


def verdicts(post):
    return {one.name: one.verdict and one.verdict.tolerable for one in group_outlooks(post)}


def test_drives_are_what_they_are_without_power_or_the_worse():
    """Of the four-strut mirror t = 0.5 of a free strut is worse than p = 0.58 of a stuck one."""
    found = group_failures(grouped(theta_3='stuck'))
    assert [str(one) for one in found['pair'].failures] == ['torque:theta_1', 'torque:theta_2']
    assert [str(one) for one in found['mixed'].failures] == ['position:theta_3', 'torque:theta_1']
    assert [str(one) for one in found['one'].failures] == ['torque:theta_4']
    # A platform without redundancy rather has a free leg than a stuck one, if one of the two.
    legs = group_failures(grouped('groups: {legs: [leg_1]}\n', 'gough_stewart_8'))
    assert [str(one) for one in legs['legs'].failures] == ['position:leg_1']


def test_two_free_ones_are_intolerable_and_one_free_and_one_stuck_are_not():
    post = after(grouped(theta_3='stuck'))
    assert verdicts(post) == {'pair': False, 'mixed': True, 'one': True}
    report_ = measures_report(post, pairs=True)
    assert report_['torque_pairs']['theta_1,theta_2'] == pytest.approx(0.0, abs=1e-9)
    assert report_['worst_next'] == {'mode': 'group', 'name': 'pair', 'measure': 0.0}


def test_what_has_failed_already_has_no_outlook_and_what_is_left_is_judged():
    post = after(grouped(), ['free:theta_4', 'stuck:theta_1'])
    assert verdicts(post) == {'pair': False, 'mixed': False, 'one': None}
    # A single failure that cannot be borne comes before a group.
    assert measures_report(post)['worst_next']['mode'] != 'group'


def test_a_strut_without_a_drive_is_lost():
    mechanism = grouped()
    text = mechanism_path('mirror_4_strut').read_text()
    passive = mechanism_from_text(
        re.sub('theta_1(.*?), actuated.*}', r'slide\1}', text) + 'groups: {mount: [strut_1]}\n')
    assert [str(one) for one in group_failures(passive)['mount'].failures] == ['hard:strut_1']
    assert mechanism.groups['one'] == ('theta_4',)


@pytest.mark.parametrize(('before', 'outlooks'), [
    ((), {'pair': 'stopped', 'mixed': 'degraded', 'one': 'degraded'}),
    (('stuck theta_2',), {'pair': 'degraded', 'mixed': 'stopped', 'one': 'degraded'}),
    (('free theta_4',), {'pair': 'stopped', 'mixed': 'stopped', 'one': 'failed'}),
])
def test_the_controller_does_what_its_metrics_forecast(before, outlooks):
    mechanism = grouped(theta_3='stuck')
    for name, wanted in outlooks.items():
        supervisor = fed(mechanism)
        supervisor.reports([report(*words.split()) for words in before], 0.0)
        supervisor.step(0.0)
        metrics = supervisor.metrics()
        assert {one.name: one.outlook for one in metrics.groups} == outlooks
        (group,) = (one for one in metrics.groups if one.name == name)
        # From a source of its own: the same one would replace what it has said.
        reports = [report(*one.split(':'), name='amplifier') for one in group.failures]
        supervisor.reports(reports, 0.0)
        state = supervisor.step(0.0).state
        assert state.value == ('degraded' if wanted == 'failed' else wanted)
        if state.value == 'stopped':
            assert supervisor.metrics().groups == ()


def test_the_worst_of_the_metrics_is_a_group_where_no_single_failure_stops_it():
    supervisor = fed(grouped())
    supervisor.step(0.0)
    metrics = supervisor.metrics()
    assert (metrics.worst_next, metrics.worst_next_measure) == ('group:pair', 0.0)


def test_the_command_line_names_groups(tmp_path, capsys):
    file = tmp_path / 'grouped.yaml'
    file.write_text(mechanism_path('mirror_4_strut').read_text() + GROUPS)
    for command in ('measures', 'check'):
        assert main([command, str(file)]) == 0
        lines = [line.split() for line in capsys.readouterr().out.splitlines()]
        assert ['pair', 'theta_1', 'free', 'NOT', 'tolerable'] in lines
        assert main([command, str(file), '--failed', 'free:theta_4', '--json']) == 0
        groups = json.loads(capsys.readouterr().out)['groups']
        assert groups['one'] is None
        assert groups['pair']['tolerable'] is False
        assert groups['pair']['failures'][0] == {'name': 'theta_1', 'mode': 'torque'}
        assert 'zero velocity does not hold' in groups['pair']['reason']
