# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Build script for colcon and for pip; names and version come from package.xml."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.develop import develop
from setuptools.command.install_scripts import install_scripts

HERE = Path(__file__).resolve().parent
MANIFEST = ElementTree.parse(HERE / 'package.xml').getroot()
NAME = MANIFEST.findtext('name')
SHARE = Path('share') / NAME


def shared_files(folder):
    """Return the `data_files` entries that put a folder of the checkout under share/NAME."""
    files_of = {}
    for file in sorted((HERE / folder).rglob('*')):
        if file.is_file() and '__pycache__' not in file.parts:
            relative = file.relative_to(HERE)
            files_of.setdefault(str(SHARE / relative.parent), []).append(str(relative))
    return list(files_of.items())


def named_for_ros2_run(command):
    """Return a setuptools command whose scripts are without the name of the package before them.

    colcon installs with these commands: `ros2 run fault_tolerance controller`. pip makes its own
    scripts, for everybody's PATH: `fault_tolerance_controller`.
    """
    class Named(command):
        def write_script(self, script_name, *content):
            super().write_script(script_name.removeprefix(f'{NAME}_'), *content)

    return Named


setup(
    name=NAME,
    version=MANIFEST.findtext('version'),
    description=MANIFEST.findtext('description'),
    maintainer=MANIFEST.findtext('maintainer'),
    maintainer_email=MANIFEST.find('maintainer').get('email'),
    license=MANIFEST.findtext('license'),
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={NAME: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (str(SHARE), ['package.xml']),
        *shared_files('config'),
        *shared_files('launch'),
        *shared_files('security'),
    ],
    python_requires='>=3.10',
    install_requires=[
        'numba>=0.58',
        'numpy>=1.26',
        'PyYAML',
        'rich',
        'scipy>=1.11',
    ],
    extras_require={
        # rclpy and its middleware as wheels, for a machine without an apt installation of ROS 2.
        'ros': [
            'ros-rclpy[fastrtps]==7.1.6',
            'ros-common-interfaces==5.3.6',
        ],
        'plot': ['matplotlib'],
        # Another engine for the simulated mechanism.
        'mujoco': ['mujoco>=3.3.6'],
        # Recordings as ROS 2 bags, without ROS.
        'record': ['rosbags>=0.11'],
        # Other workers than processes of this machine.
        'dask': ['distributed'],
        'mpi': ['mpi4py'],
        # colcon looks for pytest under this name to decide that it can test the package.
        'test': [
            'pytest>=7.4',
            'hypothesis',
            'mujoco>=3.3.6',
            # Somebody else's reader, to check what is recorded.
            'mcap-ros2-support',
            'colcon-bash',
            'colcon-core',
            'colcon-library-path',
            'colcon-ros',
            'colcon-test-result',
            'setuptools',
            'wheel',
        ],
        # Peers to compare speed with; each is optional.
        'bench': [
            'matplotlib',
            'mink',
            'mujoco',
            'pin',
            'pin-pink',
        ],
        'dev': [
            'mypy',
            'ruff',
            'scipy-stubs; python_version >= "3.11"',
            'types-PyYAML',
        ],
    },
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'fault_tolerance_controller = fault_tolerance.nodes.controller:main',
            'fault_tolerance_fsm_simulator = fault_tolerance.nodes.fsm_simulator:main',
            'fault_tolerance_drive_reports = fault_tolerance.nodes.drive_reports:main',
            'fault_tolerance_pointing_reference = fault_tolerance.nodes.pointing_reference:main',
            'fault_tolerance = fault_tolerance.cli:main',
        ],
    },
    cmdclass={
        'develop': named_for_ros2_run(develop),
        'install_scripts': named_for_ros2_run(install_scripts),
    },
)
