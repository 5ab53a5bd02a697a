# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Where the controller believes the platform to be: as a pose, as markers, and to point by."""

from __future__ import annotations

import pytest
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from node_rig import Plant, rms
from rclpy.qos import qos_profile_sensor_data
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker, MarkerArray

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
    probe.wait(lambda: errors and abs(errors[-1].vector.x) < 5e-5, 'the circle')
    errors.clear()
    probe.wait(lambda: len(errors) > 250, 'two turns and more')
    # The circle has a radius of 1000 microradians.
    assert min(rms(errors)) < 2e-5
