# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The launch file starts the three nodes with what it is told, under the real launch."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fault_tolerance.resources import share_directory

ROOT = share_directory()
LAUNCH = ROOT / 'launch' / 'fsm.launch.py'
EXECUTABLES = ('controller', 'fsm_simulator', 'pointing_reference')
PATIENCE = 30.0

pytestmark = pytest.mark.needs_launch

RUN = """
import sys
from launch import LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
arguments = dict(word.split(':=') for word in sys.argv[2:])
service = LaunchService()
service.include_launch_description(
    __import__('launch').LaunchDescription([
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(sys.argv[1]), launch_arguments=arguments.items())]))
sys.exit(service.run())
"""


@pytest.fixture
def prefix(tmp_path):
    """An installation in which launch finds the executables of this very copy of the code."""
    index = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
    index.mkdir(parents=True)
    (index / 'fault_tolerance').touch()
    folder = tmp_path / 'lib' / 'fault_tolerance'
    folder.mkdir(parents=True)
    for name in EXECUTABLES:
        script = folder / name
        script.write_text(
            f'#!/bin/sh\nexec {sys.executable} -m fault_tolerance.nodes.{name} "$@"\n'
        )
        script.chmod(0o755)
    return tmp_path


def test_it_says_which_arguments_it_takes():
    from launch.launch_description_sources import get_launch_description_from_python_launch_file

    description = get_launch_description_from_python_launch_file(str(LAUNCH))
    names = [argument.name for argument in description.get_launch_arguments()]
    assert names == [
        'mechanism', 'namespace', 'use_sim_time', 'params_file', 'log_level', 'rviz']


@pytest.mark.parametrize(('given', 'wanted'), [('false', 3), ('true', 4), ('True', 4)])
def test_rviz_comes_on_request(given, wanted):
    from launch import LaunchContext
    from launch.launch_description_sources import get_launch_description_from_python_launch_file

    description = get_launch_description_from_python_launch_file(str(LAUNCH))
    context = LaunchContext()
    for argument in description.get_launch_arguments():
        argument.execute(context)
    context.launch_configurations['rviz'] = given
    nodes = description.entities[-1].execute(context)
    assert len(nodes) == wanted
    assert [node.node_package for node in nodes[3:]] == ['rviz2'] * (wanted - 3)


def test_it_starts_the_nodes_as_told_and_ends_them(prefix, tmp_path):
    import rclpy
    from rcl_interfaces.srv import GetParameters
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from std_msgs.msg import String

    parameters = tmp_path / 'mine.yaml'
    parameters.write_text(
        '/**:\n  ros__parameters:\n    report_timeout: 1.5\n    amplitude: 0.002\n'
    )
    path = os.pathsep.join([str(prefix), os.environ.get('AMENT_PREFIX_PATH', '')])
    python = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get('PYTHONPATH', '')])
    launch = subprocess.Popen(
        [
            sys.executable, '-c', RUN, str(LAUNCH), 'mechanism:=fsm_4_strut', 'namespace:=robot',
            f'params_file:={parameters}', 'log_level:=warn',
        ],
        env={**os.environ, 'AMENT_PREFIX_PATH': path, 'PYTHONPATH': python,
             'ROS_LOG_DIR': str(tmp_path / 'log')},
        start_new_session=True,
    )
    rclpy.init(args=[])
    node = rclpy.create_node('probe', enable_rosout=False)
    try:
        states = []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(
            String, '/robot/fault_tolerance/state', lambda message: states.append(message.data),
            latched,
        )

        def wait(condition, what):
            deadline = time.monotonic() + PATIENCE
            while not condition():
                assert launch.poll() is None
                assert time.monotonic() < deadline, f'waited in vain for {what}'
                rclpy.spin_once(node, timeout_sec=0.05)

        def parameter(name, of):
            client = node.create_client(GetParameters, f'/robot/{of}/get_parameters')
            wait(client.service_is_ready, of)
            future = client.call_async(GetParameters.Request(names=[name]))
            wait(future.done, f'{name} of {of}')
            return future.result().values[0]

        wait(lambda: states and states[-1] == 'nominal', 'the nominal state')
        for of in ('fsm', 'fault_tolerance', 'pointing'):
            assert parameter('mechanism', of).string_value == 'fsm_4_strut'
            assert parameter('use_sim_time', of).bool_value is False
        assert parameter('report_timeout', 'fault_tolerance').double_value == 1.5
        assert parameter('amplitude', 'pointing').double_value == 0.002
        assert parameter('lead', 'pointing').double_value == 0.016
        launch.send_signal(signal.SIGINT)
        assert launch.wait(PATIENCE) == 0
    finally:
        node.destroy_node()
        rclpy.shutdown()
        if launch.poll() is None:
            os.killpg(launch.pid, signal.SIGKILL)
            launch.wait()
