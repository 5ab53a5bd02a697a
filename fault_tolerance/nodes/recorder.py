# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Recording of topics as serialised messages, to be decoded after the run."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from functools import partial

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from fault_tolerance.analysis import topics
from fault_tolerance.analysis.recorded_data import Message, Sample
from fault_tolerance.nodes.message_types import message_type

# Deep enough for the messages that arrive while the screen is refreshed or a file is read.
_DEPTH = 200
_STREAM = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
_RELIABLE = QoSProfile(depth=_DEPTH)
_LATCHED = QoSProfile(depth=_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_PROFILES = {
    topics.JOINT_STATES: _STREAM,
    'fsm/mirror_pose': _STREAM,
    'fsm/mirror_velocity': _STREAM,
    topics.STATE: _LATCHED,
    topics.STATUS: _LATCHED,
    topics.PHASE: _LATCHED,
    topics.ROSOUT: _LATCHED,
}


class Recorder:
    """Records every message of the recorded topics with its time of receipt.

    Namespace and executor are those of ``node``.
    """

    def __init__(self, node: Node) -> None:
        self.samples: list[Sample] = []
        for name, kind in topics.RECORDED.items():
            take = partial(self._take, node.resolve_topic_name(name), kind)
            profile = _PROFILES.get(name, _RELIABLE)
            node.create_subscription(message_type(kind), name, take, profile, raw=True)

    def _take(self, topic: str, kind: str, data: bytes) -> None:
        self.samples.append(Sample(topic, kind, time.time_ns(), data))


def decoded(samples: Iterable[Sample]) -> Iterator[Message]:
    """Yield each of ``samples`` deserialised, except those of unknown topics."""
    for topic, kind, received, data in samples:
        if topics.is_read(topic):
            yield Message(topic, received, deserialize_message(data, message_type(kind)))
