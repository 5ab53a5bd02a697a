# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The recorder: what is published is found in the file, bit by bit, and as others decode it."""

from __future__ import annotations

from array import array

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Vector3Stamped
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from node_rig import LATCHED, Probe
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from visualization_msgs.msg import Marker, MarkerArray

from fault_tolerance.analysis.bags import read_samples, write_bag
from fault_tolerance.analysis.topics import RECORDED, split
from fault_tolerance.nodes.message_types import message_type
from fault_tolerance.nodes.recorder import Recorder, decoded

NAMESPACE = 'robot'
COUNT = 5


def messages(topic):
    """Return messages that use what their type has."""
    kind = message_type(RECORDED[topic])
    if kind is JointState:
        return [JointState(name=['theta_1', 'µ'], position=array('d', [n, -1e-300]),
                           effort=array('d', [float('nan')])) for n in range(COUNT)]
    if kind is Float64MultiArray:
        return [Float64MultiArray(data=array('d', n * [0.1])) for n in range(COUNT)]
    if kind is String:
        return [String(data=n * 'µ') for n in range(COUNT)]
    if kind is DiagnosticArray:
        status = DiagnosticStatus(level=DiagnosticStatus.STALE, name='drive: theta_1', values=[
            KeyValue(key='failure_mode', value='none')])
        return [DiagnosticArray(status=n * [status]) for n in range(COUNT)]
    if kind is MarkerArray:
        return [MarkerArray(markers=n * [Marker(ns='strut_1', id=n)]) for n in range(COUNT)]
    if kind is Vector3Stamped:
        found = [Vector3Stamped() for _ in range(COUNT)]
        for n, one in enumerate(found):
            one.header.stamp.nanosec, one.vector.x = n, 1e-6 * n
        return found
    return [kind() for _ in range(COUNT)]


@pytest.fixture
def taken(ros):
    """A recorder that has taken down five messages of everything, and what was published."""
    probe = Probe()
    node = Node('recorder', namespace=f'/{NAMESPACE}', enable_rosout=False)
    probe._executor.add_node(node)
    recorder = Recorder(node)
    published = {}
    for topic, kind in RECORDED.items():
        sensor = topic in ('joint_states', 'fsm/mirror_pose', 'fsm/mirror_velocity')
        profile = qos_profile_sensor_data if sensor else QoSProfile(depth=10)
        if topic in ('fault_tolerance/state', 'fault_tolerance/status', 'operator/phase',
                     '/rosout'):
            profile = LATCHED
        publisher = node.create_publisher(message_type(kind), topic, profile)
        probe.wait(publisher.get_subscription_count, topic)
        name = node.resolve_topic_name(topic)
        # As bytes: of what lies between fields every serialization makes something else.
        published[name] = [serialize_message(one) for one in messages(topic)]
        for number, data in enumerate(published[name], 1):
            publisher.publish(data)
            probe.wait(
                lambda name=name, number=number:
                    sum(one.topic == name for one in recorder.samples) >= number,
                f'{name} to be taken down')
    yield recorder.samples, published
    probe._executor.remove_node(node)
    node.destroy_node()
    probe.close()


def test_everything_published_is_in_the_file(taken, tmp_path):
    samples, published = taken
    file = tmp_path / 'run.mcap'
    write_bag(file, samples)

    # Bit by bit.
    found = {}
    for topic, kind, _, data in read_samples(file):
        found.setdefault(topic, []).append((kind, data))
    assert '/robot/joint_states' in found and '/diagnostics' in found
    kinds = {name.removeprefix('/robot/'): kind for name, ((kind, _), *_) in found.items()}
    assert kinds == RECORDED
    for topic, sent in published.items():
        assert [data for _, data in found[topic]] == sent, topic

    # As somebody else decodes it, from the definitions in the file alone.
    with file.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        theirs = {}
        for _, channel, message, content in reader.iter_decoded_messages():
            assert message.log_time > 1_700_000_000 * 10**9
            theirs.setdefault(channel.topic, []).append(content)
    states = theirs['/robot/fault_tolerance/state']
    assert [one.data for one in states] == [n * 'µ' for n in range(COUNT)]
    joints = theirs['/robot/joint_states'][3]
    assert (list(joints.name), list(joints.position)) == (['theta_1', 'µ'], [3.0, -1e-300])
    status = theirs['/diagnostics'][2].status[1]
    assert (status.level, status.values[0].key) == (3, 'failure_mode')
    assert theirs['/robot/fsm/markers'][4].markers[3].ns == 'strut_1'
    errors = theirs['/robot/pointing/error']
    assert [one.vector.x for one in errors] == [1e-6 * n for n in range(COUNT)]

    # And as this process does.
    heard = list(decoded(samples))
    assert all(
        one.topic == '/diagnostics' or split(one.topic)[0] == '/robot' for one in heard
    )
    commands = [one.content for one in heard if one.topic.endswith('/commands')]
    assert commands == messages('velocity_controller/commands')
