# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A controller beside ros2_control, whose part is played as it behaves in Jazzy."""

from __future__ import annotations

import math
import signal
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from node_rig import Plant, values_of
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

NAMES = ('theta_1', 'theta_2', 'theta_3', 'theta_4')
COMMANDS = 'velocity_controller/commands'
PERIOD = 0.01
# Of fsm_4_strut: a tilt about x moves strut 1 up and strut 3 down.
ARMS = np.array([0.7071, 0.0, -0.7071, 0.0])


class Ros2Control:
    """joint_state_broadcaster and JointGroupVelocityController on one hardware component.

    The broadcaster has an order of its own, a gripper in it, and NaN until the hardware has been
    read. The velocity controller drops a message with a NaN, repeats its last command for ever,
    and is deactivated by a message of a wrong length; then it writes zeros.
    """

    def __init__(self, probe) -> None:
        self.node = probe.node
        self.restart()
        self.dropped = self.wrong = 0
        self.values = np.zeros(4)
        self.rates = np.zeros(4)
        self.dead: set[str] = set()
        self._publisher = self.node.create_publisher(
            JointState, 'joint_states', qos_profile_sensor_data)
        self.node.create_subscription(
            Float64MultiArray, COMMANDS, self._on_command, 10)
        self.node.create_timer(PERIOD, self._update)

    def deactivate(self) -> None:
        self.active, self.rates = False, np.zeros(4)

    def restart(self) -> None:
        self.active, self.read, self.listens = True, False, True

    def _on_command(self, message: Float64MultiArray) -> None:
        if not (self.active and self.listens):
            return
        if len(message.data) != 4:
            self.wrong += 1
            self.rates = np.zeros(4)
            self.listens = False
        elif not all(map(math.isfinite, message.data)):
            self.dropped += 1
        else:
            self.rates = np.array(message.data)

    def _update(self) -> None:
        if not self.active:
            return
        self.values = self.values + PERIOD * self.rates
        known = dict(zip(NAMES, self.values.tolist(), strict=True)) if self.read else {}
        names = ['theta_4', 'gripper', 'theta_2', 'theta_1', 'theta_3']
        message = JointState(name=names)
        message.position = [
            math.nan if one in self.dead else known.get(one, math.nan) for one in names]
        # What the hardware does not export is NaN.
        message.velocity = message.effort = [math.nan] * len(names)
        message.header.stamp = self.node.get_clock().now().to_msg()
        self._publisher.publish(message)


@pytest.fixture
def machine(controller, probe):
    return Ros2Control(probe)


def test_it_works_with_ros2_control_as_that_behaves(machine, controller, probe):
    operator = Plant(probe, list(NAMES))
    heard = probe.heard(DiagnosticArray, '/diagnostics')
    stranger = probe.node.create_publisher(Float64MultiArray, COMMANDS, 10)

    def told() -> str:
        """Return what the controller says of itself, with its counters."""
        own = [status for message in heard for status in message.status
               if status.name == 'fault_tolerance: controller']
        return f'{own[-1].message} {values_of(own[-1])}' if own else ''

    def tilt(wx: float, duration: float) -> None:
        end = time.monotonic() + duration
        while time.monotonic() < end:
            operator.ask(wx=wx)
            probe.spin(PERIOD)

    # Nothing has been read yet: no place is made up.
    probe.wait(lambda: 'rejected_not_finite' in told(), 'a counter')
    assert not any(any(command.data) for command in probe.commands)
    machine.read = True
    probe.wait_for_state('nominal')
    probe.wait(operator.velocities.get_subscription_count, 'the controller')
    tilt(0.05, 0.3)
    np.testing.assert_allclose(machine.rates, 0.05 * ARMS, atol=1e-4)
    # Nobody asks any more: what is repeated for ever is zero.
    probe.wait(lambda: not machine.rates.any(), 'zeros')
    place = machine.values
    np.testing.assert_allclose(place, place[0] * ARMS / ARMS[0], atol=1e-6)
    # A drive dies, and its encoder with it: the others go on.
    machine.dead.add('theta_4')
    operator.report('position', 'theta_4')
    probe.wait_for_state('degraded')
    tilt(-0.05, 0.2)
    np.testing.assert_allclose(machine.rates, -0.05 * ARMS, atol=1e-4)
    assert (machine.values == place).tolist() == [False, False, False, True]
    # Others' commands: a whole message is dropped, and the next one of ours counts; the velocity
    # controller is gone, while joint states go on.
    probe.wait(stranger.get_subscription_count, 'the velocity controller')
    stranger.publish(Float64MultiArray(data=[math.nan, 0.0, 0.0, 0.0]))
    probe.wait(lambda: machine.dropped, 'the message')
    tilt(-0.05, 0.1)
    assert machine.rates[0] == pytest.approx(-0.05 * ARMS[0], abs=1e-4)
    stranger.publish(Float64MultiArray(data=[0.0, 0.0, 0.0]))
    probe.wait(lambda: not machine.listens, 'the message')

    def told_while_tilting() -> bool:
        operator.ask(wx=-0.05)
        return 'no drive follows' in told()

    probe.wait(told_while_tilting, 'a word about it')
    assert probe.state == 'degraded'
    # The whole component goes, and comes back somewhere else.
    machine.deactivate()
    probe.wait_for_state('hold')
    probe.wait(lambda: not any(probe.commands[-1].data), 'zeros')
    machine.values = 0.02 * ARMS
    machine.restart()
    probe.spin(0.1)
    assert probe.state == 'hold'
    machine.read = True
    probe.wait_for_state('degraded')
    assert 'rejected_jump' not in told()
    tilt(0.05, 0.2)
    np.testing.assert_allclose(machine.rates, 0.05 * ARMS, atol=1e-4)
    # It ends in the middle of a motion.
    assert machine.rates.any()
    controller.process.send_signal(signal.SIGINT)
    probe.wait(lambda: not controller.alive and not machine.rates.any(), 'zeros')
    # Of ours, none was dropped or wrong.
    assert (machine.dropped, machine.wrong) == (1, 1)
    assert all(np.isfinite(one.data).all() for one in probe.commands[:2] + probe.commands[-50:])
