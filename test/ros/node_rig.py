# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What the ROS tests stand on: nodes as real processes, and a probe that talks to them over DDS.

Nothing sleeps and hopes: the probe spins until a condition holds, and fails naming it if that
takes too long.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistStamped, Vector3Stamped
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

from fault_tolerance.nodes.spinning import make_executor

CALM = 50.0
"""Joint states a second where it does not matter how many there are; by default twice as many."""

PATIENCE = 30.0
"""Seconds; far beyond what anything takes, so that a busy machine is no failure."""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class NodeProcess:
    """One node in a process group of its own.

    Parameters
    ----------
    module : str
        ``controller``, ``fsm_simulator`` or ``pointing_reference``.
    log : Path
        Where its output goes.
    namespace : str
    words : str
        Further ROS arguments.
    parameters : values as on a command line, by name
    """

    def __init__(
        self, module: str, log: Path, namespace: str = '', *words: str, **parameters: object
    ) -> None:
        command = [sys.executable, '-m', f'fault_tolerance.nodes.{module}', '--ros-args']
        if namespace:
            command += ['-r', f'__ns:=/{namespace}']
        command += words
        for name, value in parameters.items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            command += ['-p', f'{name}:={text}']
        self._log = log
        with log.open('w') as output:
            self.process = subprocess.Popen(
                command, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
            )

    @property
    def output(self) -> str:
        """Everything it has printed so far."""
        return self._log.read_text()

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

    def signal(self, number: signal.Signals) -> float:
        """Send a signal, and return how long the process took to end."""
        begin = time.monotonic()
        os.killpg(self.process.pid, number)
        self.process.wait(PATIENCE)
        return time.monotonic() - begin

    def end(self) -> None:
        """End it whatever it does."""
        if self.alive:
            os.killpg(self.process.pid, signal.SIGINT)
            try:
                self.process.wait(5.0)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()


def starting(folder: Path) -> Iterator[Callable[..., NodeProcess]]:
    """Yield start(module, namespace='', **parameters) -> NodeProcess, and end all it started."""
    processes: list[NodeProcess] = []

    def started(
        module: str, namespace: str = '', *words: str, **parameters: object
    ) -> NodeProcess:
        log = folder / f'{len(processes)}_{module}.log'
        processes.append(NodeProcess(module, log, namespace, *words, **parameters))
        return processes[-1]

    yield started
    for process in reversed(processes):
        process.end()
    for process in processes:
        print(process.output)


class Probe:
    """Listens to the nodes of one namespace and talks to them."""

    def __init__(self, namespace: str = '') -> None:
        self.node = Node('probe', namespace=f'/{namespace}', enable_rosout=False)
        self._executor = make_executor()
        self._executor.add_node(self.node)
        self.states = self.heard(String, 'fault_tolerance/state', LATCHED)
        self.commands = self.heard(Float64MultiArray, 'velocity_controller/commands')
        self.metrics = self.heard(DiagnosticArray, 'fault_tolerance/metrics')

    def close(self) -> None:
        self._executor.remove_node(self.node)
        self._executor.shutdown()
        self.node.destroy_node()

    def heard(self, kind: type, topic: str, qos: QoSProfile | int = 10) -> list[Any]:
        """Return a list that messages of a topic are appended to."""
        messages: list[Any] = []
        self.node.create_subscription(kind, topic, messages.append, qos)
        return messages

    def joint_states(self) -> list[JointState]:
        """Return a list that joint states are appended to."""
        return self.heard(JointState, 'joint_states', qos_profile_sensor_data)

    def wait(self, condition: Callable[[], object], what: str, patience: float = PATIENCE) -> None:
        """Spin until ``condition`` holds."""
        deadline = time.monotonic() + patience
        while not condition():
            assert time.monotonic() < deadline, f'waited {patience:g} s in vain for {what}'
            self._executor.spin_once(timeout_sec=0.02)

    def spin(self, duration: float) -> None:
        """Spin for a while, to record what happens."""
        deadline = time.monotonic() + duration
        while time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.02)

    def listen(self, patience: float) -> None:
        """Spin until something happens, or ``patience`` seconds are over."""
        self._executor.spin_once(timeout_sec=patience)

    def spin_until(self, moment: float) -> None:
        """Spin until a moment of the monotonic clock, no longer."""
        while (left := moment - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def call(self, kind: type, service: str, request: Any) -> Any:
        """Return the answer of a service."""
        client = self.node.create_client(kind, service)
        try:
            self.wait(client.service_is_ready, service)
            future = client.call_async(request)
            repeat = time.monotonic() + 2.0

            def answered() -> bool:
                # A server that has not discovered its client yet drops the answer.
                nonlocal future, repeat
                if time.monotonic() > repeat:
                    future, repeat = client.call_async(request), repeat + 2.0
                return future.done()

            self.wait(answered, f'an answer of {service}')
            return future.result()
        finally:
            self.node.destroy_client(client)

    @property
    def state(self) -> str:
        return self.states[-1].data if self.states else ''

    @property
    def mechanism(self) -> dict[str, str]:
        """The values of the mechanism's status in the newest metrics."""
        return values_of(self.metrics[-1].status[0]) if self.metrics else {}

    def wait_for_state(self, *states: str) -> None:
        self.wait(lambda: self.state in states, f'{" or ".join(states)} (it is {self.state})')

    def clear(self) -> Trigger.Response:
        return self.call(Trigger, 'fault_tolerance/clear_failures', Trigger.Request())

    def pause(self, paused: bool) -> SetBool.Response:
        return self.call(SetBool, 'fault_tolerance/pause', SetBool.Request(data=paused))

    def set_parameter(self, node: str, name: str, value: str | float | bool) -> Any:
        """Return the result of setting a parameter."""
        wanted = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[wanted])
        return self.call(SetParameters, f'{node}/set_parameters', request).results[0]

    def parameter(self, node: str, name: str) -> str:
        """Return a string parameter."""
        request = GetParameters.Request(names=[name])
        return self.call(GetParameters, f'{node}/get_parameters', request).values[0].string_value


class LockstepClock:
    """Simulated time that takes its next step when the last one has been answered.

    Answered means: there are new messages, and then every node has answered a request, which
    it takes up after the messages it got before. So nobody is late, however busy the machine.

    Parameters
    ----------
    probe : Probe
    nodes : tuple of str
        Those that take part.
    answers : tuple of list
        What every step adds a message to, once all nodes run; the probe listens to them.
    period : float
        Seconds a step.
    """

    PATIENCE = 0.5
    """Seconds for an answer; sensor data may get lost, and time must go on."""

    def __init__(
        self,
        probe: Probe,
        nodes: tuple[str, ...],
        answers: tuple[list[Any], ...],
        period: float = 0.01,
    ) -> None:
        self._probe = probe
        self._clients = [
            probe.node.create_client(GetParameters, f'{name}/get_parameters') for name in nodes
        ]
        for client in self._clients:
            probe.wait(client.service_is_ready, client.srv_name)
        self._answers = answers
        self._period = round(1e9 * period)
        self._now = 0
        self._publisher = probe.node.create_publisher(Clock, '/clock', 10)

    def step(self) -> None:
        """Let one period pass."""
        self._now += self._period
        before = [len(messages) for messages in self._answers]
        self._publisher.publish(
            Clock(clock=Time(sec=self._now // 10**9, nanosec=self._now % 10**9))
        )
        self._listen_until(
            lambda: all(
                len(messages) > count
                for messages, count in zip(self._answers, before, strict=True)
            )
        )
        futures = [client.call_async(GetParameters.Request()) for client in self._clients]
        self._listen_until(lambda: all(future.done() for future in futures))

    def run(self, duration: float) -> None:
        """Let ``duration`` seconds pass."""
        for _ in range(round(1e9 * duration / self._period)):
            self.step()

    def run_until(self, condition: Callable[[], object], what: str) -> None:
        """Let time pass until ``condition`` holds."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f'waited {PATIENCE:g} s in vain for {what}'
            self.step()

    def close(self) -> None:
        self._probe.node.destroy_publisher(self._publisher)
        for client in self._clients:
            self._probe.node.destroy_client(client)

    def _listen_until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + self.PATIENCE
        while not condition() and time.monotonic() < deadline:
            self._probe.listen(0.02)


class Plant:
    """Plays drives and operator for a controller without a simulator."""

    def __init__(self, probe: Probe, names: list[str]) -> None:
        self._probe = probe
        self._names = names
        self.asked: tuple[float, float] | None = None
        node = probe.node
        self.joint_states = node.create_publisher(
            JointState, 'joint_states', qos_profile_sensor_data
        )
        self.velocities = node.create_publisher(
            TwistStamped, 'fault_tolerance/task_velocity', 10
        )
        self.diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', 10)

    def connect(self) -> None:
        """Wait until the controller listens and answers."""
        publishers = (self.joint_states, self.velocities, self.diagnostics)
        self._probe.wait(
            lambda: all(one.get_subscription_count() for one in publishers), 'a controller'
        )
        self.reach('nominal')

    def stamp(self) -> Any:
        return self._probe.node.get_clock().now().to_msg()

    def joint_state(self, positions: list[float] | None = None, **fields: Any) -> JointState:
        """Return a joint state, at home by default."""
        message = JointState(
            name=list(self._names),
            position=[0.0] * len(self._names) if positions is None else positions,
        )
        message.header.stamp = self.stamp()
        for name, value in fields.items():
            setattr(message, name, value)
        return message

    def ask(self, wx: float = 0.0, wy: float = 0.0, **linear: float) -> None:
        """Publish a task velocity."""
        message = TwistStamped()
        message.header.stamp = self.stamp()
        message.twist.angular.x, message.twist.angular.y = wx, wy
        for name, value in linear.items():
            setattr(message.twist.linear, name, value)
        self.velocities.publish(message)

    def report(
        self, mode: str, *names: str, level: bytes = DiagnosticStatus.ERROR, stamped: bool = True
    ) -> DiagnosticArray:
        """Publish a failure report as a drive would."""
        message = DiagnosticArray(
            status=[
                DiagnosticStatus(
                    name=f'drive: {name}',
                    hardware_id=name,
                    level=level,
                    values=[KeyValue(key='failure_mode', value=mode)],
                )
                for name in names
            ]
        )
        if stamped:
            message.header.stamp = self.stamp()
        self.diagnostics.publish(message)
        return message

    def step(self, message: JointState | None = None) -> list[float]:
        """Publish a joint state, with the velocity asked for, and return the command it brings.

        Joint states may get lost: they are repeated until one is answered.
        """
        before = len(self._probe.commands)
        repeat = 0.0

        def answered() -> bool:
            nonlocal repeat
            if len(self._probe.commands) == before and time.monotonic() > repeat:
                if self.asked is not None:
                    self.ask(*self.asked)
                again = message or self.joint_state()
                again.header.stamp = self.stamp()
                self.joint_states.publish(again)
                repeat = time.monotonic() + 0.1
            return len(self._probe.commands) > before

        self._probe.wait(answered, 'a command')
        return list(self._probe.commands[-1].data)

    def settle(self, wanted: list[float], message: JointState | None = None) -> None:
        """Step until the command is ``wanted``."""
        found: list[float] = []

        def settled() -> bool:
            found[:] = self.step(message)
            return all(abs(a - b) < 1e-6 for a, b in zip(found, wanted, strict=True))

        self._probe.wait(settled, f'the command {wanted}')

    def reach(self, state: str) -> None:
        """Step until the controller says that it is in this state.

        A command may answer a joint state from before, so without more of them it may never be.
        """

        def reached() -> bool:
            self.step()
            return self._probe.state == state

        self._probe.wait(reached, state)


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    """Return the values of a status as a dict."""
    return {pair.key: pair.value for pair in status.values}


def rms(errors: list[Vector3Stamped], period: float = 1.0) -> list[float]:
    """Return the root mean square of vectors over each whole period."""
    times = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in errors]
    sums: dict[int, list[float]] = {}
    for now, message in zip(times, errors, strict=True):
        vector = message.vector
        sums.setdefault(int((now - times[0]) / period), []).append(vector.x**2 + vector.y**2)
    whole = range(int((times[-1] - times[0]) / period))
    return [(sum(sums[k]) / len(sums[k])) ** 0.5 for k in whole if k in sums]
