# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as files: what is read back is what was written, by this project and by others."""

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

from fault_tolerance.analysis.bags import read_messages, read_samples, write_bag
from fault_tolerance.analysis.recorded_data import Sample
from fault_tolerance.analysis.topics import RECORDED
from fault_tolerance.errors import FaultToleranceError

STORE = get_typestore(Stores.ROS2_JAZZY)
BEGIN = 1_700_000_000_000_000_000


def vector(x, stamp=BEGIN):
    header = STORE.types['std_msgs/msg/Header'](
        stamp=STORE.types['builtin_interfaces/msg/Time'](
            sec=stamp // 10**9, nanosec=stamp % 10**9),
        frame_id='base_link')
    place = STORE.types['geometry_msgs/msg/Vector3'](x=x, y=-x, z=0.0)
    return STORE.types['geometry_msgs/msg/Vector3Stamped'](header=header, vector=place)


def rates(*values):
    layout = STORE.types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0)
    return STORE.types['std_msgs/msg/Float64MultiArray'](layout=layout, data=np.array(values))


def sample(topic, message, time):
    kind = message.__msgtype__
    return Sample(topic, kind, time, bytes(STORE.serialize_cdr(message, kind)))


@pytest.fixture
def samples():
    text = STORE.types['std_msgs/msg/String']
    # Not in order, as two robots are taken down one after the other.
    return [
        sample('/fault_tolerance/state', text(data='degraded: µ'), BEGIN + 20),
        sample('/velocity_controller/commands', rates(1e-300, -0.0, 4.5), BEGIN + 10),
        *(sample('/pointing/error', vector(1e-6 * n), BEGIN + n) for n in range(200)),
    ]


def test_what_is_read_back_is_what_was_written(tmp_path, samples):
    file = tmp_path / 'new' / 'run.mcap'
    write_bag(file, samples)
    in_time = sorted(samples, key=lambda one: one.time)
    assert list(read_samples(file)) == in_time
    # With its metadata, the folder is the same bag.
    assert list(read_samples(file.parent)) == in_time
    assert sorted(path.name for path in file.parent.iterdir()) == ['metadata.yaml', 'run.mcap']


def test_somebody_elses_reader_finds_the_same(tmp_path, samples):
    write_bag(tmp_path / 'run.mcap', samples)
    with (tmp_path / 'run.mcap').open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        found = [
            (channel.topic, schema.name, message.log_time, content)
            for schema, channel, message, content in reader.iter_decoded_messages()
        ]
        profile = reader.get_header().profile
    assert (profile, summary.statistics.message_count) == ('ros2', 202)
    assert {one.encoding for one in summary.schemas.values()} == {'ros2msg'}
    assert {one.message_encoding for one in summary.channels.values()} == {'cdr'}
    in_time = sorted(samples, key=lambda one: one.time)
    assert [one[:3] for one in found] == [(one.topic, one.kind, one.time) for one in in_time]
    by_topic = {topic: content for topic, _, _, content in found}
    assert by_topic['/fault_tolerance/state'].data == 'degraded: µ'
    assert list(by_topic['/velocity_controller/commands'].data) == [1e-300, -0.0, 4.5]
    assert by_topic['/pointing/error'].vector.x == pytest.approx(199e-6)
    assert by_topic['/pointing/error'].header.frame_id == 'base_link'


def test_the_metadata_are_those_of_rosbag2(tmp_path, samples):
    write_bag(tmp_path / 'run.mcap', samples)
    content = yaml.safe_load((tmp_path / 'metadata.yaml').read_text())
    found = content['rosbag2_bagfile_information']
    assert (found['version'], found['storage_identifier']) == (9, 'mcap')
    assert found['relative_file_paths'] == ['run.mcap']
    assert found['message_count'] == 202
    assert found['duration']['nanoseconds'] == 199
    topics = {one['topic_metadata']['name'] for one in found['topics_with_message_count']}
    assert topics == {'/fault_tolerance/state', '/velocity_controller/commands', '/pointing/error'}


def test_a_new_recording_takes_the_place_of_the_old_one(tmp_path, samples):
    write_bag(tmp_path / 'run.mcap', samples)
    write_bag(tmp_path / 'run.mcap', samples[:2])
    assert len(list(read_samples(tmp_path / 'run.mcap'))) == 2


@pytest.mark.parametrize(('name', 'kind'), RECORDED.items())
def test_every_recorded_type_is_known_to_the_library(name, kind):
    definition, _ = STORE.generate_msgdef(kind, ros_version=2)
    assert definition.strip(), name


def test_only_messages_of_interest_are_decoded(tmp_path, samples):
    text = STORE.types['std_msgs/msg/String'](data='strange')
    write_bag(tmp_path / 'run.mcap', [*samples, sample('/something/else', text, BEGIN)])
    found = list(read_messages(tmp_path / 'run.mcap'))
    assert len(found) == 202
    assert found[5].content.vector.x == pytest.approx(5e-6)


def test_what_is_no_bag_is_refused_in_a_line(tmp_path, samples):
    with pytest.raises(FaultToleranceError, match='there is no such bag'):
        list(read_messages(tmp_path / 'nothing.mcap'))
    for name, content in (('text.mcap', b'MCAP?'), ('picture.png', b'\x89PNG'), ('b.db3', b'x')):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FaultToleranceError, match=f'{name}: not a bag that can be read'):
            list(read_messages(tmp_path / name))
    with pytest.raises(FaultToleranceError, match='not a bag that can be read'):
        list(read_messages(tmp_path))
    write_bag(tmp_path / 'cut' / 'run.mcap', samples)
    whole = (tmp_path / 'cut' / 'run.mcap').read_bytes()
    (tmp_path / 'half.mcap').write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FaultToleranceError, match=r'half.mcap: not a bag that can be read'):
        list(read_messages(tmp_path / 'half.mcap'))
