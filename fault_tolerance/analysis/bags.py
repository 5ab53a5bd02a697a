# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Recordings as files: MCAP as rosbag2 writes it, and any bag that rosbags can read."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from rosbags import rosbag2
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_typestore

from fault_tolerance.analysis import topics
from fault_tolerance.analysis.recorded_data import Message, Sample
from fault_tolerance.errors import FaultToleranceError

METADATA = 'metadata.yaml'


def write_bag(file: Path, samples: Iterable[Sample]) -> None:
    """Write ``samples`` to an MCAP ``file`` (*.mcap), and metadata.yaml beside it.

    The file opens by itself; the metadata make its folder a bag as well.
    """
    typestore = get_typestore(Stores.ROS2_JAZZY)
    file.parent.mkdir(parents=True, exist_ok=True)
    # The library makes a folder of its own for the two files.
    with TemporaryDirectory(dir=file.parent) as scratch:
        bag = Path(scratch) / file.stem
        # Version 9 of the metadata is Jazzy's.
        writer = rosbag2.Writer(bag, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
        zstd = rosbag2.CompressionFormat.ZSTD
        writer.set_compression(rosbag2.CompressionMode.STORAGE, zstd)
        connections = {}
        with writer:
            for topic, kind, time, data in sorted(samples, key=lambda one: one.time):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=typestore)
                writer.write(connections[topic], time, data)
        (bag / file.name).replace(file)
        (bag / METADATA).replace(file.parent / METADATA)


def read_samples(path: Path) -> Iterator[Sample]:
    """Yield all of the bag at ``path``: an MCAP or SQLite file, or a folder with metadata.yaml.

    FaultToleranceError if it cannot be read.
    """
    with _opened(path) as reader:
        for connection, time, data in reader.messages():
            yield Sample(connection.topic, connection.msgtype, time, bytes(data))


def read_messages(path: Path) -> Iterator[Message]:
    """Yield those messages of the bag at ``path`` that a `Recording` is made of.

    FaultToleranceError if it cannot be read.
    """
    yield from read_topics(path, [one for one in topics_in(path) if topics.is_read(one)])


def topics_in(path: Path) -> dict[str, str]:
    """Return the types of the topics in the bag at ``path`` by full name.

    FaultToleranceError if it cannot be read.
    """
    with _opened(path) as reader:
        return {one.topic: str(one.msgtype) for one in reader.connections}


def read_topics(path: Path, wanted: Container[str]) -> Iterator[Message]:
    """Yield the messages of the bag at ``path`` on the topics ``wanted``, by full name.

    FaultToleranceError if it cannot be read, or lacks the definition of their type.
    """
    with _opened(path) as reader:
        chosen = [one for one in reader.connections if one.topic in wanted]
        for one in chosen:
            if one.msgtype not in reader.typestore.fielddefs:
                # Bags of ROS 2 before Iron hold no definitions, and no other package is asked.
                raise FaultToleranceError(f'{path}: it has no definition of {one.msgtype}')
        for connection, time, data in reader.messages(connections=chosen) if chosen else ():
            yield Message(connection.topic, time, reader.deserialize(data, connection.msgtype))


@contextmanager
def _opened(path: Path) -> Iterator[AnyReader]:
    if not path.exists():
        raise FaultToleranceError(f'{path}: there is no such bag')
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            yield reader
    except (
        AnyReaderError, rosbag2.ReaderError, SerdeError, TypesysError, OSError, ValueError,
        AssertionError,
    ) as error:
        raise FaultToleranceError(f'{path}: not a bag that can be read ({error})') from None
