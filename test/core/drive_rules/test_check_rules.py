# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The command check-rules: what rules mean, and what they would have reported of a recording."""

import json
import re
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import yaml

from fault_tolerance.cli import main
from fault_tolerance.drive_rules.rule_files import shipped_rules

pytest.importorskip('rosbags')
from rosbags import rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

CONFIG = Path(__file__).parents[3] / 'config'
DYNAMIC, INTERFACE = 'control_msgs/msg/DynamicJointState', 'control_msgs/msg/InterfaceValue'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """A recording of a start, a fault of theta_3 after 2 s, and its reset after 5 s."""
    store = get_typestore(Stores.ROS2_JAZZY)
    definitions = {INTERFACE: 'string[] interface_names\nfloat64[] values\n',
                   DYNAMIC: 'std_msgs/Header header\nstring[] joint_names\n'
                            'control_msgs/InterfaceValue[] interface_values\n'}
    for name, text in definitions.items():
        store.register(get_types_from_msg(text, name))
    types = store.types
    stamp = types['builtin_interfaces/msg/Time'](sec=0, nanosec=0)
    header = types['std_msgs/msg/Header'](stamp=stamp, frame_id='')
    folder = tmp_path_factory.mktemp('bags') / 'machine'
    with rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        topic = writer.add_connection('/left/dynamic_joint_states', DYNAMIC, typestore=store)
        for second, word in enumerate([0x40, 0x237, 0x218, 0x218, 0x240, 0x237, 0x237]):
            words = {f'theta_{number}': 0x237 for number in (4, 1, 2)} | {'theta_3': word}
            values = [types[INTERFACE](interface_names=['position', 'status_word'],
                                       values=np.array([0.0, one])) for one in words.values()]
            message = types[DYNAMIC](header=header, joint_names=list(words),
                                     interface_values=values)
            writer.write(topic, (1000 + second) * 10**9, store.serialize_cdr(message, DYNAMIC))
    return folder


def asked(capsys, *arguments):
    assert main(['check-rules', *map(str, arguments), '--json']) == 0
    return json.loads(capsys.readouterr().out)


def test_a_recording_of_types_that_are_not_installed(bag, capsys):
    report = asked(capsys, 'cia402', '--mechanism', 'mirror_4_strut', '--bag', bag,
                   '--namespace', 'left')
    assert (report['messages'], report['begin'], report['remarks']) == (7, 1000.0, [])
    assert [(one['time'], one['actuator'], one['mode'], one['message'])
            for one in report['events']] == [
        (2.0, 'theta_3', 'torque', 'fault: 536 (0x218)'), (5.0, 'theta_3', 'none', 'well')]


def test_a_recording_without_the_topic(bag, capsys):
    report = asked(capsys, 'cia402', '--mechanism', 'mirror_4_strut', '--bag', bag)
    assert report['events'] == []
    assert report['remarks'][0] == '/dynamic_joint_states is not in it'


def test_a_recording_whose_topic_is_of_another_type(bag, capsys, tmp_path):
    rules = tmp_path / 'mine.yaml'
    rules.write_text(
        'rules: [{name: a, topic: dynamic_joint_states, type: std_msgs/msg/Int32, field: data,\n'
        '         cases: [{is: 0, says: well}], otherwise: worse}]\n')
    report = asked(capsys, rules, '--mechanism', 'mirror_4_strut', '--bag', bag,
                   '--namespace', '/left/')
    assert (report['messages'], report['remarks']) == (0, [
        f'/left/dynamic_joint_states is of type {DYNAMIC} in it, not std_msgs/msg/Int32'])


def test_a_recording_without_definitions_of_its_types(tmp_path, capsys):
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg('int32 state', 'vendors_msgs/msg/Drive'))
    folder = tmp_path / 'old'
    with rosbag2.Writer(folder, version=9) as writer:
        topic = writer.add_connection('/drive', 'vendors_msgs/msg/Drive', typestore=store)
        message = store.types['vendors_msgs/msg/Drive'](state=1)
        writer.write(topic, 0, store.serialize_cdr(message, 'vendors_msgs/msg/Drive'))
    database, = folder.glob('*.db3')
    with sqlite3.connect(database) as connection:
        connection.execute('delete from message_definitions')
    rules = tmp_path / 'mine.yaml'
    rules.write_text(
        'rules: [{name: a, topic: drive, type: vendors_msgs/msg/Drive, field: state,\n'
        '         cases: [{is: 0, says: well}], otherwise: worse}]\n')
    options = [str(rules), '--mechanism', 'fsm_4_strut', '--bag', str(folder)]
    assert main(['check-rules', *options]) == 2
    assert capsys.readouterr().err == (
        f'fault_tolerance: {folder}: it has no definition of vendors_msgs/msg/Drive\n')


def test_a_wrong_name_is_noticed(bag, capsys, tmp_path):
    text = (CONFIG / 'rules' / 'cia402.yaml').read_text()
    rules = tmp_path / 'mine.yaml'
    rules.write_text(text.replace('"{joint}"', '{theta_1: theta_1, theta_2: axis_2}'))
    report = asked(capsys, rules, '--mechanism', 'mirror_4_strut', '--bag', bag,
                   '--namespace', 'left')
    assert report['unwatched'] == ['theta_3', 'theta_4']
    assert report['remarks'] == [
        'dynamic_joint_states says nothing of theta_2: check the drive names in the rule file']


def test_as_text_and_as_csv(bag, capsys):
    options = ['check-rules', 'cia402', '--mechanism', 'mirror_4_strut', '--bag', str(bag),
               '--namespace', 'left']
    assert main(options) == 0
    text = capsys.readouterr().out
    assert '2 changes in 7 messages' in text
    assert re.search(r'status word +theta_3 +torque +fault: 536 \(0x218\) +2\.000', text)
    assert main([*options, '--csv']) == 0
    assert capsys.readouterr().out.splitlines() == [
        'time,rule,actuator,mode,message',
        '2.0,status word,theta_3,torque,fault: 536 (0x218)',
        '5.0,status word,theta_3,none,well']


@pytest.mark.parametrize('name', shipped_rules())
def test_shipped_rules_without_and_with_a_mechanism(name, capsys):
    alone = asked(capsys, name)
    assert alone['mechanism'] is None
    report = asked(capsys, name, '--mechanism', 'gough_stewart_6')
    for rule in report['rules']:
        assert list(rule['drives']) == [f'leg_{number}' for number in range(1, 7)]
        assert all(case['meaning'] for case in rule['cases'])
    assert set(report['worse'].values()) <= {'position', 'torque'}


@pytest.mark.parametrize(('arguments', 'message'), [
    (['nope'], 'nope: is neither a file nor shipped rules'),
    (['cia402', '--mechanism', 'nope'], 'nope: is neither a file nor a shipped mechanism'),
    (['cia402', '--bag', 'x.mcap'], 'a bag needs the drives it is about: --mechanism M'),
    (['cia402', '--bag', 'x.mcap', '--mechanism', 'mirror_4_strut'], 'x.mcap: there is no such'),
])
def test_bad_input_is_one_line(arguments, message, capsys):
    assert main(['check-rules', *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == '' and printed.err.count('\n') == 1
    assert printed.err.startswith(f'fault_tolerance: {message}')


def test_analyzers_know_what_this_package_says():
    """Keys as diagnostic_aggregator reads them; each status of each node in one place."""
    content = yaml.safe_load((CONFIG / 'diagnostic_aggregator' / 'analyzers.yaml').read_text())
    group = content['analyzers']['ros__parameters']['fault_tolerance']
    keys = {'type', 'path', 'startswith', 'regex', 'remove_prefix', 'timeout', 'discard_stale'}

    def places(name):
        found = []
        for one in group['analyzers'].values():
            assert set(one) <= keys
            assert one['type'] == 'diagnostic_aggregator/GenericAnalyzer'
            # std::regex_match demands all of the name, and a timeout has to be a double.
            if name.startswith(tuple(one.get('startswith', ['\n']))) or any(
                    re.fullmatch(each, name) for each in one.get('regex', [])):
                found.append(one['path'])
            assert isinstance(one['timeout'], float)
        return found

    assert group['type'] == 'diagnostic_aggregator/AnalyzerGroup'
    for name, place in (
        ('fault_tolerance: controller', 'Nodes'), ('drive_reports: rules', 'Nodes'),
        ('fsm: simulator', 'Nodes'), ('pointing: reference', 'Nodes'),
        ('fault_tolerance: detection', 'Not reported'), ('fsm: theta_4', 'Drives'),
        ('drive_reports: theta_4 (status word)', 'Drives'),
        ('robots/left/drive_reports: theta_4 (status word)', 'Drives'),
        ('robots/left/drive_reports: rules', 'Nodes'),
        ('left/fault_tolerance: controller', 'Nodes'),
    ):
        assert places(name) == [place]
