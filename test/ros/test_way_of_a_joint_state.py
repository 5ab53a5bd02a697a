# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""From a joint state to its command lie few functions, always the same ones in the same order.

``docs/architecture.md`` names them, and those on the way of a failure report.
"""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from geometry_msgs.msg import TwistStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

import fault_tolerance
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.kernel.compilation import python_kernel
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.controller import Controller
from fault_tolerance.nodes.kernel_startup import KernelStartup
from fault_tolerance.nodes.messages import diagnostics_to_msg, status_to_msg

MECHANISM = mechanism_named('mirror_4_strut')  # the node's default
PACKAGE = str(Path(fault_tolerance.__file__).parent)
PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'architecture.md'
END = 'CommandPublisher.publish'
MOST = 12


@pytest.fixture
def controller(ros):
    startup = KernelStartup()
    startup.kernel = python_kernel()  # a profiler may not see compiled functions
    node = Controller(startup)
    yield node
    node.on_shutdown()
    node.destroy_node()


def joint_state(node):
    message = JointState(name=list(MECHANISM.joint_state_names), position=[0.0] * 4)
    message.header.stamp = node.get_clock().now().to_msg()
    message.header.frame_id = 'abc'  # fills four bytes: what stands in padding may differ here
    return serialize_message(message)


def way(function, message):
    """Return the package's functions that are called until a command is published."""
    calls, inside_the_kernel = [], []

    def note(frame, event, _):
        file = frame.f_code.co_filename
        if not file.startswith(PACKAGE) or calls[-1:] == [END]:
            return
        if event == 'return' and inside_the_kernel and frame is inside_the_kernel[0]:
            inside_the_kernel.clear()
        if event != 'call' or inside_the_kernel:
            return
        name = frame.f_code.co_name
        if Path(file).parent.name == 'kernel':
            inside_the_kernel.append(frame)
            name = f'kernel.{name}'
        elif 'self' in frame.f_locals:
            name = f'{type(frame.f_locals["self"]).__name__}.{name}'
        calls.append(name)

    sys.setprofile(note)
    try:
        function(message)
    finally:
        sys.setprofile(None)
    return calls


def documented(title):
    """Return the functions that a section of the page names, in order."""
    section = PAGE.read_text().partition(f'## {title}\n')[2].partition('\n## ')[0]
    return re.findall(r'^\d+\. `([\w.]+)`', section, re.MULTILINE)


def test_the_way_is_short_and_always_the_same(controller):
    inputs, supervisor = controller._inputs, controller._supervisor
    velocity = TwistStamped()
    velocity.twist.angular.x = 1e-3

    def commanded():
        inputs.on_task_velocity(velocity)
        return way(inputs.on_joint_state, joint_state(controller))

    commanded()
    healthy = commanded()
    stuck = Report(('drive', 'drive'), MECHANISM.actuator_names[0], 'position', ERROR)
    assert supervisor.reports([stuck], controller._timeline.now())
    first = commanded()
    assert supervisor.output.command.rates.any() and supervisor.output.command.rates[0] == 0.0
    later = commanded()
    assert healthy == first == later == documented('The way of one joint state')
    assert healthy[-1] == END
    assert len(healthy[:-1]) <= MOST


def test_the_way_of_a_report_is_as_documented(controller):
    report = status_to_msg(
        'drive', MECHANISM.actuator_names[0], 2, '', {'failure_mode': 'position'})
    raw = serialize_message(diagnostics_to_msg(controller.get_clock().now().to_msg(), [report]))
    controller._inputs.on_joint_state(joint_state(controller))
    told = iter(way(controller._reports.on_diagnostics, raw))
    names = [*documented('The way of a failure report'), 'Controller._cycle', END]
    assert len(names) > 9
    assert [name for name in names if name not in told] == []


def test_better_places_are_looked_for_by_machine_code_only(controller, monkeypatch):
    supervisor, looks = controller._supervisor, []
    monkeypatch.setattr(supervisor.secondary, 'consider', lambda *given: looks.append(given))
    controller._inputs.on_joint_state(joint_state(controller))
    assert not looks
    supervisor.kernel = replace(supervisor.kernel, compiled=True)
    controller._inputs.on_joint_state(joint_state(controller))
    ((output, _),) = looks
    assert output is supervisor.output


def test_what_goes_wrong_with_a_service_does_not_keep_drives_moving(controller, monkeypatch):
    velocity = TwistStamped()
    velocity.twist.angular.x = 1e-3
    controller._inputs.on_task_velocity(velocity)
    controller._inputs.on_joint_state(joint_state(controller))
    assert controller._commands.moving

    def fail():
        raise RuntimeError('nobody takes the answer')

    monkeypatch.setattr(controller._operator, 'look', fail)
    controller._supervisor.restart_clock(controller._timeline.now())
    for _ in range(2):  # the first may be late, and then waits for messages
        with pytest.raises(RuntimeError, match='nobody takes'):
            controller._on_watchdog()
    assert not controller._commands.moving
