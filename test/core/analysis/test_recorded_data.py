# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings: series out of messages, phases out of series, runs out of phases."""

import numpy as np
import pytest
from core.runs import (
    ACTUATORS,
    NOTICED_AFTER,
    PRELOAD,
    SECOND,
    messages,
    recording,
    suspicion,
)

from fault_tolerance.analysis.demo_summary import PHASES
from fault_tolerance.analysis.phases import (
    Note,
    Phase,
    note_as_text,
    note_from_text,
    phase_records,
)
from fault_tolerance.analysis.recorded_data import Message, recordings_of
from fault_tolerance.analysis.runs import run_of
from fault_tolerance.analysis.series import Series, series_of
from fault_tolerance.analysis.topics import RECORDED, is_read, split
from fault_tolerance.errors import FaultToleranceError

TWO = {'phases': PHASES[:3:2], 'states': ('nominal', 'degraded')}
SILENT = {'phases': PHASES[:2], 'states': ('nominal', 'degraded')}


def test_series_are_cut_and_shifted():
    series = series_of([(1.0, (3.0,)), (0.0, (1.0,)), (0.5, (2.0,))])
    assert series.time.tolist() == [0.0, 0.5, 1.0]
    part = series.since(0.5, 1.0)
    assert (part.time.tolist(), part.values.tolist()) == ([0.0], [[2.0]])


def test_series_of_samples_that_changed_their_width_keep_the_last():
    series = series_of([(0.0, (1.0,)), (1.0, (1.0, 2.0))])
    assert series.values.tolist() == [[1.0, 2.0]]
    assert series_of([], 3).values.shape == (0, 3)


def test_differences_are_taken_where_both_have_a_time():
    one = Series(np.array([0.0, 1.0, 2.0]), np.array([[1.0], [2.0], [3.0]]))
    other = Series(np.array([1.0, 2.0, 5.0]), np.array([[1.0], [1.0], [1.0]]))
    assert one.minus(other).values.tolist() == [[1.0], [2.0]]


def test_topics_are_split_into_robot_and_name():
    assert split('/a/b/fault_tolerance/metrics/hard_tolerance') == (
        '/a/b', 'fault_tolerance/metrics/hard_tolerance')
    assert split('/joint_states') == ('', 'joint_states')
    assert split('/my_joint_states') is None
    assert split('/diagnostics') is None
    assert '/diagnostics' in RECORDED and is_read('/diagnostics')
    assert not is_read('/my_joint_states')


def test_a_recording_is_what_was_said():
    found = recording(**TWO)
    assert (found.mechanism, found.actuators) == ('mirror_4_strut', ACTUATORS)
    assert [one.text for one in found.states] == ['nominal', 'nominal', 'degraded', 'nominal']
    assert found.error.values[:, 0] == pytest.approx(1e-6)
    assert np.linalg.norm(found.reference.values, axis=1) == pytest.approx(1e-3)
    # In the order of the actuators, not in that of the joint states.
    assert found.efforts.values[0].tolist() == PRELOAD.tolist()
    assert found.rates.values.shape[1] == 4
    assert found.scalars['active_failures'].values[:, 0] == pytest.approx(0.5)


def test_stamps_of_another_clock_give_way_to_the_time_of_receipt():
    heard = [
        Message(one.topic, one.time + 3600 * SECOND, one.content) for one in messages(**TWO)
    ]
    later = recordings_of(heard)['']
    assert later.error.time == pytest.approx(recording(**TWO).error.time)


def test_robots_are_told_apart():
    heard = [*messages(**TWO), *messages(namespace='/left', error=2e-6, **TWO)]
    found = recordings_of(heard)
    assert list(found) == ['', '/left']
    assert found['/left'].error.values[0, 0] == 2e-6
    # What is no controller is no robot of ours.
    assert recordings_of([one for one in heard if 'fault_tolerance' not in one.topic]) == {}


def test_noted_phases_begin_and_end_as_noted():
    records, period = phase_records(recording())
    assert period == 1.0
    assert [one.phase for one in records] == list(PHASES)
    for one in records:
        assert (one.duration, one.settled) == (pytest.approx(4.0), 1.0)
        assert one.error.time[0] == pytest.approx(0.0, abs=1e-6)
        assert one.preload == pytest.approx(PRELOAD)
        assert one.peak_force == pytest.approx(0.5)
        assert len(one.path) == len(one.error) == 200
    assert [one.state for one in records][-1] == 'stopped'


def test_a_run_without_notes_is_cut_where_the_verdict_changes():
    records, period = phase_records(recording(noted=False, **TWO))
    assert period is None
    assert [(one.phase.name, one.state) for one in records] == [
        ('nominal', 'nominal'), ('theta_4 stuck', 'degraded'), ('nominal', 'nominal')]
    assert records[1].phase.failures == (('position', 'theta_4'),)
    assert records[1].duration == pytest.approx(4.0, abs=0.3)


def test_a_phase_that_was_broken_off_ends_with_the_recording():
    heard = list(messages(**TWO))
    cut = [one for one in heard if one.time < heard[0].time + 8 * SECOND]
    records, _ = phase_records(recordings_of(cut)[''])
    assert [one.phase.name for one in records] == ['healthy', 'theta_4 stuck']
    assert records[1].duration == pytest.approx(1.5, abs=0.1)


def test_notes_come_back_as_they_were():
    note = Note(Phase('a, "b"', (('hard', 'strut_1'), ('torque', 'theta_2'))), 0.5, 2.0)
    assert note_from_text(note_as_text(note)) == note
    silent = Note(Phase('b', (('position', 'theta_1'),), silent=True), 0.5, 2.0, 10**18 + 1)
    assert note_from_text(note_as_text(silent)) == silent
    assert silent.phase.words == ('silent position theta_1',)
    assert silent.phase.mending == ('ok theta_1',)
    # As older recordings have it.
    assert note_from_text('{"name": "c", "failures": [], "settled": 1, "period": 1}').stamp == 0
    for text in ('', 'null', '[]', '{"name": "x"}', '{"name": 1, "failures": [1]}'):
        assert note_from_text(text) is None


def test_a_phase_begins_when_its_note_was_written():
    heard = [
        one._replace(time=one.time + SECOND // 5) if one.topic == '/operator/phase' else one
        for one in messages(**SILENT)
    ]
    records, _ = phase_records(recordings_of(heard)[''])
    assert records[1].found.time == pytest.approx(NOTICED_AFTER)


@pytest.mark.parametrize('noted', [True, False])
def test_what_was_noticed_is_found_in_its_phase(noted):
    records, _ = phase_records(recording(noted=noted, **SILENT))
    assert records[0].found is None
    found = records[1].found
    assert (found.mode, found.name, found.acted) == ('position', 'theta_4', True)
    assert found.time == pytest.approx(NOTICED_AFTER)
    assert found.onset == pytest.approx(0.0, abs=1e-6)


def test_what_is_acted_on_goes_before_what_is_only_suspected():
    heard = list(messages(**SILENT))
    (told,) = [one for one in heard if one.topic == '/diagnostics']
    sooner = told.time - SECOND // 100
    for hardware_id in ('theta_1', 'robot/theta_2'):
        heard.append(Message(
            '/diagnostics', sooner, suspicion(sooner, sooner, 'encoder', hardware_id, False)))
    heard.sort(key=lambda one: one.time)
    found = recordings_of(heard)['']
    assert [one.name for one in found.found] == ['theta_1', 'theta_4']
    records, _ = phase_records(found)
    assert records[1].found.name == 'theta_4'


def test_a_demonstration_is_found_in_a_recording():
    run = run_of({'': recording(**TWO), '/unrecovered': recording(**TWO)})
    assert list(run.passes) == ['recovered', 'unrecovered']
    assert run.rate_limits.tolist() == [0.05] * 4
    assert [run.is_tolerable(one.phase) for one in run.main] == [True, True]


def test_the_robot_of_a_run_is_chosen():
    both = {'/left': recording(**TWO), '/right': recording(**TWO)}
    with pytest.raises(FaultToleranceError, match='choose a namespace of /left, /right'):
        run_of(both)
    assert list(run_of(both, 'left').passes) == ['run']
    assert list(run_of({'/left': both['/left']}).passes) == ['run']
    with pytest.raises(FaultToleranceError, match='no controller in the namespace /middle'):
        run_of(both, '/middle')
    with pytest.raises(FaultToleranceError, match='no state or metrics of a controller'):
        run_of({})


def test_a_mechanism_that_is_not_known_has_no_verdict_and_no_limits():
    heard = list(messages(**TWO))
    for one in heard:
        if one.topic == '/fault_tolerance/metrics':
            one.content.status[0].hardware_id = 'mine'
    run = run_of(recordings_of(heard))
    assert run.mechanism is None
    assert run.is_tolerable(run.main[1].phase) is None
    assert np.isinf(run.rate_limits).all()
