# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A simulated fast steering mirror, its controller, and a reference for it to follow."""

from __future__ import annotations

from pathlib import Path

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(__file__).resolve().parent.parent / 'config'
NODES = (
    ('fsm_simulator', 'fsm', 'fsm.yaml'),
    ('controller', 'fault_tolerance', 'controller.yaml'),
    ('pointing_reference', 'pointing', 'pointing.yaml'),
)
ARGUMENTS = (
    ('mechanism', '', 'a shipped mechanism or a file; empty: that of the parameter files'),
    ('namespace', '', 'namespace of all three nodes'),
    ('use_sim_time', 'false', 'take the time from /clock'),
    ('params_file', '', 'parameters that override the shipped ones'),
    ('engine', '', 'elastic or mujoco simulates the mirror; empty: that of the parameter files'),
    ('log_level', 'info', 'debug, info, warn, error or fatal'),
    ('rviz', 'false', 'look at the mirror in RViz as well'),
)


def generate_launch_description() -> LaunchDescription:
    """Return the nodes, with their arguments."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, text in ARGUMENTS
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    chosen = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    given: dict[str, object] = {'use_sim_time': chosen['use_sim_time'].lower() == 'true'}
    if chosen['mechanism']:
        given['mechanism'] = chosen['mechanism']
    engine = {'engine': chosen['engine']} if chosen['engine'] else {}
    files = [chosen['params_file']] if chosen['params_file'] else []
    nodes: list[LaunchDescriptionEntity] = [
        Node(
            package='fault_tolerance',
            executable=executable,
            name=name,
            namespace=chosen['namespace'],
            # The later ones win: what is typed, what is in the user's file, what is shipped.
            parameters=[
                str(CONFIG / shipped), *files, given, engine if name == 'fsm' else {}
            ],
            arguments=['--ros-args', '--log-level', chosen['log_level']],
            output='screen',
            on_exit=OpaqueFunction(function=_ended, args=[executable]),
        )
        for executable, name, shipped in NODES
    ]
    if chosen['rviz'].lower() == 'true':
        nodes.append(_rviz(chosen['namespace'], given['use_sim_time']))
    return nodes


def _ended(context: LaunchContext, executable: str) -> None:
    """End the launch with an error code where a node could not start or has died."""
    code = context.locals.event.returncode
    if code > 0:
        raise RuntimeError(f'{executable} ended with exit code {code}')


def _rviz(namespace: str, use_sim_time: object) -> Node:
    """Return RViz, with the markers of the simulated mirror in ``namespace``."""
    markers = '/'.join(['', *filter(None, [namespace.strip('/')]), 'fsm', 'markers'])
    return Node(
        package='rviz2',
        executable='rviz2',
        name='rviz',
        namespace=namespace,
        parameters=[{'use_sim_time': use_sim_time}],
        remappings=[('/fsm/markers', markers)],
        arguments=['-d', str(CONFIG / 'fsm.rviz'), '--ros-args', '--log-level', 'warn'],
        output='screen',
    )
