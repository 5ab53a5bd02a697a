# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A recording of the real nodes: detection finds in it what the live detection said."""

from __future__ import annotations

import json
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from node_rig import Probe, values_of
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from fault_tolerance.analysis.bags import write_bag
from fault_tolerance.analysis.topics import JOINT_COMMANDS
from fault_tolerance.cli import main
from fault_tolerance.detection.suspicion import DETECTION
from fault_tolerance.nodes.recorder import Recorder

NAMESPACE, PLANT = 'replayed', 'replayed_plant'


@pytest.fixture
def rig(ros):
    probe = Probe(NAMESPACE)
    yield probe
    probe.close()


class Relay:
    """Passes messages on between simulator and controller, once both and the recorder listen.

    The middleware connects whoever has found each other: without it the controller would hear
    joint states that the recorder does not, and the other way round.
    """

    def __init__(self, rig: Probe) -> None:
        self._rig, self.open = rig, False
        self._publishers = [
            self._pass(JointState, PLANT, 'joint_states', NAMESPACE, 2),
            self._pass(TwistStamped, PLANT, 'fault_tolerance/task_velocity', NAMESPACE, 1),
            self._pass(Float64MultiArray, NAMESPACE, 'velocity_controller/commands', PLANT, 1),
        ]

    def connect(self) -> None:
        """Wait until everybody listens, and begin."""
        self._rig.wait(
            lambda: all(one.get_subscription_count() >= count
                        for one, count in self._publishers), 'everybody to listen')
        topic = self._rig.node.resolve_topic_name(JOINT_COMMANDS)
        seen = self._rig.heard(JointState, topic, 100)
        # A controller without joint states commands nothing: that its commands would be heard
        # shows only in how many publishers have been found.
        self._rig.wait(lambda: self._rig.node.count_publishers(topic), 'the joint commands')
        end = time.monotonic() + 1.0
        self._rig.wait(lambda: time.monotonic() > end, 'the rest')
        assert not seen
        self.open = True

    def _pass(self, kind, giver, name, taker, count):
        publisher = self._rig.node.create_publisher(kind, f'/{taker}/{name}', 100)

        def on_message(data):
            if self.open:
                publisher.publish(data)

        self._rig.node.create_subscription(
            kind, f'/{giver}/{name}', on_message, qos_profile_sensor_data, raw=True)
        return publisher, count


@pytest.mark.paced
def test_a_recording_gives_what_the_live_detection_said(start, rig, tmp_path, capsys):
    recorder = Recorder(rig.node)
    heard = rig.heard(DiagnosticArray, '/diagnostics', 100)
    faults = rig.node.create_publisher(String, f'/{PLANT}/fsm/inject_fault', 10)
    relay = Relay(rig)
    start('controller', NAMESPACE, mechanism='mirror_4_strut')
    start('pointing_reference', PLANT, mechanism='mirror_4_strut')
    start('fsm_simulator', PLANT, mechanism='mirror_4_strut')
    relay.connect()
    rig.wait_for_state('nominal')
    rig.wait(faults.get_subscription_count, 'the simulator')
    rig.wait(lambda: len(rig.commands) > 250, 'the encoders to be heard')
    for _ in range(5):
        probed = rig.call(Trigger, 'fault_tolerance/probe', Trigger.Request())
        if probed.message.startswith('no latent failure'):
            break  # a gap in the readings, of a stall of the host, ends it early
    assert probed.success, probed.message

    def said():
        return [status for message in heard for status in message.status
                if status.name == DETECTION]

    faults.publish(String(data='silent stuck theta_4'))
    rig.wait(lambda: len(said()) > 1, 'the finding')
    count = len(rig.commands)
    rig.wait(lambda: len(rig.commands) > count + 50, 'more')
    # Where nothing is done about one, others may follow.
    live = {status.hardware_id: values_of(status) for status in said()}
    bag = tmp_path / 'bag' / 'run.mcap'
    write_bag(bag, recorder.samples)

    capsys.readouterr()
    assert main(['detect', str(bag), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    print(found)
    assert {one.pop('hardware_id'): one for one in found['findings']} == live
    assert f'{NAMESPACE}/theta_4' in live
    assert found['probes'] == 1
    assert not any('not identical' in remark for remark in found['remarks'])
    assert (tmp_path / 'bag' / 'detection.png').exists()
