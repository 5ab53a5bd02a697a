# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A recording of the real nodes: detection finds in it what the live detection said."""

from __future__ import annotations

import json

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from node_rig import Probe, values_of
from std_msgs.msg import String
from std_srvs.srv import Trigger

from fault_tolerance.analysis.bags import write_bag
from fault_tolerance.analysis.topics import JOINT_COMMANDS
from fault_tolerance.cli import main
from fault_tolerance.detection.suspicion import DETECTION
from fault_tolerance.nodes.recorder import Recorder

NAMESPACE = 'replayed'


@pytest.fixture
def rig(ros):
    probe = Probe(NAMESPACE)
    yield probe
    probe.close()


def test_a_recording_gives_what_the_live_detection_said(start, rig, tmp_path, capsys):
    recorder = Recorder(rig.node)
    heard = rig.heard(DiagnosticArray, '/diagnostics', 100)
    faults = rig.node.create_publisher(String, 'fsm/inject_fault', 10)
    start('controller', NAMESPACE, mechanism='mirror_4_strut')
    topic = rig.node.resolve_topic_name(JOINT_COMMANDS)
    # From the first command on.
    rig.wait(lambda: rig.node.count_publishers(topic), 'the controller')
    start('pointing_reference', NAMESPACE, mechanism='mirror_4_strut')
    rig.wait(lambda: rig.node.count_publishers(rig.node.resolve_topic_name('pointing/reference')),
             'the reference')
    start('fsm_simulator', NAMESPACE, mechanism='mirror_4_strut')
    rig.wait_for_state('nominal')
    rig.wait(faults.get_subscription_count, 'the simulator')
    rig.wait(lambda: len(rig.commands) > 250, 'the encoders to be heard')
    probed = rig.call(Trigger, 'fault_tolerance/probe', Trigger.Request())
    assert probed.success, probed.message

    def said():
        return [status for message in heard for status in message.status
                if status.name == DETECTION]

    faults.publish(String(data='silent stuck theta_4'))
    rig.wait(lambda: len(said()) > 1, 'the finding')
    count = len(rig.commands)
    rig.wait(lambda: len(rig.commands) > count + 50, 'more')
    live = said()[-1]
    bag = tmp_path / 'bag' / 'run.mcap'
    write_bag(bag, recorder.samples)

    capsys.readouterr()
    assert main(['detect', str(bag), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    print(found)
    assert found['findings'] == [{'hardware_id': live.hardware_id, **values_of(live)}]
    assert found['findings'][0]['hardware_id'] == f'{NAMESPACE}/theta_4'
    assert found['probes'] == 1
    assert not any('not identical' in remark for remark in found['remarks'])
    assert (tmp_path / 'bag' / 'detection.png').exists()
