# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism as markers: struts coloured by failure, platform, boresight, target."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3Stamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker, MarkerArray

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.messages import nanoseconds_from_msg, pose_to_msg

PERIOD = 100_000_000
"""Nanoseconds between two publications."""

# Okabe and Ito's palette for all kinds of colour vision; failed parts are labelled as well.
_COLOURS = {
    'none': (0.0, 0.62, 0.45, 1.0),
    'position': (0.84, 0.37, 0.0, 1.0),
    'torque': (0.94, 0.89, 0.26, 1.0),
    'hard': (0.6, 0.6, 0.6, 0.35),
    'odd': (0.9, 0.62, 0.0, 1.0),
    'mirror': (0.34, 0.71, 0.91, 0.75),
    'boresight': (0.0, 0.45, 0.7, 1.0),
    'target': (0.8, 0.47, 0.65, 1.0),
    'text': (1.0, 1.0, 1.0, 1.0),
}
_SEVERITY = ('none', 'odd', 'torque', 'position', 'hard')
_WORDS = {'position': 'stuck', 'torque': 'free', 'hard': 'lost'}
# In characteristic lengths.
_BORESIGHT = np.array([0.0, 0.0, 3.0])


class View(NamedTuple):
    """What there is to draw of a mechanism.

    The platform's ``pose`` (4, 4), the ``points`` (k, 3) of each strut, base to platform, metres,
    and the ``faults`` of each actuator by name; a lost strut's actuators have the fault ``hard``.
    """

    pose: FloatArray
    points: Sequence[FloatArray]
    faults: Mapping[str, Sequence[str]]


class MarkerPublisher:
    """Publishes ``~/markers`` of a ``mechanism``, in the frame ``frame``, to a subscriber.

    ``look`` returns what there is to see, ``home`` is the same at home. A motion of a milliradian
    is invisible, so it is drawn ``exaggeration`` times as large. Messages are created once and
    updated: that takes a third of the time. Only ``with_target`` the pointing reference is heard.
    """

    def __init__(
        self, node: Node, mechanism: Mechanism, look: Callable[[], View], home: View, frame: str,
        exaggeration: float, *, with_target: bool,
    ) -> None:
        self._mechanism = mechanism
        self._look = look
        self._frame = frame
        self._factor = exaggeration
        self._size = mechanism.characteristic_length
        self._home = np.array(home.pose)
        self._feet = [np.array(points) for points in home.points]
        self._reference = b''
        self._made: dict[str, Marker] = {}
        self._due = 0
        self._publisher = node.create_publisher(MarkerArray, '~/markers', 1)
        if with_target:
            # Deserialised only if there is a subscriber to the markers.
            node.create_subscription(
                Vector3Stamped, 'pointing/reference', self._take, qos_profile_sensor_data, raw=True
            )

    def _take(self, data: bytes) -> None:
        self._reference = data

    @property
    def subscribed(self) -> bool:
        """Whether there is a subscriber."""
        return bool(self._publisher.get_subscription_count())

    def show(self, stamp: Time) -> None:
        """Publish the state at ``stamp``, if due and subscribed to. Call at the end of a cycle."""
        now = nanoseconds_from_msg(stamp)
        # Simulated time may jump back.
        if abs(now - self._due) >= PERIOD and self.subscribed:
            self._due = now
            markers = self._markers()
            for marker in markers:
                marker.header.stamp = stamp
            self._publisher.publish(MarkerArray(markers=markers))

    def _markers(self) -> list[Marker]:
        size, view = self._size, self._look()
        pose = self._exaggerated(np.array(view.pose))
        mirror = self._marker('mirror', Marker.CYLINDER, 'mirror')
        mirror.pose = pose_to_msg(Time(), self._frame, pose).pose
        mirror.scale.x = mirror.scale.y = 2.2 * size
        mirror.scale.z = 0.05 * size
        boresight = self._marker('boresight', Marker.ARROW, 'boresight')
        boresight.points = [_point(pose[:3, 3]), _point(self._tip(pose))]
        boresight.scale.x, boresight.scale.y = 0.05 * size, 0.12 * size
        words = f'motion x{self._factor:g}' if self._factor != 1.0 else ''
        scale = self._text('scale', words)
        scale.pose.position = _point([0.0, 0.0, -0.4 * size])
        return [*self._struts(view), mirror, boresight, self._target(), scale]

    def _struts(self, view: View) -> list[Marker]:
        """Return all struts, then the labels of failed parts."""
        struts, labels = [], []
        for name, points, home in zip(
            self._mechanism.strut_names, view.points, self._feet, strict=True
        ):
            mine = self._mechanism.actuators_of(name)
            failed = [(one, fault) for one in mine for fault in view.faults[one]]
            kinds = [fault if fault in _SEVERITY else 'odd' for _, fault in failed]
            worst = max(kinds, key=_SEVERITY.index, default='none')
            strut = self._marker(name, Marker.LINE_STRIP, worst)
            strut.scale.x = (0.03 if worst == 'hard' else 0.06) * self._size
            drawn = home + self._factor * (points - home)
            strut.points = [_point(one) for one in drawn]
            struts.append(strut)
            words = [f'{one} {_WORDS.get(fault, fault)}' for one, fault in failed]
            text = f'{name} lost' if worst == 'hard' else '\n'.join(words)
            label = self._text(f'{name}/label', text)
            x, y, _ = 1.35 * drawn[-1]
            label.pose.position = _point([x, y, drawn[:, 2].mean()])
            labels.append(label)
        return [*struts, *labels]

    def _target(self) -> Marker:
        """Return the target of the boresight tip, if there is a reference."""
        marker = self._marker('target', Marker.SPHERE, 'target')
        if not self._reference:
            marker.action = Marker.DELETE
            return marker
        vector = deserialize_message(self._reference, Vector3Stamped).vector
        turned = self._home.copy()
        turn = Rotation.from_rotvec([vector.x, vector.y, vector.z])
        turned[:3, :3] = turn.as_matrix() @ self._home[:3, :3]
        marker.pose.position = _point(self._tip(self._exaggerated(turned)))
        marker.scale.x = marker.scale.y = marker.scale.z = 0.25 * self._size
        return marker

    def _tip(self, pose: FloatArray) -> FloatArray:
        return np.asarray(pose[:3, :3] @ _BORESIGHT * self._size + pose[:3, 3])

    def _exaggerated(self, pose: FloatArray) -> FloatArray:
        """Return ``pose`` (4, 4) with its displacement from home multiplied by the factor."""
        turn = Rotation.from_matrix(pose[:3, :3] @ self._home[:3, :3].T).as_rotvec()
        result = np.eye(4)
        turned = Rotation.from_rotvec(self._factor * turn).as_matrix()
        result[:3, :3] = turned @ self._home[:3, :3]
        result[:3, 3] = self._home[:3, 3] + self._factor * (pose[:3, 3] - self._home[:3, 3])
        return result

    def _text(self, name: str, text: str) -> Marker:
        marker = self._marker(name, Marker.TEXT_VIEW_FACING, 'text')
        marker.text = text
        marker.scale.z = 0.3 * self._size
        if not text:
            marker.action = Marker.DELETE
        return marker

    def _marker(self, name: str, kind: int, colour: str) -> Marker:
        marker = self._made.get(name)
        if marker is None:
            marker = self._made[name] = Marker(ns=name, type=kind)
            marker.header.frame_id = self._frame
            marker.pose.orientation.w = 1.0
        marker.action = Marker.ADD
        red, green, blue, alpha = _COLOURS[colour]
        ink = marker.color
        ink.r, ink.g, ink.b, ink.a = red, green, blue, alpha
        return marker


def _point(place: Iterable[float]) -> Point:
    x, y, z = map(float, place)
    return Point(x=x, y=y, z=z)
