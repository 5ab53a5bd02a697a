# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The operator of a demonstration: breaks and mends the simulated mirror, and takes notes."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy as np
from geometry_msgs.msg import Vector3Stamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool, Trigger

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.nodes.messages import nanoseconds_from_msg

METRICS = (
    'position_tolerance',
    'torque_tolerance',
    'hard_tolerance',
    'retained_manipulability',
    'condition_number',
    'recovery_time',
    'active_failures',
)
"""The controller's metrics that go into the summary."""


class Notes:
    """Samples with the time they were taken, seconds on the clock of the simulator."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._samples: list[list[float]] = []

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._times)

    @property
    def last(self) -> list[float]:
        """The newest one; empty if there is none."""
        return self._samples[-1] if self._samples else []

    def add(self, time: float, sample: list[float]) -> None:
        """Note a sample."""
        self._times.append(time)
        self._samples.append(sample)

    def since(self, start: float, end: float = np.inf) -> tuple[FloatArray, FloatArray]:
        """Return the times (k,) and samples (k, c) from ``start`` to before ``end``."""
        times = np.array(self._times)
        chosen = (times >= start) & (times < end)
        return times[chosen], np.array(self._samples)[chosen]


class Operator(Node):
    """Injects faults, clears them, and notes errors, references, forces, states and metrics."""

    def __init__(self) -> None:
        super().__init__('operator')
        self.errors, self.references, self.efforts = Notes(), Notes(), Notes()
        self.state = self.answer = self.refusal = ''
        self._faults_by_name = AsyncParameterClient(self, 'fsm')
        self.metrics: dict[str, float] = {}
        self._last = 0.0
        self._faults = self.create_publisher(String, 'fsm/inject_fault', 10)
        self._clear = self.create_client(Trigger, 'fault_tolerance/clear_failures')
        self._pause = self.create_client(SetBool, 'fault_tolerance/pause')
        sensor = qos_profile_sensor_data
        for topic, notes in (('error', self.errors), ('reference', self.references)):
            self.create_subscription(
                Vector3Stamped, f'pointing/{topic}', self._noted(notes), sensor
            )
        self.create_subscription(JointState, 'joint_states', self._take_joint_state, sensor)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, 'fault_tolerance/state', self._take_state, latched)
        for name in METRICS:
            self.create_subscription(
                Float64, f'fault_tolerance/metrics/{name}', self._taken(name), 10
            )

    @property
    def ready(self) -> bool:
        """Whether everything that is needed can be heard and reached."""
        return bool(
            self.state
            and len(self.errors)
            and len(self.efforts)
            and self.simulator_listens
            and self.controller_listens
        )

    @property
    def simulator_listens(self) -> bool:
        """Whether faults can be injected."""
        return bool(self._faults.get_subscription_count())

    @property
    def controller_listens(self) -> bool:
        """Whether failures can be cleared and motion paused."""
        return bool(self._clear.service_is_ready() and self._pause.service_is_ready())

    @property
    def now(self) -> float:
        """The time of the last force noted, seconds."""
        return self._last

    def inject(self, words: str) -> None:
        """Break or mend something."""
        self._faults.publish(String(data=words))

    def set_fault(self, name: str, words: str) -> Callable[[], bool]:
        """Break or mend one part; the result tells whether the simulator answered.

        A topic has no answer, a parameter has: what is refused stands in `refusal`.
        """
        parameter = Parameter(f'faults.{name}', value=words)
        future = self._faults_by_name.set_parameters([parameter])

        def answered() -> bool:
            if future.done():
                (result,) = future.result().results
                self.refusal = '' if result.successful else f'{words} {name}: {result.reason}'
            return bool(future.done())

        return answered

    def clear(self) -> Callable[[], bool]:
        """Ask the controller to release the failures; the result tells whether it answered."""
        future = self._clear.call_async(Trigger.Request())

        def answered() -> bool:
            if future.done():
                self.answer = future.result().message
            return bool(future.done())

        return answered

    def pause(self, paused: bool) -> Callable[[], bool]:
        """Ask the controller to hold, or to go on; the result tells whether it answered."""
        future = self._pause.call_async(SetBool.Request(data=paused))
        return lambda: bool(future.done())

    def _noted(self, notes: Notes) -> Callable[[Vector3Stamped], None]:
        def take(message: Vector3Stamped) -> None:
            time = nanoseconds_from_msg(message.header.stamp) * 1e-9
            notes.add(time, [message.vector.x, message.vector.y])

        return take

    def _taken(self, name: str) -> Callable[[Float64], None]:
        def take(message: Float64) -> None:
            self.metrics[name] = message.data

        return take

    def _take_state(self, message: String) -> None:
        self.state = message.data

    def _take_joint_state(self, message: JointState) -> None:
        self._last = nanoseconds_from_msg(message.header.stamp) * 1e-9
        self.efforts.add(self._last, message.effort.tolist())


class Deadline:
    """A time by which something must have happened, on the monotonic clock."""

    def __init__(self, patience: float) -> None:
        self._end = monotonic() + patience

    @property
    def passed(self) -> bool:
        """Whether it is over."""
        return monotonic() > self._end
