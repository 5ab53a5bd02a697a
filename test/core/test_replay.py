# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Detection on a recording: what the live detection has found, to the last bit."""

from __future__ import annotations

import json

import pytest
from core.recorded_loop import BEGIN, STORE, RecordedLoop, make, sample
from core.test_cli import result, run

from fault_tolerance.analysis.bags import write_bag
from fault_tolerance.analysis.recorded_inputs import recorded_inputs
from fault_tolerance.cli import BAD_INPUT
from fault_tolerance.replay.replayed import replayed

UNNAMED = ('/fault_tolerance/joint_commands',)


def eventful(**options):
    """Return a loop with probes, silent failures, a report and a clear."""
    loop = RecordedLoop(**options)
    loop.run(1.2)
    assert loop.probe().startswith('no latent failure')
    loop.break_silently('free theta_2')
    loop.run(0.2)
    loop.probe()
    loop.report('torque', 'theta_2')
    loop.break_silently('ok theta_2')
    loop.run(3.1)
    loop.clear()
    loop.run(0.3)
    loop.break_silently('stuck theta_4')
    loop.run(0.6)
    assert len(loop.found) >= 2
    return loop


def stuck(**options):
    loop = RecordedLoop(**options)
    loop.run(1.2)
    loop.break_silently('stuck theta_4')
    loop.run(0.4)
    assert loop.found
    return loop


@pytest.fixture(scope='module')
def loop():
    return eventful()


def test_what_is_found_is_what_was_found_live(loop, tmp_path, capsys):
    bag = loop.write(tmp_path / 'run.mcap')
    found = result(capsys, 'detect', bag)
    assert found['findings'] == loop.found
    assert (found['mechanism'], found['joint_states']) == ('mirror_4_strut', len(loop.evidence))
    assert found['remarks'] == ['when failures were cleared is taken from the metrics']
    assert (tmp_path / 'detection.png').read_bytes().startswith(b'\x89PNG')


def test_the_evidence_is_the_same_to_the_last_bit(loop, tmp_path):
    again = replayed(recorded_inputs(loop.write(tmp_path / 'run.mcap')), loop.mechanism)
    assert [one.odds for one in again.course] == loop.evidence
    assert again.probes >= 1


def test_one_message_for_each_joint(tmp_path, capsys):
    loop = stuck(parts=True)
    # Its encoder dies with it.
    loop.report('position', 'theta_4')
    loop.mute = {'theta_4'}
    loop.run(0.3)
    bag = loop.write(tmp_path / 'run.mcap')
    found = result(capsys, 'detect', bag)
    assert found['findings'] == loop.found and not found['remarks']
    again = replayed(recorded_inputs(bag), loop.mechanism)
    assert [one.odds for one in again.course] == loop.evidence


def test_stamps_pair_commands_that_do_not_say_what_they_answer(tmp_path, capsys):
    loop = RecordedLoop(answers=False)
    loop.run(1.2)
    loop.probe()
    loop.break_silently('lost strut_3')
    loop.run(0.2)
    loop.probe()
    (live,) = loop.found
    found = result(capsys, 'detect', loop.write(tmp_path / 'run.mcap'))
    assert found['findings'] == [live] and found['probes'] >= 1
    assert found['remarks'] == [
        'the joint commands do not say which joint states they answer: paired by their stamps']


def test_a_probe_that_ended_early_is_no_evidence(tmp_path):
    loop = RecordedLoop()
    loop.run(1.2)
    loop.monitor.prober.request()
    loop.run(0.3)
    loop.report('position', 'theta_1')
    loop.run(0.5)
    assert not loop.monitor.prober.probing
    again = replayed(recorded_inputs(loop.write(tmp_path / 'run.mcap')), loop.mechanism)
    assert again.probes == 0
    assert [one.odds for one in again.course] == loop.evidence


def test_joint_states_that_the_controller_did_not_take_are_passed_over(tmp_path):
    loop = stuck()
    extra = [one for one in loop.samples if one.topic == '/joint_states'][60]
    for shift in (-3_000, 3_000):
        message = STORE.deserialize_cdr(extra.data, extra.kind)
        message.position = message.position + 1e-9
        loop.samples.append(sample(extra.topic, message, extra.time + shift))
    again = replayed(recorded_inputs(loop.write(tmp_path / 'run.mcap')), loop.mechanism)
    assert [one.odds for one in again.course] == loop.evidence
    assert again.remarks == ('2 joint states were not taken by the controller',)


def test_acting_is_replayed_too(tmp_path, capsys):
    loop = stuck(detect='act')
    bag = loop.write(tmp_path / 'run.mcap')
    found = result(capsys, 'detect', bag, '--detect', 'act')
    assert found['findings'] == loop.found
    assert found['findings'][0]['failure_mode'] == 'position'
    # What it had reported itself is no report.
    advice = result(capsys, 'detect', bag)['findings']
    assert advice[0]['suspected_mode'] == 'position'
    assert advice[0]['log_odds'] == loop.found[0]['log_odds']


def test_what_has_healed_by_itself_is_no_clear(tmp_path):
    """And a clear of what is still seen changes nothing."""
    loop = stuck()
    loop.clear()
    loop.run(0.2)
    loop.break_silently('ok theta_4')
    loop.run(0.5)
    assert not loop.detector.suspicions
    again = replayed(recorded_inputs(loop.write(tmp_path / 'run.mcap')), loop.mechanism)
    assert [one.odds for one in again.course] == loop.evidence
    assert again.remarks == ()


def test_without_joint_commands_it_says_so(tmp_path, capsys):
    loop = stuck()
    found = result(capsys, 'detect', loop.write(tmp_path / 'run.mcap', without=UNNAMED))
    assert [one['hardware_id'] for one in found['findings']] == ['theta_4']
    assert 'times of receipt' in found['remarks'][0]
    assert 'not identical' in found['remarks'][0]


def test_anybodys_recording_will_do(tmp_path, capsys):
    """Another namespace, no metrics, no state, no joint commands, no diagnostics."""
    loop = stuck(namespace='/left/arm')
    bag = loop.write(tmp_path / 'run.mcap')
    assert result(capsys, 'detect', bag)['findings'] == loop.found
    assert loop.found[0]['hardware_id'] == 'left/arm/theta_4'
    bare = loop.write(tmp_path / 'bare' / 'run.mcap', without=(
        *UNNAMED, '/metrics', '/state', '/diagnostics'))
    code, _, errors = run(capsys, 'detect', bare)
    assert code == BAD_INPUT and '--mechanism' in errors and errors.count('\n') == 1
    found = result(capsys, 'detect', bare, '--mechanism', 'mirror_4_strut', '--namespace',
                   'left/arm', '--output', tmp_path / 'figures')
    assert [one['hardware_id'] for one in found['findings']] == ['left/arm/theta_4']
    assert (tmp_path / 'figures' / 'detection.png').exists()
    assert not (tmp_path / 'bare' / 'detection.png').exists()


def test_failures_from_before_the_recording_are_known_from_the_metrics(tmp_path):
    loop = RecordedLoop()
    loop.run(0.2)
    loop.report('position', 'theta_4')
    loop.break_silently('stuck theta_4')
    loop.run(0.1)
    loop.samples.clear()
    loop.run(1.2)
    again = replayed(recorded_inputs(loop.write(tmp_path / 'run.mcap')), loop.mechanism)
    assert again.course[-1].failures == ('position:theta_4',)
    assert not again.findings


def test_the_table_names_part_time_and_words(loop, tmp_path, capsys):
    bag = loop.write(tmp_path / 'run.mcap')
    code, output, errors = run(capsys, 'detect', bag)
    assert (code, errors) == (0, '')
    assert 'theta_4' in output and 'note: ' in output
    assert output.endswith(f'{tmp_path / "detection.png"}\n')
    code, output, _ = run(capsys, 'detect', bag, '--csv')
    lines = output.splitlines()
    assert lines[0].startswith('hardware_id,mode,candidates') and len(lines) == 1 + len(loop.found)


@pytest.mark.parametrize('arguments', [
    ('--namespace', 'elsewhere'), ('--pose', 'pose'), ('--mechanism', 'no_such'),
    ('--delay', '-1'), ('--detect', 'off'),
])
def test_bad_options_are_one_line(loop, tmp_path, capsys, arguments):
    code, output, errors = run(capsys, 'detect', loop.write(tmp_path / 'run.mcap'), *arguments)
    assert (code, output, errors.count('\n')) == (BAD_INPUT, '', 1)


def test_bad_recordings_are_one_line(loop, tmp_path, capsys):
    text = make('std_msgs/msg/String', data='x')
    no_bag = tmp_path / 'no.mcap'
    no_bag.write_bytes(b'nonsense')
    other = tmp_path / 'other' / 'run.mcap'
    write_bag(other, [sample('/joint_states', text, BEGIN)])
    cut = loop.write(tmp_path / 'cut' / 'run.mcap')
    cut.write_bytes(cut.read_bytes()[:-5000])
    idle = loop.write(tmp_path / 'idle' / 'run.mcap', without=('_commands', '/commands'))
    two = RecordedLoop(namespace='/two')
    two.run(0.02)
    two.samples += loop.samples
    for bag in (no_bag, other, cut, idle, tmp_path / 'none.mcap',
                two.write(tmp_path / 'two' / 'run.mcap')):
        code, output, errors = run(capsys, 'detect', bag)
        assert (code, output, errors.count('\n')) == (BAD_INPUT, '', 1), (bag, errors)


def test_unusable_messages_are_counted(tmp_path, capsys):
    loop = stuck(answers=False)
    for one in [*loop.samples]:
        if one.topic.endswith('joint_states'):
            broken = sample(one.topic, _without_names(one), one.time + 1)
            loop.samples.append(broken)
            break
    found = result(capsys, 'detect', loop.write(tmp_path / 'run.mcap'))
    assert '1 joint states or commands were of no use' in found['remarks']
    json.dumps(found)


def _without_names(one):
    message = STORE.deserialize_cdr(one.data, one.kind)
    message.name = []
    return message
