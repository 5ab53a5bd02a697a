# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The launch file starts the three nodes with what it is told, under the real launch."""

from __future__ import annotations

import signal
import time

import pytest
from launch_cases import PATIENCE, Launched, entities

from fault_tolerance.resources import share_directory

ROOT = share_directory()
LAUNCH = ROOT / 'launch' / 'fsm.launch.py'
pytestmark = pytest.mark.needs_launch

def test_it_says_which_arguments_it_takes():
    from launch.launch_description_sources import get_launch_description_from_python_launch_file

    description = get_launch_description_from_python_launch_file(str(LAUNCH))
    names = [argument.name for argument in description.get_launch_arguments()]
    assert names[:7] == [
        'mechanism', 'namespace', 'use_sim_time', 'params_file', 'engine', 'log_level', 'rviz']


@pytest.mark.parametrize(('given', 'wanted'), [('false', []), ('true', ['rviz2']),
                                               ('True', ['rviz2'])])
def test_rviz_comes_on_request(given, wanted):
    nodes = entities(LAUNCH, rviz=given)
    assert [node.node_package for node in nodes] == wanted


def test_it_starts_the_nodes_as_told_and_ends_them(prefix, tmp_path):
    parameters = tmp_path / 'mine.yaml'
    parameters.write_text(
        '/**:\n  ros__parameters:\n    report_timeout: 1.5\n    amplitude: 0.002\n'
    )
    words = ('mechanism:=fsm_4_strut', 'namespace:=robot', f'params_file:={parameters}',
             'log_level:=warn', 'engine:=elastic')
    with Launched(LAUNCH, prefix, tmp_path, *words) as launched:
        _as_told(launched.process)


def _as_told(launch):
    import rclpy
    from rcl_interfaces.srv import GetParameters
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from std_msgs.msg import String

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
        assert parameter('engine', 'fsm').string_value == 'elastic'
        assert parameter('lead', 'pointing').double_value == 0.016
        launch.send_signal(signal.SIGINT)
        assert launch.wait(PATIENCE) == 0
    finally:
        node.destroy_node()
        rclpy.shutdown()
