# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Where the controller believes the platform to be, from its own loop closure."""

from __future__ import annotations

from time import monotonic

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TransformStamped
from rclpy.node import Node

from fault_tolerance.analysis.scene import scene_of
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.kinematics.failures import FailureMode
from fault_tolerance.mechanism.configuration import Configuration, home_configuration
from fault_tolerance.nodes.markers import MarkerPublisher, View
from fault_tolerance.nodes.messages import pose_to_msg, transform_from_msg
from fault_tolerance.nodes.serialised_joint_states import SerialisedJointState
from fault_tolerance.nodes.spinning import Deferred

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # comes with ROS 2, not with the wheels
    TFMessage = None

PERIOD = 0.004
"""Seconds between two poses at least."""


class BeliefPublisher:
    """Publishes ``~/platform_pose`` and ``~/markers`` in the frame ``frame``, to subscribers.

    Where tf2_msgs is installed, ``/tf`` has the same pose, of a frame named as the mechanism.

    ``deferred`` gets the work: a command does not wait for it. Motions are drawn ``exaggeration``
    times as large; of a mechanism given by its Jacobian nothing can be drawn.
    """

    def __init__(
        self, node: Node, supervisor: Supervisor, frame: str, exaggeration: float,
        deferred: Deferred,
    ) -> None:
        self._supervisor = supervisor
        self._deferred = deferred
        self._frame = frame
        self._clock = node.get_clock()
        self._due = 0.0
        self._stamp, self._estimate = Time(), supervisor.output.estimate
        self._poses = node.create_publisher(PoseStamped, '~/platform_pose', 10)
        self._transforms = TFMessage and node.create_publisher(TFMessage, '/tf', 100)
        mechanism = supervisor.mechanism
        # One tree for all robots: frames carry the namespace.
        self._child = f'{node.get_namespace()}/{mechanism.name}'.lstrip('/')
        self._markers = MarkerPublisher(
            node, mechanism, self._view, self._seen(home_configuration(mechanism)), frame,
            exaggeration, with_target=False,
        ) if mechanism.struts else None

    def observe(self, message: SerialisedJointState) -> None:
        """Have the pose that goes with a joint state, the ``message``, published after all."""
        now = monotonic()
        if now < self._due:
            return
        drawn = self._markers is not None and self._markers.subscribed
        if drawn or self._transforms or self._poses.get_subscription_count():
            # Not from now on: of joint states that come once in a period half would be left out.
            self._due = max(self._due + PERIOD, now)
            stamped = Time(sec=message.sec, nanosec=message.nanosec)
            self._stamp = stamped if message.sec or message.nanosec else self._clock.now().to_msg()
            self._estimate = self._supervisor.output.estimate
            self._deferred.add(self._publish)

    def _publish(self) -> None:
        estimate = self._estimate
        # Where the loops do not close, the pose is that of an earlier joint state.
        if not estimate.located or estimate.hold_reason:
            return
        if self._transforms or self._poses.get_subscription_count():
            message = pose_to_msg(self._stamp, self._frame, estimate.pose)
            self._poses.publish(message)
            if self._transforms:
                found: TransformStamped = transform_from_msg(message, self._child)
                self._transforms.publish(TFMessage(transforms=[found]))
        if self._markers is not None:
            self._markers.show(self._stamp)

    def _view(self) -> View:
        return self._seen(self._estimate.configuration)

    def _seen(self, configuration: Configuration) -> View:
        mechanism, failures = self._supervisor.mechanism, self._supervisor.failures
        faults = {}
        for name in mechanism.actuator_names:
            mode = failures.mode_of(mechanism, name)
            faults[name] = () if mode is FailureMode.NONE else (mode.value,)
        points = [
            np.array([joint.place for joint in strut.joints])
            for strut in scene_of(configuration).struts
        ]
        return View(configuration.pose, points, faults)
