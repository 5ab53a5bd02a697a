# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""An operator's node: injects and repairs faults, clears failures, pauses the controller."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, inf, isfinite

from geometry_msgs.msg import Vector3Stamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool, Trigger

from fault_tolerance.analysis import topics
from fault_tolerance.nodes.messages import nanoseconds_from_msg

CONTROLLER, SIMULATOR = 'fault_tolerance', 'fsm'
"""The names of the nodes, where nobody has renamed them."""


class OperatorClient(Node):
    """Client of simulator and controller in a ``namespace``; follows the controller's state.

    The nodes are named ``controller`` and ``simulator``; as attributes these are the full names.
    """

    def __init__(
        self, namespace: str = '', controller: str = CONTROLLER, simulator: str = SIMULATOR
    ) -> None:
        super().__init__('operator', namespace=namespace)
        place = self.get_namespace().rstrip('/')
        self.controller, self.simulator = f'{place}/{controller}', f'{place}/{simulator}'
        self.state = self.answer = self.refusal = ''
        # Whether the last clear has released anything.
        self.released = False
        self._faults_by_name = AsyncParameterClient(self, simulator)
        self.active_failures = -1
        # The last pointing error, radians; infinite before there is one.
        self.error = inf
        # Stamp of the last joint state, seconds.
        self.now = 0.0
        self._faults = self.create_publisher(String, f'{simulator}/inject_fault', 10)
        self._clear = self.create_client(Trigger, f'{controller}/clear_failures')
        self._pause = self.create_client(SetBool, f'{controller}/pause')
        sensor = qos_profile_sensor_data
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._phases = self.create_publisher(String, topics.PHASE, latched)
        self.create_subscription(Vector3Stamped, topics.POINTING_ERROR, self._take_error, sensor)
        self.create_subscription(JointState, topics.JOINT_STATES, self._take_joint_state, sensor)
        state = topics.renamed(topics.STATE, controller)
        metrics = topics.renamed(topics.METRICS, controller)
        self.create_subscription(String, state, self._take_state, latched)
        self.create_subscription(
            Float64, f'{metrics}/active_failures', self._take_active_failures, 10
        )

    @property
    def ready(self) -> bool:
        """Whether all nodes publish and all services are available."""
        heard = self.state and isfinite(self.error) and self.now
        return bool(heard and self.simulator_listens and self.controller_listens)

    @property
    def simulator_listens(self) -> bool:
        """Whether a simulator subscribes to faults."""
        return bool(self._faults.get_subscription_count())

    @property
    def controller_listens(self) -> bool:
        """Whether the services of a controller are available."""
        return bool(self._clear.service_is_ready() and self._pause.service_is_ready())

    def inject(self, words: str) -> None:
        """Publish fault ``words``: ``[silent] MODE NAME``."""
        self._faults.publish(String(data=words))

    @property
    def is_recorded(self) -> bool:
        """Whether a recorder subscribes to the phases."""
        return bool(self._phases.get_subscription_count())

    def note(self, text: str) -> None:
        """Publish that a phase begins (``text`` from `note_as_text`) or ends (empty)."""
        self._phases.publish(String(data=text))

    def ask_parts(self, parts: list[str]) -> Callable[[], bool]:
        """Ask for the parts that can fail; the result returns whether ``parts`` holds them."""
        future = self._faults_by_name.list_parameters(['faults'], 2)

        def answered() -> bool:
            if future.done():
                names = future.result().result.names
                parts[:] = [name.partition('.')[2] for name in names]
            return bool(future.done())

        return answered

    def set_fault(self, name: str, words: str) -> Callable[[], bool]:
        """Set the fault of the part ``name`` to ``words``, ``[silent] MODE``, by a parameter.

        The result returns whether the simulator has responded; then `refusal` has the reason if
        it has rejected the words.
        """
        future = self._faults_by_name.set_parameters([Parameter(f'faults.{name}', value=words)])

        def answered() -> bool:
            if future.done():
                (result,) = future.result().results
                self.refusal = '' if result.successful else f'{words} {name}: {result.reason}'
            return bool(future.done())

        return answered

    def clear(self) -> Callable[[], bool]:
        """Call ``~/clear_failures``; the result returns whether the response has arrived."""
        future = self._clear.call_async(Trigger.Request())

        def answered() -> bool:
            if future.done():
                self.answer, self.released = future.result().message, future.result().success
            return bool(future.done())

        return answered

    def pause(self, paused: bool) -> Callable[[], bool]:
        """Call ``~/pause`` with ``paused``; the result returns whether it has responded."""
        return self._pause.call_async(SetBool.Request(data=paused)).done

    def _take_error(self, message: Vector3Stamped) -> None:
        self.error = hypot(message.vector.x, message.vector.y)

    def _take_active_failures(self, message: Float64) -> None:
        self.active_failures = int(message.data)

    def _take_state(self, message: String) -> None:
        self.state = message.data

    def _take_joint_state(self, message: JointState) -> None:
        self.now = nanoseconds_from_msg(message.header.stamp) * 1e-9
