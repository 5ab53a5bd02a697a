# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""One node that asks over DDS and takes the time until the answer."""

from __future__ import annotations

import gc
import os
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic, perf_counter_ns
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from benchmark.processes import Processes
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.nodes.spinning import make_executor

START_PATIENCE = 30.0
DOMAIN = 95


class LostAnswer(Exception):
    """No answer came in time."""


class Prober:
    """Publishes, spins, and takes the time."""

    def __init__(self) -> None:
        self.node = Node('prober', enable_rosout=False)
        self._executor = make_executor()
        self._executor.add_node(self.node)

    def close(self) -> None:
        """Leave."""
        self._executor.remove_node(self.node)
        self.node.destroy_node()

    @property
    def executor_kind(self) -> str:
        """The name of the executor that everything here runs on."""
        return type(self._executor).__name__

    def wait(
        self, condition: Callable[[], object], what: str, patience: float = START_PATIENCE
    ) -> None:
        """Spin until ``condition`` holds."""
        deadline = monotonic() + patience
        while not condition():
            if monotonic() > deadline:
                raise LostAnswer(what)
            self._executor.spin_once(timeout_sec=0.02)

    def rest(self, duration: float) -> None:
        """Spin for a while."""
        deadline = monotonic() + duration
        while (left := deadline - monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def answer_time(
        self, publish: Callable[[], None], answered: Callable[[], bool], patience: float = 0.5
    ) -> float:
        """Return the microseconds from ``publish`` until ``answered``."""
        begin = perf_counter_ns()
        deadline = begin + int(patience * 1e9)
        publish()
        while not answered():
            if perf_counter_ns() > deadline:
                raise LostAnswer('an answer')
            self._executor.spin_once(timeout_sec=patience)
        return (perf_counter_ns() - begin) * 1e-3


class Mailbox:
    """The newest message of a topic, and how many there have been."""

    def __init__(self, node: Node, kind: type, topic: str, qos: QoSProfile | int = 10) -> None:
        self.count = 0
        self.last: Any = None
        self.subscription = node.create_subscription(kind, topic, self._take, qos)

    def _take(self, message: Any) -> None:
        self.count += 1
        self.last = message


@contextmanager
def probing(commands: dict[str, list[str]]) -> Iterator[tuple[Prober, Processes]]:
    """Run processes in a ROS domain of their own, and a prober beside them."""
    os.environ.setdefault('ROS_DOMAIN_ID', str(DOMAIN))
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    with Processes(commands) as processes:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        try:
            prober = Prober()
            gc.collect()
            gc.freeze()
            gc.disable()
            yield prober, processes
            prober.close()
        finally:
            gc.enable()
            gc.unfreeze()
            rclpy.try_shutdown()


def joint_state(node: Node, names: tuple[str, ...], values: FloatArray) -> JointState:
    """Return a joint state, stamped now."""
    message = JointState(name=list(names), position=array('d', values.tolist()))
    message.header.stamp = node.get_clock().now().to_msg()
    return message


def twist(node: Node, angular: tuple[float, float]) -> TwistStamped:
    """Return a task velocity, stamped now."""
    message = TwistStamped()
    message.header.stamp = node.get_clock().now().to_msg()
    message.twist.angular.x, message.twist.angular.y = angular
    return message


def report(node: Node, name: str, mode: str) -> DiagnosticArray:
    """Return a failure report as a drive sends it, stamped now."""
    status = DiagnosticStatus(
        name=f'drive: {name}',
        hardware_id=name,
        level=DiagnosticStatus.OK if mode == 'none' else DiagnosticStatus.ERROR,
        values=[KeyValue(key='failure_mode', value=mode)],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = node.get_clock().now().to_msg()
    return message
