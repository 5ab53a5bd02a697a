# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller's subscriptions to joint states and task velocities, checked and as arrays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState

from fault_tolerance.control.joint_states import JointStateReader
from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.nodes.cdr import (
    AFTER_STAMP,
    DOUBLE,
    ENCAPSULATION,
    STAMP,
    STAMPED,
    UNDECODABLE,
)
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.messages import twist_from_msg
from fault_tolerance.nodes.serialised_joint_states import (
    NO_LAYOUT,
    SerialisedJointState,
    decodable,
)
from fault_tolerance.nodes.spinning import Deferred
from fault_tolerance.nodes.timeline import TimeLine


class InputSubscriber:
    """Passes joint states and task velocities to a supervisor.

    Parameters
    ----------
    node : Node
    supervisor : Supervisor
    base_frame : str
        The only ``frame_id`` accepted in task velocities; an empty one is accepted too.
    timeline : TimeLine
    health : Health
        Counts and logs rejected messages.
    cycle : callable
        Called with the present (seconds) when a joint state was accepted.
    listen : callable
        Called with the message, after ``cycle``.
    deferred : Deferred
        Gets work that must not delay a command.
    """

    def __init__(
        self,
        node: Node,
        supervisor: Supervisor,
        base_frame: str,
        timeline: TimeLine,
        health: Health,
        cycle: Callable[[float], None],
        listen: Callable[[SerialisedJointState], None],
        deferred: Deferred,
    ) -> None:
        task = supervisor.mechanism.task
        self._node = node
        self._supervisor = supervisor
        settings = supervisor.settings
        self._joints = JointStateReader(supervisor.mechanism, settings.joint_state_timeout)
        self._rows = task.rows
        self._outside = np.setdiff1d(np.arange(6), task.rows)
        self._base_frame = base_frame
        self._timeline = timeline
        self._health = health
        self._cycle, self._listen = cycle, listen
        self._deferred = deferred
        # Keep the newest joint state while another one is processed; older ones are obsolete.
        self._joint_states = self._subscription(2)
        self._in_parts = False
        self._layout = NO_LAYOUT
        self._velocities = node.create_subscription(
            TwistStamped, '~/task_velocity', self.on_task_velocity, 10
        )

    def on_joint_state(self, raw: bytes) -> None:
        """Take a serialised joint state, ``raw``, and have a command follow it.

        Positions are in rad or m; joints that have failed may be absent or NaN.
        """
        now = self._timeline.now()
        try:
            layout = self._layout
            # What differs in padding only is decoded anew, that is all.
            if not (raw.startswith(ENCAPSULATION) and raw.startswith(layout.strings, AFTER_STAMP)):
                raw, layout = decodable(raw)
                self._layout = layout
            positions = np.frombuffer(raw, DOUBLE, layout.count, layout.positions_at)
            message = SerialisedJointState(
                *STAMP.unpack_from(raw, STAMPED), positions, raw, layout
            )
        except UNDECODABLE as error:
            text = f'a joint state that cannot be decoded: {error}'
            self._health.warn(Notice('undecodable', text))
            return
        failed = self._supervisor.output.failures.parts
        self._joints.timeout = self._supervisor.settings.joint_state_timeout
        values, notice = self._joints.readings(layout.names, positions, failed, now)
        if self._joints.in_parts and not self._in_parts:
            self._in_parts = True
            self._deferred.add(self._keep_all_parts)
        if values is not None:
            stamp = self._timeline.monotonic(message)
            notice = self._supervisor.joint_reading(values, now, stamp)
            if notice is None:
                self._cycle(now)
                self._listen(message)
            if stamp is None:
                self._warn_of_no_stamp('joint_state')
        self._health.warn(notice)

    def _subscription(self, depth: int) -> Subscription:
        qos = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        return self._node.create_subscription(
            JointState, 'joint_states', self.on_joint_state, qos, raw=True
        )

    def _keep_all_parts(self) -> None:
        """Keep a message of each joint while another one is processed."""
        self._node.destroy_subscription(self._joint_states)
        self._joint_states = self._subscription(2 * len(self._supervisor.mechanism.actuators))

    def on_task_velocity(self, message: TwistStamped) -> None:
        """Take a task velocity, the ``message``, rad/s and m/s.

        It is that of the platform's origin, in the axes of the base.
        """
        frame, twist = message.header.frame_id, twist_from_msg(message)
        if frame and frame != self._base_frame:
            text = f'task velocity in frame {clean(frame)!r}, not {self._base_frame!r}: ignored'
            self._health.warn(Notice('wrong_frame', text))
            return
        if not np.isfinite(twist).all():
            # A component outside the task that is not finite makes the whole message unusable.
            twist[self._rows] = np.nan
        elif twist[self._outside].any():
            text = 'task velocity has components outside the task: they are ignored'
            self._health.warn_once('outside_task', text)
        now, stamp = self._timeline.now(), self._timeline.monotonic(message.header.stamp)
        if stamp is None:
            self._warn_of_no_stamp('task_velocity')
        self._health.warn(self._supervisor.task_velocity(twist[self._rows], now, stamp))

    def missing_joint_states(self) -> str:
        """Return the text that no joint state has arrived, and on which topic."""
        topic = self._joint_states.topic_name
        count = self._node.count_publishers(topic)
        if self._joints.strangers and count:
            ours = ', '.join(self._supervisor.mechanism.joint_state_names)
            theirs = clean(', '.join(self._joints.strangers))
            return f'joint states on {topic} are of {theirs}, not of {ours}'
        return f'no joint state yet on {topic} ({count} publishers; any reliability will do)'

    def check_publishers(self) -> None:
        """Warn once if several nodes publish task velocities."""
        if self._node.count_publishers(self._velocities.topic_name) > 1:
            text = 'several nodes publish task velocities: the last one wins'
            self._health.warn_once('several_commanders', text)

    def _warn_of_no_stamp(self, what: str) -> None:
        text = f'{what} without a stamp: the time of receipt is used'
        self._health.warn_once(f'no_stamp_{what}', text)
