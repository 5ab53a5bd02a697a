# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a controlled mechanism: what is recorded, and what a recording is read for."""

from __future__ import annotations

from typing import Any

SCALARS = (
    'position_tolerance', 'torque_tolerance', 'hard_tolerance', 'retained_manipulability',
    'condition_number', 'active_failures', 'reconfiguration_time', 'time_since_report',
    'internal_force', 'tracking_error',
)
"""The controller's metrics with a topic of their own."""

ARRAYS = {
    'position': 'position_measures', 'torque': 'torque_measures', 'hard': 'hard_measures'
}
"""The controller's metrics with a number for each actuator, or strut, by failure mode."""

JOINT_STATES = 'joint_states'
COMMANDS = 'velocity_controller/commands'
JOINT_COMMANDS = 'fault_tolerance/joint_commands'
BRAKE_COMMANDS = 'fault_tolerance/brake_commands'
RELEASE_COMMANDS = 'fault_tolerance/release_commands'
STATE = 'fault_tolerance/state'
STATUS = 'fault_tolerance/status'
METRICS = 'fault_tolerance/metrics'
POINTING_ERROR = 'pointing/error'
POINTING_REFERENCE = 'pointing/reference'
PHASE = 'operator/phase'
DIAGNOSTICS = '/diagnostics'
ROSOUT = '/rosout'

PROBE = 'probe'
"""The frame of joint commands that contain a probe."""

RECORDED = {
    JOINT_STATES: 'sensor_msgs/msg/JointState',
    COMMANDS: 'std_msgs/msg/Float64MultiArray',
    JOINT_COMMANDS: 'sensor_msgs/msg/JointState',
    BRAKE_COMMANDS: 'std_msgs/msg/Float64MultiArray',
    RELEASE_COMMANDS: 'std_msgs/msg/Float64MultiArray',
    STATE: 'std_msgs/msg/String',
    STATUS: 'diagnostic_msgs/msg/DiagnosticStatus',
    METRICS: 'diagnostic_msgs/msg/DiagnosticArray',
    **{f'{METRICS}/{name}': 'std_msgs/msg/Float64' for name in SCALARS},
    **{f'{METRICS}/{name}': 'std_msgs/msg/Float64MultiArray' for name in ARRAYS.values()},
    'fault_tolerance/task_velocity': 'geometry_msgs/msg/TwistStamped',
    'fault_tolerance/achieved_velocity': 'geometry_msgs/msg/TwistStamped',
    'fault_tolerance/platform_pose': 'geometry_msgs/msg/PoseStamped',
    'fault_tolerance/markers': 'visualization_msgs/msg/MarkerArray',
    'fsm/inject_fault': 'std_msgs/msg/String',
    'fsm/mirror_pose': 'geometry_msgs/msg/PoseStamped',
    'fsm/mirror_velocity': 'geometry_msgs/msg/TwistStamped',
    'fsm/markers': 'visualization_msgs/msg/MarkerArray',
    POINTING_ERROR: 'geometry_msgs/msg/Vector3Stamped',
    POINTING_REFERENCE: 'geometry_msgs/msg/Vector3Stamped',
    PHASE: 'std_msgs/msg/String',
    DIAGNOSTICS: 'diagnostic_msgs/msg/DiagnosticArray',
    ROSOUT: 'rcl_interfaces/msg/Log',
}
"""Types by name; a name that does not begin with a slash is relative to the robot's namespace."""

_READ = (
    *(JOINT_STATES, COMMANDS, JOINT_COMMANDS, STATE, STATUS, METRICS),
    *(POINTING_ERROR, POINTING_REFERENCE, PHASE),
    *(f'{METRICS}/{name}' for name in (*SCALARS, ARRAYS['position'])),
)


def split(topic: str) -> tuple[str, str] | None:
    """Return namespace (empty, or with a leading slash) and relative name of a full ``topic``.

    None for a topic of which nothing is read, or that belongs to no robot.
    """
    for name in _READ:
        if topic.endswith(f'/{name}'):
            return topic[: -len(name) - 1], name
    return None


def renamed(topic: str, node: str) -> str:
    """Return a ``topic`` of the controller, or the simulator, where it is named ``node``."""
    return f'{node}/{topic.partition("/")[2]}'


def labels_in(message: Any) -> list[str]:
    """Return the names of the numbers in a ``message`` on one of the `ARRAYS`."""
    return [name for one in message.layout.dim for name in one.label.split(',') if name]


def is_read(topic: str) -> bool:
    """Return whether anything is read from a full ``topic``."""
    return topic == DIAGNOSTICS or split(topic) is not None
