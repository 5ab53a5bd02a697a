# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The simulated mirror as markers: struts coloured by their state, the mirror, its boresight."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from fault_tolerance.nodes.messages import pose_to_msg
from fault_tolerance.simulation.state import Plant

_COLOURS = {
    'none': (0.2, 0.7, 0.3, 1.0),
    'position': (0.9, 0.2, 0.1, 1.0),
    'torque': (0.95, 0.65, 0.1, 1.0),
    'hard': (0.5, 0.5, 0.5, 0.3),
    'mirror': (0.6, 0.8, 1.0, 0.8),
    'boresight': (0.1, 0.3, 0.9, 1.0),
}
_SEVERITY = ('none', 'torque', 'position', 'hard')


def markers_of(stamp: Time, frame: str, plant: Plant) -> MarkerArray:
    """Return the markers for the present state of ``plant``, in the base frame."""
    size = plant.mechanism.characteristic_length
    modes = dict(zip(plant.mechanism.actuator_names, plant.actuator_faults, strict=True))
    markers = []
    for name, points in zip(plant.mechanism.strut_names, plant.strut_points, strict=True):
        found = [modes[actuator] for actuator in plant.mechanism.actuators_of(name)]
        worst = max(found, key=_SEVERITY.index, default='none')
        strut = _marker(stamp, frame, name, Marker.LINE_STRIP, worst)
        strut.scale.x = 0.05 * size
        strut.points = [Point(x=x, y=y, z=z) for x, y, z in points.tolist()]
        markers.append(strut)
    pose = pose_to_msg(stamp, frame, plant.state.pose).pose
    mirror = _marker(stamp, frame, 'mirror', Marker.CYLINDER, 'mirror')
    mirror.pose = pose
    mirror.scale.x = mirror.scale.y = 2.2 * size
    mirror.scale.z = 0.05 * size
    boresight = _marker(stamp, frame, 'boresight', Marker.ARROW, 'boresight')
    boresight.pose = pose
    boresight.points = [Point(), Point(z=3.0 * size)]
    boresight.scale.x, boresight.scale.y = 0.05 * size, 0.1 * size
    return MarkerArray(markers=[*markers, mirror, boresight])


def _marker(stamp: Time, frame: str, name: str, kind: int, colour: str) -> Marker:
    marker = Marker(ns=name, type=kind, action=Marker.ADD)
    marker.header.stamp, marker.header.frame_id = stamp, frame
    red, green, blue, alpha = _COLOURS[colour]
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=alpha)
    marker.pose.orientation.w = 1.0
    return marker
