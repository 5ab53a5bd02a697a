# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""package.xml, setup.py and the changelog say the same, and say what the code needs."""

import ast
import importlib.metadata
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = ElementTree.parse(ROOT / 'package.xml').getroot()

# Where the name of an apt package differs from what Python imports.
ROSDEP_KEY_OF = {
    'matplotlib': 'python3-matplotlib',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'rich': 'python3-rich',
    'scipy': 'python3-scipy',
    'yaml': 'python3-yaml',
}
REQUIREMENT_OF = {'yaml': 'PyYAML'}
# Extras of the pip package, not to be counted on as apt packages of Ubuntu 24.04; never needed.
PIP_ONLY = {'distributed': 'dask', 'mpi4py': 'mpi', 'mujoco': 'mujoco', 'rosbags': 'record'}


def imported_names(folder):
    """Return the top-level packages that the files of a folder import from elsewhere."""
    names = set()
    for file in folder.rglob('*.py'):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                names.update(alias.name.partition('.')[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names.add(node.module.partition('.')[0])
    return names - set(sys.stdlib_module_names) - {'fault_tolerance'}


@pytest.fixture(scope='module')
def distribution():
    return importlib.metadata.distribution('fault_tolerance')


def test_one_version(distribution):
    version = MANIFEST.findtext('version')
    headings = re.findall(r'^(\S+) \(\d{4}-\d\d-\d\d\)\n-+$',
                          (ROOT / 'CHANGELOG.rst').read_text(), flags=re.MULTILINE)
    assert headings[0] == version
    assert distribution.version == version


def test_version_is_written_in_one_place():
    version = MANIFEST.findtext('version')
    for file in (ROOT / 'setup.py', ROOT / 'setup.cfg', ROOT / 'pyproject.toml',
                 *(ROOT / 'fault_tolerance').rglob('*.py')):
        for line in file.read_text().splitlines():
            assert not ('version' in line.lower() and version in line), (file, line)


def test_every_import_is_declared_to_rosdep():
    declared = {element.text for element in MANIFEST.iter('exec_depend')}
    used = {ROSDEP_KEY_OF.get(name, name)
            for folder in ('fault_tolerance', 'launch') for name in imported_names(ROOT / folder)}
    assert used - declared - set(PIP_ONLY) == set()


def test_every_library_is_declared_to_pip(distribution):
    """The ROS packages are the extra `ros`; every library is required or the extra `plot`."""
    required = {re.split(r'[^\w-]', line)[0] for line in distribution.requires
                if 'extra ==' not in line or re.search(r'extra == .plot\b', line)}
    used = {REQUIREMENT_OF.get(name, name) for name in imported_names(ROOT / 'fault_tolerance')
            if name in ROSDEP_KEY_OF}
    assert used == required


@pytest.mark.parametrize(('name', 'extra'), PIP_ONLY.items())
def test_what_is_optional_is_an_extra(distribution, name, extra):
    lines = [line for line in distribution.requires if re.match(rf'{name}\b', line)]
    assert any(re.search(rf'extra == .{extra}\b', line) for line in lines)
    assert all('extra ==' in line for line in lines)


def test_ros_extra_is_pinned(distribution):
    ros = [line for line in distribution.requires if re.search(r'extra == .ros\b', line)]
    assert len(ros) == 2
    assert all('==' in line.partition(';')[0] for line in ros)


@pytest.mark.parametrize('script', [
    'fault_tolerance_controller', 'fault_tolerance_fsm_simulator',
    'fault_tolerance_drive_reports', 'fault_tolerance_pointing_reference',
    'fault_tolerance'])
def test_console_script_leads_to_a_function(distribution, script):
    point, = distribution.entry_points.select(group='console_scripts', name=script)
    assert callable(point.load())


def test_manifest_is_for_ament_python():
    assert MANIFEST.get('format') == '3'
    assert MANIFEST.findtext('export/build_type') == 'ament_python'
    assert (ROOT / 'resource' / MANIFEST.findtext('name')).is_file()
    licence = MANIFEST.find('license')
    assert licence.text == 'Apache-2.0'
    assert 'Apache License' in (ROOT / licence.get('file')).read_text()


def test_pipeline_runs_the_command_of_the_readme():
    command = 'make test'
    assert re.search(rf'^\s*{command}\b', (ROOT / 'README.md').read_text(), flags=re.MULTILINE)
    assert re.search(rf'^{command}\b', (ROOT / '.ci' / 'run').read_text(), flags=re.MULTILINE)
