# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The live view beside a running controller."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from node_rig import Plant, Probe
from rclpy.qos import qos_profile_sensor_data

from fault_tolerance.analysis.snapshot import Suspect
from fault_tolerance.nodes.controller_monitor import SUSPICIONS_KEPT, ControllerMonitor
from fault_tolerance.nodes.messages import diagnostics_to_msg, status_to_msg

NAMES = ['theta_1', 'theta_2', 'theta_3', 'theta_4']
WATCH = [sys.executable, '-m', 'fault_tolerance', 'watch']


@pytest.fixture
def robot(ros):
    probe = Probe('robot')
    yield probe
    probe.close()


def test_it_tells_how_things_stand(robot, start):
    # Patient with a busy machine: nothing is to be late here.
    start('controller', namespace='robot', mechanism='mirror_4_strut',
          joint_state_timeout=30.0, command_timeout=30.0)
    monitor = ControllerMonitor(robot.node)
    assert monitor.snapshot().state == ''
    plant = Plant(robot, NAMES)
    plant.connect()
    plant.asked = (1e-3, 2e-3)
    plant.step()
    robot.wait(
        lambda: monitor.snapshot().actuators and monitor.snapshot().struts, 'measures'
    )
    robot.wait(lambda: 'mirror' in monitor.snapshot().title, 'the status')

    healthy = monitor.snapshot()
    assert healthy.title == 'mirror_4_strut in /robot'
    assert (healthy.state, healthy.failures) == ('nominal', ())
    assert healthy.reason.startswith('no failure')
    assert [one.name for one in healthy.actuators] == NAMES
    assert [one.name for one in healthy.struts] == [f'strut_{n}' for n in (1, 2, 3, 4)]
    first = healthy.actuators[0]
    assert (first.position, first.torque) == pytest.approx((3**-0.5, 0.5))
    assert (first.limit, first.unit) == (0.05, 'm/s')
    assert healthy.struts[2].hard == pytest.approx(0.5)
    robot.wait(lambda: (plant.step(), monitor.snapshot().alike)[1], 'what looks alike')
    (unseen,) = monitor.snapshot().alike
    assert {'healthy', 'torque:theta_1', 'hard:strut_4'} <= set(unseen)

    plant.report('position', 'robot/theta_4')
    robot.wait_for_state('degraded')
    plant.step()
    robot.wait(lambda: monitor.snapshot().failures, 'metrics of the failure')
    broken = monitor.snapshot()
    assert (broken.state, broken.failures) == ('degraded', ('position:theta_4',))
    assert broken.reason == 'theta_4 stuck; wx, wy retained, vz coupled'
    assert (broken.actuators[3].failure, broken.actuators[3].position) == ('position', None)
    assert (broken.worst_next.split(':')[0], broken.worst_measure) == ('position', 0.0)
    assert broken.actuators[3].rate == 0.0 and broken.fastest > 0.0
    assert broken.values['manipulability retained'] == pytest.approx(3**-0.5)

    errors = robot.node.create_publisher(
        Vector3Stamped, 'pointing/error', qos_profile_sensor_data)
    robot.wait(errors.get_subscription_count, 'the monitor')
    message = Vector3Stamped()
    message.vector.x, message.vector.y = 3e-6, 4e-6

    def heard():
        errors.publish(message)
        return monitor.snapshot().errors

    robot.wait(heard, 'a pointing error')
    assert monitor.snapshot().rms_error == pytest.approx(5e-6)


def test_it_tells_what_is_suspected_for_as_long_as_it_is_said(robot):
    monitor = ControllerMonitor(robot.node)
    values = {'suspected_mode': 'position', 'candidates': 'position:theta_4,encoder:theta_4',
              'log_odds': '31.5', 'would_separate': 'pose'}
    statuses = [
        status_to_msg(name, hardware_id, 1, '', values)
        for name, hardware_id in (
            ('fault_tolerance: detection', 'robot/theta_4'),
            ('fault_tolerance: detection', 'theta_4'),
            ('fsm: theta_4', 'robot/theta_4'),
        )
    ]
    monitor._take_diagnostics(diagnostics_to_msg(robot.node.get_clock().now().to_msg(), statuses))
    assert monitor.snapshot().suspects == (
        Suspect(('position:theta_4', 'encoder:theta_4'), 31.5, 'pose'),)
    monitor._take_diagnostics(DiagnosticArray())
    assert monitor.snapshot().suspects
    monitor._suspected -= SUSPICIONS_KEPT
    assert monitor.snapshot().suspects == ()


@pytest.mark.parametrize(('known', 'suspected', 'told'), [
    ('torque:theta_1 0.5', 'torque:theta_2 0', ('torque:theta_2', 0.0)),
    ('torque:theta_1 0.5', '', ('torque:theta_1', 0.5)),
    ('0', 'torque:theta_2 0', ('', 0.0)),
])
def test_the_worst_next_failure_counts_what_is_suspected(robot, known, suspected, told):
    monitor = ControllerMonitor(robot.node)
    values = {'worst_next': known, 'worst_next_suspected': suspected}
    status = status_to_msg('fault_tolerance: mechanism', 'mirror_4_strut', 0, '', values)
    monitor._take_metrics(diagnostics_to_msg(robot.node.get_clock().now().to_msg(), [status]))
    snapshot = monitor.snapshot()
    assert (snapshot.worst_next, snapshot.worst_measure) == told


def test_metrics_that_make_no_sense_are_survived(robot):
    monitor = ControllerMonitor(robot.node)
    monitor._take_metrics(DiagnosticArray())
    assert monitor.snapshot().actuators == ()


def test_lines_go_to_a_pipe_and_a_picture_to_a_terminal(robot, start):
    start('controller', namespace='robot', mechanism='fsm_4_strut')
    robot.wait_for_state('waiting')
    options = ['--namespace', 'robot', '--duration', '8']
    master, slave = pty.openpty()
    on_screen = subprocess.Popen(
        [*WATCH, *options], stdin=subprocess.DEVNULL, stdout=slave, stderr=slave,
        env={**os.environ, 'TERM': 'xterm', 'COLUMNS': '90', 'LINES': '24'})
    os.close(slave)
    done = subprocess.run([*WATCH, *options], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, '')
    last = done.stdout.splitlines()[-1]
    assert last.split(' s  ', 1)[1].startswith(
        'fsm_4_strut in /robot: waiting: no joint state yet on /robot/joint_states (0 ')
    assert '\x1b' not in done.stdout

    picture = b''
    try:
        while part := os.read(master, 65536):
            picture += part
    except OSError:  # the terminal is closed
        pass
    os.close(master)
    assert on_screen.wait(30) == 0
    text = picture.decode()
    assert '\x1b[' in text and '╭─' in text and 'WAITING' in text and 'no joint state yet' in text
