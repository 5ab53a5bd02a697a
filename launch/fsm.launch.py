# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A simulated fast steering mirror, with what hardware.launch.py starts for a real one."""

from __future__ import annotations

from pathlib import Path

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(__file__).resolve().parent.parent / 'config'
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
    fixed = {'simulator': 'true', 'pointing': 'true', 'pose_topic': '', 'respawn': 'false'}
    nodes = IncludeLaunchDescription(
        str(CONFIG.parent / 'launch' / 'hardware.launch.py'), launch_arguments=fixed.items())
    rviz = OpaqueFunction(
        function=_rviz, condition=IfCondition(LaunchConfiguration('rviz')))
    return LaunchDescription([*arguments, nodes, rviz])


def _rviz(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return RViz, with the markers of the simulated mirror in its namespace."""
    namespace, use_sim_time = (
        LaunchConfiguration(name).perform(context) for name in ('namespace', 'use_sim_time'))
    markers = '/'.join(['', *filter(None, [namespace.strip('/')]), 'fsm', 'markers'])
    return [Node(
        package='rviz2',
        executable='rviz2',
        name='rviz',
        namespace=namespace,
        parameters=[{'use_sim_time': use_sim_time.lower() == 'true'}],
        remappings=[('/fsm/markers', markers)],
        arguments=['-d', str(CONFIG / 'fsm.rviz'), '--ros-args', '--log-level', 'warn'],
        output='screen',
    )]
