# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``pointing``: closes the pointing loop around a moving reference."""

from __future__ import annotations

import csv
import sys
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3Stamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data

from fault_tolerance.control.failure_reports import OK
from fault_tolerance.control.notices import Notice
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.task import COORDINATES
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.heartbeat import Heartbeat
from fault_tolerance.nodes.messages import (
    nanoseconds_from_msg,
    pose_from_msg,
    twist_to_msg,
    vector_to_msg,
)
from fault_tolerance.nodes.parameter_tables import POINTING
from fault_tolerance.nodes.parameters import ParameterError, declared_values, settings_from
from fault_tolerance.nodes.spinning import run
from fault_tolerance.nodes.timeline import TimeLine
from fault_tolerance.nodes.usage import exit_code
from fault_tolerance.simulation.pointing import PointingLoop, pointing_error
from fault_tolerance.simulation.reference import Reference, reference

NAME = 'pointing'


class PointingReference(Node):
    """ROS interface of a `PointingLoop` and a reference.

    Each mirror pose is answered by a task velocity: feedforward of the reference rate, feedback
    of the pointing error, and of the height at home. Reference and pointing error are published
    as rotation vectors on ``~/reference`` and ``~/error`` with the stamp of the pose.
    """

    def __init__(self) -> None:
        super().__init__(NAME)
        self._values = declared_values(self, POINTING, _reference)
        mechanism = mechanism_named(self._values['mechanism'])
        if not {'wx', 'wy'} <= set(mechanism.task.coordinates):
            raise ParameterError('mechanism', f'the task of {mechanism.name} lacks wx or wy')
        self._home = mechanism.origin
        self._in_task = np.array([name in mechanism.task.coordinates for name in COORDINATES])
        self._frame = self._values['base_frame']
        self._started: int | None = None
        self._set_up()
        self.add_post_set_parameters_callback(self._on_have_set)
        timeline = TimeLine(self.get_clock())
        namespace = self.get_namespace().strip('/')
        self._heartbeat = Heartbeat(self)
        self._health = Health(self, timeline, 'reference', namespace, self._present)
        self._heartbeat.on_change = self._health.publish
        self._velocities = self.create_publisher(TwistStamped, 'fault_tolerance/task_velocity', 10)
        self._references = self.create_publisher(Vector3Stamped, '~/reference', 10)
        self._errors = self.create_publisher(Vector3Stamped, '~/error', 10)
        self._poses = self.create_subscription(
            PoseStamped, self._values['pose_topic'], self._on_pose, qos_profile_sensor_data
        )

    def _set_up(self) -> None:
        self._reference = _reference(self._values)
        self._loop = settings_from(PointingLoop, self._values)

    def _on_have_set(self, parameters: list[Parameter]) -> None:
        self._values |= {one.name: one.value for one in parameters if one.name in self._values}
        self._set_up()

    def _on_pose(self, message: PoseStamped) -> None:
        try:
            pose = pose_from_msg(message)
        except ValueError as error:
            self._health.warn(Notice('pose', f'mirror pose ignored: {error}'))
            return
        now = self.get_clock().now()
        stamp = nanoseconds_from_msg(message.header.stamp) or now.nanoseconds
        if self._started is None:
            self._started = stamp
        t = (stamp - self._started) * 1e-9 + self._values['start']
        angle, rate = self._reference.angle(t), np.zeros(2)
        if self._values['feedforward']:
            rate = self._reference.rate(t + self._values['lead'])
        twist = self._loop.velocity(pose, self._home, angle, rate) * self._in_task
        self._velocities.publish(twist_to_msg(now.to_msg(), self._frame, twist))
        for publisher, pair in (
            (self._references, angle), (self._errors, pointing_error(pose, angle))
        ):
            vector = np.append(pair, 0.0)
            publisher.publish(vector_to_msg(message.header.stamp, self._frame, vector))

    def _present(self) -> tuple[int, str]:
        if self._started is None:
            waiting = f'waiting for mirror poses on {self._poses.topic_name}'
            return self._heartbeat.told(OK, waiting)
        return self._heartbeat.told(OK, self._values['kind'])


def _reference(values: dict[str, Any]) -> Reference:
    """Return the reference for the values of the parameters."""
    kind, size, frequency = values['kind'], values['amplitude'], values['frequency']
    if kind == 'circle':
        return reference(kind, amplitude=size, frequency=frequency)
    both = (size, size * values['aspect'])
    if kind == 'raster':
        return reference(kind, amplitude=both, frequency=frequency, lines=values['lines'])
    if kind == 'lissajous':
        pair = (frequency, frequency * values['frequency_ratio'])
        return reference(kind, amplitude=both, frequency=pair, phase=values['phase'])
    if kind == 'route':
        return _route(values['route'])
    return reference(kind, amplitude=both)


def _route(path: str) -> Reference:
    """Return the reference in the table (.csv) that the command ``route`` has written."""
    if not path:
        raise ParameterError('route', 'no file is given')
    try:
        with open(path, newline='', encoding='utf-8') as file:
            rows = list(csv.DictReader(file))
        times, *angles = ([float(row[name]) for row in rows] for name in ('t', 'wx', 'wy'))
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError('route', f'{path}: cannot be read ({error})') from None
    except (KeyError, TypeError, ValueError):
        raise ParameterError('route', f'{path}: is no table with numbers t, wx, wy') from None
    return reference('route', times=times, angles=list(zip(*angles, strict=True)))


def main(args: list[str] | None = None) -> int:
    """Run the node with command line ``args``; return the exit code of the process."""
    code = exit_code('pointing_reference', __doc__, POINTING, args)
    if code is not None:
        return code
    return run(NAME, PointingReference, args)


if __name__ == '__main__':
    sys.exit(main())
