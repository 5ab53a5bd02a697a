# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Launch files as launch sees them, and launched for real."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

EXECUTABLES = ('controller', 'fsm_simulator', 'pointing_reference')
PATIENCE = 30.0

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


def entities(file: Path, **given: str):
    """Return the nodes that a launch file describes with the arguments ``given``."""
    from launch import LaunchContext
    from launch.launch_description_sources import get_launch_description_from_python_launch_file

    description = get_launch_description_from_python_launch_file(str(file))
    context = LaunchContext()
    for argument in description.get_launch_arguments():
        argument.execute(context)
    context.launch_configurations.update(given)
    return description.entities[-1].visit(context) or []


class Launched:
    """A launch file that runs with the ``words`` of its command line; ended whatever happens."""

    def __init__(self, file: Path, prefix: Path, folder: Path, *words: str) -> None:
        path = os.pathsep.join([str(prefix), os.environ.get('AMENT_PREFIX_PATH', '')])
        root = str(Path(__file__).parents[2])
        python = os.pathsep.join([root, os.environ.get('PYTHONPATH', '')])
        self._log = folder / 'launch.log'
        with self._log.open('w') as log:
            self.process = subprocess.Popen(
                [sys.executable, '-c', RUN, str(file), *words],
                env={**os.environ, 'AMENT_PREFIX_PATH': path, 'PYTHONPATH': python,
                     'ROS_LOG_DIR': str(folder / 'log')},
                start_new_session=True, stdout=log, stderr=subprocess.STDOUT,
            )

    @property
    def output(self) -> str:
        """Everything that was printed so far."""
        return self._log.read_text()

    def __enter__(self) -> Launched:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        print(self.output)
