# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Reports of recordings that lack most of what the demonstration records."""

from types import SimpleNamespace as Fields

import numpy as np
import pytest
from core.runs import ACTUATORS, SECOND, messages, metrics, stamped

from fault_tolerance.analysis.demo_summary import PHASES, summary
from fault_tolerance.analysis.figures import report_figure
from fault_tolerance.analysis.phases import phase_records
from fault_tolerance.analysis.recorded_data import Message, recordings_of
from fault_tolerance.analysis.recorded_verdicts import scalar_in
from fault_tolerance.analysis.report_page import write_report
from fault_tolerance.analysis.runs import run_of
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.catalogue import mechanism_named

MIRROR = mechanism_named('mirror_4_strut')
TWO = {'phases': (PHASES[0], PHASES[2]), 'states': ('nominal', 'degraded'), 'noted': False}
START = 1_700_000_000 * SECOND


def heard(*without, **options):
    """Return the messages of a robot, except those of some topics."""
    return [one for one in messages(**TWO, **options)
            if not any(word in one.topic for word in without)]


def only(found):
    (recording,) = found.values()
    return recording


def names(found):
    return [(one.phase.name, one.state) for one in phase_records(only(found))[0]]


def status(time, state, failures):
    values = {'state': state, 'failures': ', '.join(failures), 'suspected': ''}
    return Message('/robot/fault_tolerance/status', time, Fields(
        name='robot/fault_tolerance: status', hardware_id='robot/mirror_4_strut', message='',
        values=[Fields(key=key, value=value) for key, value in values.items()]))


def report(time, hardware_id, mode):
    return Message('/diagnostics', time, stamped(time, status=[Fields(
        name='drive', hardware_id=hardware_id, message='',
        values=[Fields(key='failure_mode', value=mode)])]))


def test_without_metrics_the_state_and_the_drives_reports_make_the_phases():
    broken = START + 7 * SECOND
    bag = [*heard('metrics', namespace='/robot'),
           report(broken, 'robot/theta_4', 'stuck'), report(broken, 'other/theta_1', 'lost')]
    found = recordings_of(sorted(bag, key=lambda one: one.time))
    assert names(found) == [
        ('nominal', 'nominal'), ('degraded', 'degraded'), ('theta_4 stuck', 'degraded'),
        ('theta_4 stuck', 'nominal')]
    assert only(found).mechanism == ''


def test_without_metrics_the_status_says_all_of_it():
    bag = [*heard('metrics', 'state', namespace='/robot'),
           status(START, 'nominal', []), status(START + 4 * SECOND, 'hold', []),
           # Too short to be seen: not two phases.
           status(START + 4 * SECOND + SECOND // 10, 'nominal', []),
           status(START + 7 * SECOND, 'degraded', ['position:theta_4'])]
    found = recordings_of(sorted(bag, key=lambda one: one.time))
    assert names(found) == [('nominal', 'nominal'), ('theta_4 stuck', 'degraded')]
    assert only(found).mechanism == 'mirror_4_strut'
    assert run_of(found).is_tolerable(phase_records(only(found))[0][1].phase) is True


def test_with_nothing_but_commands_there_is_one_phase():
    found = recordings_of(heard('metrics', 'state', 'pointing', 'joint_states'))
    assert names(found) == [('all of it', '')]


def test_measures_come_from_the_metrics_where_their_own_topics_are_missing():
    message = metrics(0, 'nominal', [])
    for name, position in (('theta_1', '0.7'), ('theta_2', '0.4'), ('theta_3', '')):
        message.status.append(Fields(
            name=f'fault_tolerance: {name}', hardware_id=name, message='',
            values=[Fields(key='failure', value='none'), Fields(key='position', value=position)]))
    message.status[0].values.append(Fields(key='condition_number', value='1.25'))
    assert scalar_in(message, 'position_tolerance') == 0.4
    assert scalar_in(message, 'hard_tolerance') is None
    assert scalar_in(message, 'condition_number') == 1.25
    assert scalar_in(message, 'tracking_error') is None


@pytest.mark.parametrize('efforts', ['absent', 'zero', 'nan'])
def test_without_efforts_there_are_no_forces(efforts, tmp_path):
    bag = heard()
    for one in bag:
        if one.topic == '/joint_states':
            count = len(one.content.name)
            one.content.effort = {'absent': [], 'zero': count * [0.0], 'nan': count * [np.nan]}[
                efforts]
    run = run_of(recordings_of(bag))
    assert [one.peak_force for one in run.main] == pytest.approx(3 * [np.nan], nan_ok=True)
    assert not any('force' in axes.get_ylabel() for axes in report_figure(run).axes)
    assert all(one['peak_force'] == {'run': None} for one in summary(run)['phases'])
    assert len(write_report(run, tmp_path)) == 3


def test_drives_at_rest_have_no_scale():
    bag = heard('metrics', 'pointing', 'joint_states')
    for one in bag:
        if one.topic == '/velocity_controller/commands':
            one.content.data = [0.0] * 4
    (axes,) = report_figure(run_of(recordings_of(bag))).axes
    assert axes.get_ylabel().startswith('commanded rate')
    assert axes.get_yticks().tolist() == [0.0]


def test_joint_states_of_several_robots_on_one_topic_are_found():
    bag = [one._replace(topic='/joint_states') if one.topic.endswith('joint_states') else one
           for one in heard(namespace='/robot')]
    (record, *_) = run_of(recordings_of(bag)).main
    assert record.preload.tolist() == [1.0, 2.0, 3.0, 4.0]


def test_a_mechanism_can_be_told_and_must_fit():
    bag = heard('metrics', 'joint_commands')
    found = recordings_of(bag, MIRROR)
    run = run_of(found, None, MIRROR)
    assert (run.mechanism_name, run.actuators) == ('mirror_4_strut', ACTUATORS)
    assert np.isfinite(run.rate_limits).all()
    # Without it nobody knows the order of the commands.
    assert run_of(recordings_of(bag)).actuators == ('drive 1', 'drive 2', 'drive 3', 'drive 4')
    other = mechanism_named('mirror_3_strut')
    with pytest.raises(FaultToleranceError, match='has 3 actuators, the commands have 4 rates'):
        run_of(recordings_of(bag, other), None, other)
