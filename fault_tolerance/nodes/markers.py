# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The simulated mirror as markers: struts by their state, mirror, boresight and its target."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3Stamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker, MarkerArray

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.nodes.messages import nanoseconds_from_msg, pose_to_msg
from fault_tolerance.simulation.state import Plant

PERIOD = 100_000_000
"""Nanoseconds between two pictures."""

# Okabe and Ito's colours, told apart by everybody; what has failed is named as well.
_COLOURS = {
    'none': (0.0, 0.62, 0.45, 1.0),
    'position': (0.84, 0.37, 0.0, 1.0),
    'torque': (0.94, 0.89, 0.26, 1.0),
    'hard': (0.6, 0.6, 0.6, 0.35),
    'mirror': (0.34, 0.71, 0.91, 0.75),
    'boresight': (0.0, 0.45, 0.7, 1.0),
    'target': (0.8, 0.47, 0.65, 1.0),
    'text': (1.0, 1.0, 1.0, 1.0),
}
_SEVERITY = ('none', 'torque', 'position', 'hard')
_WORDS = {'position': 'stuck', 'torque': 'free', 'hard': 'lost'}
# In characteristic lengths.
_REACH = 3.0
_BORESIGHT = np.array([0.0, 0.0, _REACH])


class MarkerPublisher:
    """Publishes ``~/markers`` while somebody looks.

    Motions of a milliradian cannot be seen, so they are drawn ``exaggeration`` times as large.
    Messages are made once and changed: that takes a third of the time.

    Parameters
    ----------
    node : Node
    plant : Plant
        At home.
    frame : str
    exaggeration : float
    """

    def __init__(self, node: Node, plant: Plant, frame: str, exaggeration: float) -> None:
        self._plant = plant
        self._frame = frame
        self._factor = exaggeration
        self._home = np.array(plant.state.pose)
        self._feet = [np.array(points) for points in plant.strut_points]
        self._reference = b''
        self._made: dict[str, Marker] = {}
        self._due = 0
        self._publisher = node.create_publisher(MarkerArray, '~/markers', 1)
        # Kept as it comes: it is read only when somebody looks.
        node.create_subscription(
            Vector3Stamped, 'pointing/reference', self._take, qos_profile_sensor_data, raw=True
        )

    def _take(self, data: bytes) -> None:
        self._reference = data

    def show(self, stamp: Time) -> None:
        """Publish the present state, if it is time to and somebody looks.

        For the end of a cycle, when nothing waits for the simulator.
        """
        now = nanoseconds_from_msg(stamp)
        # Time may have been set back.
        if abs(now - self._due) >= PERIOD and self._publisher.get_subscription_count():
            self._due = now
            self._publisher.publish(MarkerArray(markers=self._markers(stamp)))

    def _markers(self, stamp: Time) -> list[Marker]:
        size = self._plant.mechanism.characteristic_length
        pose = self._exaggerated(np.array(self._plant.state.pose))
        mirror = self._marker(stamp, 'mirror', Marker.CYLINDER, 'mirror')
        mirror.pose = pose_to_msg(stamp, self._frame, pose).pose
        mirror.scale.x = mirror.scale.y = 2.2 * size
        mirror.scale.z = 0.05 * size
        boresight = self._marker(stamp, 'boresight', Marker.ARROW, 'boresight')
        boresight.points = [_point(pose[:3, 3]), _point(self._tip(pose))]
        boresight.scale.x, boresight.scale.y = 0.05 * size, 0.12 * size
        words = f'motion x{self._factor:g}' if self._factor != 1.0 else ''
        scale = self._text(stamp, 'scale', words)
        scale.pose.position = _point(np.array([0.0, 0.0, -0.4 * size]))
        return [*self._struts(stamp), mirror, boresight, self._target(stamp), scale]

    def _struts(self, stamp: Time) -> list[Marker]:
        """Return every strut, and after all of them the names of what has failed."""
        plant, mechanism = self._plant, self._plant.mechanism
        size = mechanism.characteristic_length
        modes = dict(zip(mechanism.actuator_names, plant.actuator_faults, strict=True))
        struts, labels = [], []
        for name, points, home in zip(
            mechanism.strut_names, plant.strut_points, self._feet, strict=True
        ):
            failed = {one: modes[one] for one in mechanism.actuators_of(name)
                      if modes[one] != 'none'}
            worst = max(failed.values(), key=_SEVERITY.index, default='none')
            strut = self._marker(stamp, name, Marker.LINE_STRIP, worst)
            strut.scale.x = (0.03 if worst == 'hard' else 0.06) * size
            drawn = home + self._factor * (points - home)
            strut.points = [_point(one) for one in drawn]
            struts.append(strut)
            words = [f'{one} {_WORDS[mode]}' for one, mode in failed.items() if mode != 'hard']
            label = self._text(
                stamp, f'{name}/label', f'{name} lost' if worst == 'hard' else '\n'.join(words)
            )
            label.pose.position = _point(1.35 * drawn[-1] * [1.0, 1.0, 0.0] + [
                0.0, 0.0, drawn[:, 2].mean()])
            labels.append(label)
        return [*struts, *labels]

    def _target(self, stamp: Time) -> Marker:
        """Return where the tip of the boresight should be, if there is a reference."""
        marker = self._marker(stamp, 'target', Marker.SPHERE, 'target')
        if not self._reference:
            marker.action = Marker.DELETE
            return marker
        vector = deserialize_message(self._reference, Vector3Stamped).vector
        turned = self._home.copy()
        turn = Rotation.from_rotvec([vector.x, vector.y, vector.z])
        turned[:3, :3] = turn.as_matrix() @ self._home[:3, :3]
        marker.pose.position = _point(self._tip(self._exaggerated(turned)))
        size = 0.25 * self._plant.mechanism.characteristic_length
        marker.scale.x = marker.scale.y = marker.scale.z = size
        return marker

    def _tip(self, pose: FloatArray) -> FloatArray:
        size = self._plant.mechanism.characteristic_length
        return np.asarray(pose[:3, :3] @ _BORESIGHT * size + pose[:3, 3])

    def _exaggerated(self, pose: FloatArray) -> FloatArray:
        """Return a pose that is further from home by the factor."""
        return exaggerated_pose(pose, self._home, self._factor)

    def _text(self, stamp: Time, name: str, text: str) -> Marker:
        marker = self._marker(stamp, name, Marker.TEXT_VIEW_FACING, 'text')
        marker.text = text
        marker.scale.z = 0.3 * self._plant.mechanism.characteristic_length
        if not text:
            marker.action = Marker.DELETE
        return marker

    def _marker(self, stamp: Time, name: str, kind: int, colour: str) -> Marker:
        marker = self._made.get(name)
        if marker is None:
            marker = self._made[name] = Marker(ns=name, type=kind)
            marker.header.frame_id = self._frame
            marker.pose.orientation.w = 1.0
        marker.action = Marker.ADD
        marker.header.stamp = stamp
        red, green, blue, alpha = _COLOURS[colour]
        ink = marker.color
        ink.r, ink.g, ink.b, ink.a = red, green, blue, alpha
        return marker


def exaggerated_pose(pose: FloatArray, home: FloatArray, factor: float) -> FloatArray:
    """Return ``pose`` (4, 4) with its turn and shift from ``home`` multiplied by ``factor``."""
    turn = Rotation.from_matrix(pose[:3, :3] @ home[:3, :3].T).as_rotvec()
    result = np.eye(4)
    result[:3, :3] = Rotation.from_rotvec(factor * turn).as_matrix() @ home[:3, :3]
    result[:3, 3] = home[:3, 3] + factor * (pose[:3, 3] - home[:3, 3])
    return result


def _point(place: FloatArray) -> Point:
    x, y, z = place.tolist()
    return Point(x=x, y=y, z=z)
