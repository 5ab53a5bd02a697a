# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller's input messages as plain values, and what is odd about them."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState

from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.control.readings import JointStateReader
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.messages import twist_from_msg
from fault_tolerance.nodes.timeline import TimeLine


class Input(NamedTuple):
    """Values, and when they were measured or asked for (None: unknown)."""

    values: FloatArray
    stamp: float | None


class InputReader:
    """Reads joint states and task velocities.

    Parameters
    ----------
    mechanism : Mechanism
    base_frame : str
        The only frame task velocities may be in.
    line : TimeLine
    health : Health
        Is told what is left aside and why.
    """

    def __init__(
        self, mechanism: Mechanism, base_frame: str, line: TimeLine, health: Health
    ) -> None:
        self._mechanism = mechanism
        self._joints = JointStateReader(mechanism)
        self._base_frame = base_frame
        self._line = line
        self._health = health
        self._outside = np.setdiff1d(np.arange(6), mechanism.task.rows)

    def joint_values(self, message: JointState, lost: Collection[str]) -> Input | None:
        """Return the joint values (N,) in a message, or None; ``lost`` struts may lack theirs."""
        readings = self._joints.readings(message.name, message.position, lost)
        if readings.values is None:
            self._health.remark(readings.notice)
            return None
        return Input(readings.values, self._placed(message, 'joint_state'))

    def task_velocity(self, message: TwistStamped) -> Input | None:
        """Return the task velocity (l,) in a message, or None if it is in another frame."""
        frame, twist = message.header.frame_id, twist_from_msg(message)
        if frame and frame != self._base_frame:
            text = f'task velocity in frame {clean(frame)!r}, not {self._base_frame!r}: ignored'
            self._health.remark(Notice('wrong_frame', text))
            return None
        if twist[self._outside].any():
            text = 'task velocity has components outside the task: they are ignored'
            self._health.warn_once('outside_task', text)
        stamp = self._placed(message, 'task_velocity')
        return Input(twist[self._mechanism.task.rows], stamp)

    def _placed(self, message: JointState | TwistStamped, what: str) -> float | None:
        stamp = self._line.placed(message.header.stamp)
        if stamp is None:
            text = f'{what} without a stamp: the time of receipt is used'
            self._health.warn_once(f'no_stamp_{what}', text)
        return stamp
