# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The command goes out before anything is told of it, and deferred work gives way to messages."""

from __future__ import annotations

import os
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from fault_tolerance.control.state_machine import State
from fault_tolerance.detection.monitor import Monitor
from fault_tolerance.nodes.command_publisher import CommandPublisher
from fault_tolerance.nodes.controller import LATE, Controller
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.kernel_startup import KernelStartup
from fault_tolerance.nodes.metrics_publisher import MetricsPublisher
from fault_tolerance.nodes.scheduling import set_realtime_priority
from fault_tolerance.nodes.spinning import Deferred, turn
from fault_tolerance.nodes.status_publisher import StatusPublisher


@pytest.fixture
def told(monkeypatch):
    """Return a list that everything the controller publishes is noted in."""
    told: list[str] = []

    def recorded(kind, name, what):
        original = getattr(kind, name)

        def record(self, *args, **kwargs):
            if not args or args[0] is not None:
                told.append(what)
            return original(self, *args, **kwargs)

        monkeypatch.setattr(kind, name, record)

    recorded(CommandPublisher, 'publish', 'command')
    recorded(StatusPublisher, '_publish_change', 'state')
    recorded(Health, 'warn', 'warning')
    monkeypatch.setattr(MetricsPublisher, 'subscribed', True)
    monkeypatch.setattr(MetricsPublisher, 'publish', lambda *_: told.append('metrics'))
    return told


@pytest.fixture
def node(ros, told):
    node = Controller(KernelStartup())
    yield node
    node.destroy_node()


def joint_state(node: Controller) -> bytes:
    names = [f'theta_{number}' for number in range(1, 5)]
    message = JointState(name=names, position=[0.0] * 4)
    message.header.stamp = node.get_clock().now().to_msg()
    return serialize_message(message)


def report(node: Controller) -> bytes:
    """Return a failure report whose level is worth a warning."""
    status = DiagnosticStatus(
        name='drive', hardware_id='theta_4', level=DiagnosticStatus.OK,
        values=[KeyValue(key='failure_mode', value='position')],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = node.get_clock().now().to_msg()
    return serialize_message(message)


def rested(node: Controller) -> None:
    """Run all deferred work."""
    while node.deferred:
        node.deferred.run_next()


def test_a_command_goes_out_before_anything_else_is_published(node, told):
    velocity = TwistStamped()
    velocity.header.stamp = node.get_clock().now().to_msg()
    velocity.twist.angular.x = 0.01
    node._inputs.on_task_velocity(velocity)
    node._inputs.on_joint_state(joint_state(node))
    rested(node)
    told.clear()
    node._reports.on_diagnostics(report(node))
    assert told == ['command', 'warning']
    rested(node)
    assert told == ['command', 'warning', 'state', 'metrics']
    # With joint states the same: nothing but the command.
    told.clear()
    node._inputs.on_joint_state(joint_state(node))
    assert told == ['command']


def test_the_processor_is_yielded_between_the_command_and_all_else(node, told, monkeypatch):
    """The subscriber may be waiting for this very processor."""
    monkeypatch.setattr(os, 'sched_yield', lambda: told.append('yield'))
    node._inputs.on_joint_state(joint_state(node))
    told.clear()
    node._reports.on_diagnostics(report(node))
    node._inputs.on_joint_state(joint_state(node))
    assert told == ['command', 'yield', 'warning', 'command', 'yield']


def test_metrics_come_five_times_a_second_whatever_the_rate_of_joint_states(
    node, told, monkeypatch
):
    rested(node)
    told.clear()
    start = node._status._metrics_due
    for count in range(2000):
        node._status.update(node._supervisor.output, start + 1e-3 * count)
        rested(node)
    assert told == ['metrics'] * 10


def test_what_can_be_told_apart_is_derived_for_subscribers_only(node, monkeypatch):
    """After a change of failures that takes milliseconds: it has a piece of its own."""
    derived = []
    monkeypatch.setattr(Monitor, 'values', lambda *_: derived.append(len(derived)) or {})
    for subscribed in (False, True):
        monkeypatch.setattr(MetricsPublisher, 'subscribed', subscribed)
        node._inputs.on_joint_state(joint_state(node))
        node._reports.on_diagnostics(report(node))
        node._status.update(node._supervisor.output, node._status._metrics_due)
        rested(node)
        assert bool(derived) is subscribed


@pytest.mark.timed
def test_a_watchdog_that_was_late_lets_what_has_arrived_be_read_first(node):
    node._inputs.on_joint_state(joint_state(node))
    node._on_watchdog()
    assert node._supervisor.output.state is State.NOMINAL
    time.sleep(2 * node._supervisor.settings.joint_state_timeout)
    node._on_watchdog()
    assert node._supervisor.output.state is State.NOMINAL
    # Nothing had arrived; and late again is no excuse.
    time.sleep(2 * LATE)
    node._on_watchdog()
    assert node._supervisor.output.state is State.HOLD


def test_deferred_work_is_done_once_in_order_and_one_piece_a_turn(node):
    class Executor:
        def spin_once(self, timeout_sec):
            done.append('message')
            if len(done) == 1:
                node.deferred.add(first)

    def first():
        done.append('first')

    def fail():
        done.append('fail')
        raise ArithmeticError('no')

    done, node.deferred = [], Deferred()
    for work in (fail, first, fail):
        node.deferred.add(work)
    for _ in range(3):
        turn(Executor(), node)
    # What fails is logged and not repeated.
    assert done == ['message', 'fail', 'message', 'first', 'message']
    assert not node.deferred


def test_real_time_scheduling_is_granted_or_refused_with_a_reason(monkeypatch):
    assert set_realtime_priority(0) is None

    def refuse(*_):
        raise PermissionError(1, 'Operation not permitted')

    monkeypatch.setattr(os, 'sched_setscheduler', refuse)
    assert set_realtime_priority(50).text == (
        'no real-time scheduling (priority 50): [Errno 1] Operation not permitted'
    )
