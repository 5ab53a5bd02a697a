# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Where the controller believes the platform to be: as a pose, as markers, and to point by."""

from __future__ import annotations

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from node_rig import Plant, rms
from rclpy.qos import qos_profile_sensor_data
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker, MarkerArray

from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes import belief_publisher
from fault_tolerance.nodes.serialised_joint_states import NO_LAYOUT, SerialisedJointState
from fault_tolerance.nodes.spinning import Deferred

NAMES = ['theta_1', 'theta_2', 'theta_3', 'theta_4']


def turned(pose: PoseStamped):
    """Return the rotation vector of a pose, and its height."""
    turn = pose.pose.orientation
    vector = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_rotvec()
    return [*vector.tolist(), pose.pose.position.z]


def test_the_pose_follows_the_joint_states_by_the_loops(start, probe):
    start('controller', mechanism='mirror_4_strut', base_frame='bench')
    plant = Plant(probe, NAMES)
    poses = probe.heard(PoseStamped, 'fault_tolerance/platform_pose')
    markers = probe.heard(MarkerArray, 'fault_tolerance/markers')
    plant.connect()
    # Struts 1 and 3 are 20 mm from the middle, on the y axis.
    message = plant.joint_state([2e-5, 0.0, -2e-5, 0.0])
    plant.step(message)
    probe.wait(lambda: plant.step(message) and poses
               and abs(turned(poses[-1])[0]) > 9e-4, 'the tilt')
    x, y, z, height = turned(poses[-1])
    assert abs(x) == pytest.approx(1e-3, rel=1e-3)
    assert (y, z) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert height == pytest.approx(0.05, abs=1e-6)
    assert poses[-1].header.frame_id == 'bench'
    # Its stamp is that of a joint state, and late ones do not come.
    stamps = [one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in poses]
    assert stamps == sorted(stamps)

    plant.report('hard', 'strut_4')

    def drawn():
        return {one.ns: one for one in markers[-1].markers if one.action == Marker.ADD}

    probe.wait(lambda: plant.step(message) and 'strut_4/label' in drawn(), 'the lost strut')
    assert drawn()['strut_4/label'].text == 'strut_4 lost'
    assert drawn()['mirror'].header.frame_id == 'bench'
    assert drawn()['strut_1'].color != drawn()['strut_4'].color


def test_the_pointing_loop_closes_around_the_belief_as_well(start, probe):
    start('fsm_simulator', mechanism='mirror_4_strut')
    start('controller', mechanism='mirror_4_strut')
    start('pointing_reference', mechanism='mirror_4_strut',
          pose_topic='fault_tolerance/platform_pose')
    errors = probe.heard(Vector3Stamped, 'pointing/error', qos_profile_sensor_data)
    probe.wait_for_state('nominal')
    # The circle has a radius of 1000 microradians; a busy machine may lose it for a while.
    probe.wait(lambda: len(errors) > 250 and min(rms(errors[-250:])) < 2e-5, 'the circle')


def test_every_joint_state_at_the_least_period_has_its_own_pose(probe, monkeypatch):
    supervisor, deferred, time = Supervisor(mechanism_named('mirror_4_strut')), Deferred(), [0.0]
    monkeypatch.setattr(belief_publisher, 'monotonic', lambda: time[0])
    belief = belief_publisher.BeliefPublisher(probe.node, supervisor, 'base', 1.0, deferred)
    topic = f'{probe.node.get_name()}/platform_pose'
    poses = probe.heard(PoseStamped, topic, 100)
    probe.wait(lambda: probe.node.count_subscribers(topic), 'a subscriber')

    def reading(number):
        tilt = 1e-5 * (number % 3 - 1)
        supervisor.joint_reading(np.array([tilt, 0.0, -tilt, 0.0]), time[0])
        supervisor.step(time[0])
        return SerialisedJointState(number, 0, np.zeros(4), b'', NO_LAYOUT)

    for number in range(1, 41):
        # 250 Hz, and now and then a little early.
        time[0] = 100.0 + 0.004 * number - 0.0005 * (number % 4 == 0)
        belief.observe(reading(number))
        # One more is answered before there is time for the pose of the first.
        reading(number + 1)
        while deferred:
            deferred.run_next()
    probe.wait(lambda: len(poses) >= 38, 'poses')
    for one in poses:
        expected = 5e-4 * abs(one.header.stamp.sec % 3 - 1)
        assert np.hypot(*turned(one)[:2]) == pytest.approx(expected, rel=0.1, abs=1e-5)
