# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller of a machine; on request its drives' reports, a reference, or a simulator."""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import get_package_prefix
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PACKAGE = 'fault_tolerance'
CONFIG = Path(__file__).resolve().parent.parent / 'config'
ARGUMENTS = (
    ('mechanism', '', 'a shipped mechanism or a file; empty: that of the parameter files'),
    ('namespace', '', 'namespace of the nodes'),
    ('use_sim_time', 'false', 'take the time from /clock'),
    ('params_file', '', 'parameters that override the shipped ones'),
    ('log_level', 'info', 'debug, info, warn, error or fatal'),
    ('respawn', 'true', 'start a node that has died again, after a second'),
    ('rules', '', 'of the node drive_reports: a profile or a file; empty: without that node'),
    ('pointing', 'false', 'follow a reference as well'),
    ('pose_topic', 'fault_tolerance/platform_pose',
     'where the reference node learns the pose; empty: that of the parameter files'),
    ('simulator', 'false', 'simulate the machine as well, as fsm.launch.py does'),
    ('engine', '', 'elastic or mujoco simulates it; empty: that of the parameter files'),
)
BAD_SET_UP = 2
"""Exit code of a node that cannot start: another attempt would be in vain."""


def generate_launch_description() -> LaunchDescription:
    """Return the nodes, with their arguments."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, text in ARGUMENTS
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    chosen = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    given: dict[str, object] = {'use_sim_time': _is_true(chosen['use_sim_time'])}
    if chosen['mechanism']:
        given['mechanism'] = chosen['mechanism']
    files = [chosen['params_file']] if chosen['params_file'] else []
    # Clearing failures resets drives, where the rules say how.
    resets = [{'reset_service': 'drive_reports/reset'}] if chosen['rules'] else []
    wanted: list[tuple[str, str, list[object]]] = [
        ('controller', 'fault_tolerance',
         [str(CONFIG / 'controller.yaml'), *resets, *files, given]),
    ]
    if _is_true(chosen['simulator']):
        engine = {'engine': chosen['engine']} if chosen['engine'] else {}
        shipped = str(CONFIG / 'fsm.yaml')
        wanted.append(('fsm_simulator', 'fsm', [shipped, *files, {**given, **engine}]))
    if chosen['rules']:
        executable = Path(get_package_prefix(PACKAGE), 'lib', PACKAGE, 'drive_reports')
        if not executable.exists():
            raise RuntimeError('this installation has no drive_reports: leave out rules:=')
        rules = {**given, 'rules': chosen['rules']}
        wanted.append(('drive_reports', 'drive_reports', [*files, rules]))
    if _is_true(chosen['pointing']):
        pose = {'pose_topic': chosen['pose_topic']} if chosen['pose_topic'] else {}
        pointing = {**given, **pose}
        shipped = str(CONFIG / 'pointing.yaml')
        wanted.append(('pointing_reference', 'pointing', [shipped, *files, pointing]))
    return [
        Node(
            package=PACKAGE,
            executable=executable,
            name=name,
            namespace=chosen['namespace'],
            # The later ones win: what is typed, what is in the user's file, what is shipped.
            parameters=parameters,
            arguments=['--ros-args', '--log-level', chosen['log_level']],
            output='screen',
            respawn=_is_true(chosen['respawn']),
            respawn_delay=1.0,
            on_exit=OpaqueFunction(
                function=_ended, args=[executable, _is_true(chosen['respawn'])]),
        )
        for executable, name, parameters in wanted
    ]


def _ended(context: LaunchContext, executable: str, respawns: bool) -> None:
    """End the launch with an error code where a node cannot start, or is not started again."""
    code = context.locals.event.returncode
    if code == BAD_SET_UP:
        raise RuntimeError(f'{executable} cannot start, see above')
    if code > 0 and not respawns:
        raise RuntimeError(f'{executable} ended with exit code {code}')


def _is_true(word: str) -> bool:
    return word.lower() in ('true', '1', 'yes', 'on')
