# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""colcon builds, tests and installs the package, and what it installs runs as a node."""

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

pytestmark = pytest.mark.slow

COLCON = [sys.executable, '-c',
          'import sys; from colcon_core.command import main; sys.exit(main())']


class Workspace:
    """A colcon workspace in a scratch folder, with the copy of the checkout in it."""

    def __init__(self, folder, source, environment):
        self.folder = folder
        self.source = source
        self.environment = environment

    @property
    def prefix(self):
        return self.folder / 'install' / 'fault_tolerance'

    def run(self, verb, *arguments):
        """Run colcon with this interpreter."""
        return subprocess.run(
            [*COLCON, verb, '--base-paths', self.source,
             '--event-handlers', 'console_direct+', *arguments],
            cwd=self.folder, env=self.environment, text=True, check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

    def sourced(self, *command):
        """Return the command line that runs something in the sourced workspace."""
        return ['bash', '-c', f'source install/setup.bash && exec {shlex.join(map(str, command))}']

    def output(self, *command):
        run = subprocess.run(self.sourced(*command), cwd=self.folder, env=self.environment,
                             capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stderr
        return run.stdout


@pytest.fixture(scope='module', params=['copied', 'linked'])
def workspace(request, source, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    kept = {name: value for name, value in os.environ.items() if name != 'PYTEST_ADDOPTS'}
    # Code that is installed anew is compiled anew, which takes half a minute.
    kept['FAULT_TOLERANCE_KERNEL'] = 'python'
    built = Workspace(folder, source, kept)
    build = built.run('build', *(['--symlink-install'] if request.param == 'linked' else []))
    assert build.returncode == 0, build.stdout
    return built


@pytest.fixture
def states():
    """Yield a function that returns the next state the controller publishes."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node('watcher', context=context)
    executor = rclpy.executors.SingleThreadedExecutor(context=context)
    executor.add_node(node)
    received = []
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(String, '/fault_tolerance/state',
                             lambda message: received.append(message.data), latched)

    def next_state(timeout):
        end = time.monotonic() + timeout
        while not received and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        return received.pop(0) if received else None

    yield next_state
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_everything_lies_where_ros2_looks_for_it(workspace):
    for script in ('controller', 'fsm_simulator', 'pointing_reference', 'drive_reports'):
        folder = workspace.prefix / 'lib' / 'fault_tolerance'
        assert (folder / script).is_file()
        assert not (folder / f'fault_tolerance_{script}').exists()
    share = workspace.prefix / 'share'
    assert (share / 'ament_index/resource_index/packages/fault_tolerance').is_file()
    for name in ('package.xml', 'config/controller.yaml', 'launch/fsm.launch.py',
                 'config/mechanisms/mirror_4_strut.yaml', 'config/rules/cia402.yaml',
                 'config/diagnostic_aggregator/analyzers.yaml', 'security/policy.xml'):
        assert (share / 'fault_tolerance' / name).is_file(), name


def test_installed_code_finds_installed_files(workspace):
    code, share = workspace.output(
        sys.executable, '-c',
        'import fault_tolerance, fault_tolerance.resources as resources\n'
        'print(fault_tolerance.__file__)\nprint(resources.share_directory())').splitlines()
    # --symlink-install runs the sources themselves, where setuptools (before 80) can link to them.
    homes = [workspace.prefix]
    if workspace.folder.name.startswith('linked'):
        homes.append(workspace.source)
    assert any(Path(code).resolve().is_relative_to(home) and Path(share).is_relative_to(home)
               for home in homes), (code, share)


def test_installed_controller_runs(workspace, states):
    controller = workspace.prefix / 'lib' / 'fault_tolerance' / 'controller'
    process = subprocess.Popen(
        workspace.sourced(controller, '--ros-args', '-p', 'mechanism:=mirror_4_strut'),
        cwd=workspace.folder, env=workspace.environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        state = states(timeout=60)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=60)
    finally:
        process.kill()
    assert state == 'waiting', output
    assert process.returncode == 0, output
    assert 'Traceback' not in output


def test_colcon_test_runs_pytest(workspace):
    run = workspace.run('test', '--pytest-args', 'test/packaging/test_resources.py')
    assert run.returncode == 0, run.stdout
    results = workspace.folder / 'build' / 'fault_tolerance' / 'pytest.xml'
    suite = ElementTree.parse(results).find('.//testsuite')
    assert int(suite.get('tests')) >= 5
    assert suite.get('failures') == suite.get('errors') == '0'


@pytest.mark.parametrize('workspace', ['copied'], indirect=True)
def test_colcon_test_that_runs_nothing_fails(workspace):
    """Colcon alone would call it a success."""
    run = workspace.run('test', '--pytest-args', 'test/packaging/test_resources.py',
                        ' -k', 'no_such_name')
    assert run.returncode != 0
    assert 'no test passed' in run.stdout
