# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The reference: figures, parameters that may change, and poses that make no sense."""

from __future__ import annotations

from math import hypot, nan

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3Stamped
from node_rig import Probe, values_of
from rclpy.qos import qos_profile_sensor_data

from fault_tolerance.cli import main

HOME = 0.05


class Pointing:
    """The reference alone, and a mirror that the test holds where it likes."""

    def __init__(self, probe: Probe, start, **parameters: object) -> None:
        self.probe = probe
        self.process = start('pointing_reference', **parameters)
        self.velocities = probe.heard(TwistStamped, 'fault_tolerance/task_velocity')
        self.errors = probe.heard(Vector3Stamped, 'pointing/error')
        self._poses = probe.node.create_publisher(
            PoseStamped, 'fsm/mirror_pose', qos_profile_sensor_data
        )
        probe.wait(self._poses.get_subscription_count, 'the reference')

    def pose(self, height: float = HOME, seconds: float = 0.0) -> PoseStamped:
        """Return a pose that is not turned, so long after the first one."""
        message = PoseStamped()
        message.header.stamp.sec = 1000 + int(seconds)
        message.header.stamp.nanosec = int(1e9 * (seconds % 1.0))
        message.pose.position.z = height
        message.pose.orientation.w = 1.0
        return message

    def answer(self, message: PoseStamped) -> TwistStamped:
        """Return the velocity asked for at a pose."""
        self.velocities.clear()

        def answered() -> bool:
            self._poses.publish(message)
            self.probe.spin(0.02)
            return bool(self.velocities)

        self.probe.wait(answered, 'a velocity')
        self.probe.spin(0.1)
        return self.velocities[-1]

    def send(self, message: PoseStamped) -> None:
        self._poses.publish(message)


def test_it_asks_for_feedforward_plus_gain_times_error(start, probe):
    pointing = Pointing(probe, start, gain=2.0, lead=0.25)
    twist = pointing.answer(pointing.pose()).twist
    # A circle of 1 mrad at 1 Hz stands at (1, 0) mrad at first, and a quarter of a turn later
    # moves at (-2 pi, 0) mrad/s.
    assert twist.angular.x == pytest.approx(2e-3 - 6.283e-3, abs=1e-6)
    assert twist.angular.y == pytest.approx(0.0, abs=1e-6)
    assert twist.linear.z == 0.0
    assert pointing.velocities[-1].header.frame_id == 'base_link'
    assert pointing.velocities[-1].header.stamp.sec > 0
    vector = pointing.errors[-1].vector
    assert (vector.x, vector.y) == pytest.approx((1e-3, 0.0), abs=1e-9)
    assert pointing.errors[-1].header.stamp.sec == 1000


def test_it_draws_the_mirror_back_to_its_height_at_home(start, probe):
    pointing = Pointing(probe, start, piston_gain=3.0, feedforward=False)
    twist = pointing.answer(pointing.pose(height=HOME + 1e-4)).twist
    assert twist.linear.z == pytest.approx(-3e-4)
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.0, 0.0, 0.0)


def test_it_follows_a_route_of_the_command_line(start, probe, tmp_path):
    ends = ['--from', 'wx=0.01', '--to', 'wx=-0.01', '--over', 'wx=-0.01:0.01:3']
    assert main(['route', 'mirror_4_strut', *ends, '--json', '--output', str(tmp_path)]) == 0
    pointing = Pointing(
        probe, start, kind='route', route=str(tmp_path / 'route.csv'), gain=2.0, lead=0.0,
    )
    angular = pointing.answer(pointing.pose()).twist.angular
    # Straight down, at half of what the drives can: 25 mm/s at a radius of 20 mm.
    assert angular.x == pytest.approx(2.0 * 0.01 - 1.25, rel=1e-3)
    assert angular.y == pytest.approx(0.0, abs=1e-9)
    angular = pointing.answer(pointing.pose(seconds=1.0)).twist.angular
    assert angular.x == pytest.approx(2.0 * -0.01, rel=1e-3)


def test_figures_and_gains_may_be_changed_with_an_answer(start, probe):
    pointing = Pointing(probe, start, feedforward=False)
    pointing.answer(pointing.pose())
    assert probe.set_parameter('pointing', 'kind', 'step').successful
    assert probe.set_parameter('pointing', 'amplitude', 0.002).successful
    assert probe.set_parameter('pointing', 'gain', 1.0).successful
    angular = pointing.answer(pointing.pose(seconds=1.0)).twist.angular
    assert (angular.x, angular.y) == pytest.approx((2e-3, 2e-3), abs=1e-9)


@pytest.fixture(scope='module')
def shared(ros, start_for_module):
    """A probe beside a reference that nothing can change."""
    probe = Probe('shared')
    start_for_module('pointing_reference', 'shared')
    yield probe
    probe.close()


@pytest.mark.parametrize(
    ('name', 'value', 'reason'),
    [
        ('kind', 'spiral', 'is not one of step, circle'),
        ('kind', 'route', 'parameter route: no file is given'),
        ('gain', nan, 'gain'),
        ('gain', -1.0, 'gain'),
        ('amplitude', 'wide', 'type'),
        ('mechanism', 'fsm_4_strut', 'the node is built with it'),
    ],
)
def test_a_bad_change_is_refused_with_a_reason(shared, name, value, reason):
    answer = shared.set_parameter('pointing', name, value)
    assert not answer.successful
    assert reason in answer.reason


def test_poses_that_make_no_sense_are_left_aside(start, probe):
    diagnostics = probe.heard(DiagnosticArray, '/diagnostics')
    pointing = Pointing(probe, start)
    pointing.answer(pointing.pose())
    bad = [pointing.pose(height=nan), pointing.pose()]
    bad[1].pose.orientation.w = 0.0
    pointing.velocities.clear()
    for message in bad:
        pointing.send(message)
    probe.wait(
        lambda: any(
            values_of(status).get('rejected_pose') == '2'
            for message in diagnostics
            for status in message.status
        ),
        'the counter',
    )
    assert not pointing.velocities
    assert pointing.process.alive


def test_the_mirror_follows_every_figure(start, probe):
    for module in ('fsm_simulator', 'controller'):
        start(module)
    start('pointing_reference', kind='step', frequency=0.5, gain=20.0)
    errors = probe.heard(Vector3Stamped, 'pointing/error')

    def follows() -> bool:
        late = errors[-20:]
        return len(errors) > 100 and all(
            hypot(message.vector.x, message.vector.y) < 1e-4 for message in late
        )

    for kind in ('step', 'raster', 'lissajous'):
        assert probe.set_parameter('pointing', 'kind', kind).successful
        errors.clear()
        probe.wait(follows, f'the mirror to follow a {kind}')
