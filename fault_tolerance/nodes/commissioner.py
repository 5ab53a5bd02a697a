# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The node of a first motion: joint states in, commands out, and nobody else commanding."""

from __future__ import annotations

import os

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from fault_tolerance.analysis import topics
from fault_tolerance.commissioning.first_motion import LONGEST_GAP, FirstMotion
from fault_tolerance.commissioning.jogs import Sample
from fault_tolerance.control.failure_reports import ERROR, part_names, target_of
from fault_tolerance.control.joint_states import JointStateReader, unusable
from fault_tolerance.control.notices import clean
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.failure_modes import HEALTH_WORDS
from fault_tolerance.nodes.messages import FAILURE_MODE_KEY, array_to_msg, nanoseconds_from_msg
from fault_tolerance.nodes.timeline import TimeLine

_NEWEST = QoSProfile(depth=2, reliability=ReliabilityPolicy.BEST_EFFORT)
_ACKNOWLEDGEMENT_TIMEOUT = 0.5
_ZEROS = 3
_UNKNOWN = 'NODE_NAME_UNKNOWN'


class Commissioner(Node):
    """Listens to the joint states of ``mechanism`` in a ``namespace``; commands once it may.

    Nothing is published, and no publisher exists, before `begin`.
    """

    def __init__(self, mechanism: Mechanism, namespace: str = '') -> None:
        super().__init__(f'commission_{os.getpid()}', namespace=namespace, enable_rosout=False)
        self.mechanism = mechanism
        self.samples: list[Sample] = []
        self.seen: set[str] = set()
        self.complaint = self.trouble = ''
        self.motion: FirstMotion | None = None
        self._reader = JointStateReader(mechanism)
        self._timeline = TimeLine(self.get_clock())
        self._parts = part_names(mechanism)
        self._stamp = 0
        self._commands = None
        self._joint_states = self.create_subscription(
            JointState, topics.JOINT_STATES, self._on_joint_state, _NEWEST
        )
        self.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._on_diagnostics, 100)
        self.topic = self.resolve_topic_name(topics.COMMANDS)
        self.joint_state_topic = self._joint_states.topic_name

    def now(self) -> float:
        """Return the present, monotonic seconds."""
        return self._timeline.now()

    @property
    def rivals(self) -> list[str]:
        """The other nodes that publish commands."""
        found = [one.node_name for one in self.get_publishers_info_by_topic(self.topic)]
        # In another container a node may have the name of this one.
        if self._commands is not None and self.get_name() in found:
            found.remove(self.get_name())
        # A topic may be discovered before the name of its node.
        return sorted({'a node' if _UNKNOWN in one else one for one in found})

    @property
    def listeners(self) -> int:
        """How many nodes take commands."""
        return self.count_subscribers(self.topic)

    def begin(self) -> None:
        """Make the publisher of commands."""
        self._commands = self.create_publisher(Float64MultiArray, topics.COMMANDS, 10)

    @property
    def connected(self) -> bool:
        """Whether somebody receives the commands."""
        return self._commands is not None and self._commands.get_subscription_count() > 0

    def publish(self, rates: FloatArray) -> None:
        """Publish joint ``rates`` (N,), rad/s or m/s."""
        # The sum turns the -0.0 of a resting drive into 0.0.
        self._commands.publish(array_to_msg(self.mechanism.rates_from_readings(rates) + 0.0))

    def rest(self) -> None:
        """Publish zeros, and wait until they are acknowledged."""
        if self._commands is None:
            return
        for _ in range(_ZEROS):
            self.publish(np.zeros(len(self.mechanism.actuators)))
        self._commands.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGEMENT_TIMEOUT))

    def _on_joint_state(self, message: JointState) -> None:
        now = self.now()
        self.seen.update(message.name)
        if not set(self.mechanism.joint_state_names) <= set(message.name):
            return  # of another machine, or wrongly named
        values, notice = self._reader.readings(message.name, message.position)
        if values is not None:
            notice = unusable(self.mechanism, values, ())
        stamp = nanoseconds_from_msg(message.header.stamp)
        sent = self._timeline.monotonic(message.header.stamp)
        if values is None or notice:
            self.complaint = notice.text if notice else ''
        elif sent is not None and abs(now - sent) > LONGEST_GAP:
            self.complaint = f'joint states are {now - sent:.2f} s old by their stamps'
        elif stamp and stamp == self._stamp:
            self.complaint = 'joint states repeat their stamps'
        else:
            self._stamp = stamp
            self._accept(now, values)

    def _accept(self, now: float, values: FloatArray) -> None:
        if self.motion is None:
            self.samples.append(Sample(now, values))
        elif not self.motion.ended:
            self.publish(self.motion.reading(now, values))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        prefix = self.get_namespace().strip('/')
        for status in message.status:
            part = target_of(status.hardware_id, prefix, self._parts)
            if part is None:
                continue
            modes = [pair.value.strip().lower() for pair in status.values
                     if pair.key == FAILURE_MODE_KEY]
            broken = any(mode not in HEALTH_WORDS for mode in modes)
            if broken or int.from_bytes(status.level, 'little') == ERROR:
                text = clean(status.message or ', '.join(modes))
                self.trouble = f'{part} is reported to have failed: {text}'
                if self.motion is not None:
                    self.motion.stop(self.trouble)
