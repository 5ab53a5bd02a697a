# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The command goes out before anything is told of it, and idle work gives way to messages."""

from __future__ import annotations

import os
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from fault_tolerance.control.recovery import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.nodes.commanding import CommandPublisher
from fault_tolerance.nodes.controller import LATE, Controller
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.idle import SHARE, IdleTime, Job
from fault_tolerance.nodes.publishing import MetricsPublisher
from fault_tolerance.nodes.scheduling import scheduled_real_time


@pytest.fixture
def told(monkeypatch):
    """Return a list that everything the controller says is noted in."""
    told: list[str] = []

    def recorded(kind, name, what):
        original = getattr(kind, name)

        def record(self, *args, **kwargs):
            if not args or args[0] is not None:
                told.append(what)
            return original(self, *args, **kwargs)

        monkeypatch.setattr(kind, name, record)

    recorded(CommandPublisher, 'send', 'command')
    recorded(MetricsPublisher, 'publish_state', 'state')
    recorded(Health, 'remark', 'warning')
    monkeypatch.setattr(MetricsPublisher, 'heard', True)
    monkeypatch.setattr(
        MetricsPublisher, 'publishing', lambda *_: told.append('metrics') or iter(())
    )
    return told


@pytest.fixture
def node(ros, told):
    node = Controller()
    yield node
    node.destroy_node()


def joint_state(node: Controller) -> JointState:
    names = [f'theta_{number}' for number in range(1, 5)]
    message = JointState(name=names, position=[0.0] * 4)
    message.header.stamp = node.get_clock().now().to_msg()
    return message


def report(node: Controller) -> bytes:
    """Return a failure report with a level that is remarked on."""
    status = DiagnosticStatus(
        name='drive', hardware_id='theta_4', level=DiagnosticStatus.OK,
        values=[KeyValue(key='failure_mode', value='position')],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = node.get_clock().now().to_msg()
    return serialize_message(message)


def rested(node: Controller) -> None:
    """Do what is due in idle time."""
    for _ in range(100):
        job = node.idle.next_job()
        if job is None:
            return
        job.do()


def test_a_command_goes_out_before_anything_is_told(node, told):
    velocity = TwistStamped()
    velocity.header.stamp = node.get_clock().now().to_msg()
    velocity.twist.angular.x = 0.01
    node._on_task_velocity(velocity)
    node._on_joint_state(joint_state(node))
    rested(node)
    told.clear()
    node._on_diagnostics(report(node))
    assert told == ['command', 'warning']
    rested(node)
    assert told == ['command', 'warning', 'state', 'metrics']
    # With joint states the same: nothing but the command.
    told.clear()
    node._on_joint_state(joint_state(node))
    assert told == ['command']


def test_the_processor_is_yielded_when_the_command_is_out_and_before_all_else(
    node, told, monkeypatch
):
    """Who hears the command may be waiting for this very processor."""
    settled = Supervisor.settled
    monkeypatch.setattr(os, 'sched_yield', lambda: told.append('yield'))
    monkeypatch.setattr(Supervisor, 'settled', lambda self: told.append('rest') or settled(self))
    node._on_joint_state(joint_state(node))
    told.clear()
    node._on_diagnostics(report(node))
    node._on_joint_state(joint_state(node))
    assert told == ['command', 'yield', 'rest', 'warning', 'command', 'yield', 'rest']


def test_without_a_moments_rest_the_watchdog_tells(node, told):
    node._on_joint_state(joint_state(node))
    node._on_diagnostics(report(node))
    told.clear()
    node._on_watchdog()
    assert told == ['state']
    # The metrics are worked out piece by piece.
    for _ in range(8):
        node._on_watchdog()
    assert told == ['state', 'metrics']


def test_a_watchdog_that_was_late_lets_what_has_arrived_be_read_first(node):
    node._on_joint_state(joint_state(node))
    node._on_watchdog()
    assert node._supervisor.output.state is State.NOMINAL
    time.sleep(2 * node._supervisor.settings.joint_state_timeout)
    node._on_watchdog()
    assert node._supervisor.output.state is State.NOMINAL
    # Nothing had arrived; and late again is no excuse.
    time.sleep(2 * LATE)
    node._on_watchdog()
    assert node._supervisor.output.state is State.HOLD


def test_long_work_is_only_begun_when_no_message_is_about_to_come():
    done = []
    short, long = (Job(lambda cost=cost: done.append(cost)) for cost in ('short', 'long'))
    short.cost, long.cost = 1e-4, 0.6
    idle = IdleTime(long, short)
    now = time.monotonic()
    for count in range(200, 0, -1):
        idle.regular_message(now - 0.5 * (count - 1))
    long.due = short.due = True
    assert SHARE * 0.5 < long.cost
    assert idle.next_job() is short
    short.do()
    assert done == ['short']
    assert not short.due
    assert idle.next_job() is None
    # The joint states have ceased: now there is time for everything.
    idle.regular_message(now - 60.0)
    assert idle.next_job() is long


def test_work_that_fails_is_not_tried_for_ever():
    def fail():
        raise ArithmeticError('no')

    job = Job(fail)
    job.due = True
    with pytest.raises(ArithmeticError, match='no'):
        job.do()
    assert not job.due


def test_real_time_scheduling_is_granted_or_refused_with_a_reason(monkeypatch):
    assert scheduled_real_time(0) == ''

    def refuse(*_):
        raise PermissionError(1, 'Operation not permitted')

    monkeypatch.setattr(os, 'sched_setscheduler', refuse)
    assert scheduled_real_time(50) == (
        'no real-time scheduling (priority 50): [Errno 1] Operation not permitted'
    )
