# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The house rules of docs/architecture.md that imports show."""

import ast
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / 'fault_tolerance'

# Doors lead downwards only: to a lower number, or to another module of the same folder.
LAYERS = {
    'errors': 0,
    'executors': 1,
    'resources': 0,
    'tolerances': 0,
    'mechanism': 2,
    'kernel': 3,
    'kinematics': 3,
    'analysis': 4,
    'commissioning': 4,
    'control': 4,
    'detection': 4,
    'drive_rules': 4,
    'simulation': 4,
    'task_priority': 4,
    'closed_loop': 5,
    'design': 5,
    'machines': 5,
    'replay': 6,
    '__init__': 6,
    'campaign': 7,
    'commands': 7,
    'design_commands': 8,
    'nodes': 7,
    'arguments': 8,
    'design_cli': 9,
    'machine_commands': 8,
    'machine_cli': 9,
    'cli': 10,
    '__main__': 11,
}
PURE = (
    'commissioning', 'machines', 'mechanism', 'kinematics', 'control', 'drive_rules', 'simulation',
)
OUTSIDE_WORLD = {'asyncio', 'datetime', 'logging', 'multiprocessing', 'os', 'random', 'socket',
                 'subprocess', 'sys', 'threading', 'time'}
ROS = {'ament_index_python', 'launch', 'launch_ros', 'launch_testing', 'rclpy', 'ros2cli',
       'rosidl_runtime_py', 'tf2_ros'}


def is_ros(name: str) -> bool:
    root = name.partition('.')[0]
    return root in ROS or root.endswith(('_msgs', '_interfaces', '_srvs'))


def imported(path: Path) -> set[str]:
    """Return the full names of all modules that the file imports, anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: imports are absolute here'
            names.add(node.module)
            # from package import module
            names.update(f'{node.module}.{alias.name}' for alias in node.names)
        elif isinstance(node, ast.Call) and node.args:
            called = getattr(node.func, 'attr', getattr(node.func, 'id', ''))
            first = node.args[0]
            if called in ('import_module', '__import__') and isinstance(first, ast.Constant):
                names.add(first.value)
    return names


def layer_of(module: str) -> str:
    """Return the room of ``fault_tolerance.room...``; names of the façade are its own room."""
    parts = module.split('.')
    return parts[1] if len(parts) > 1 and parts[1] in LAYERS else '__init__'


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix('.py')


@cache
def imports():
    """Return what every module of the package imports."""
    return {path: imported(path) for path in sorted(PACKAGE.rglob('*.py'))}


def offences(wrong, rooms=tuple(LAYERS)):
    """Return what in the ``rooms`` imports something ``wrong`` says is wrong."""
    return [
        f'{path.relative_to(ROOT)} imports {name}'
        for path, names in imports().items()
        for name in sorted(names)
        if room(path) in rooms and wrong(room(path), name)
    ]


def test_every_room_has_its_floor():
    assert {room(path) for path in imports()} <= set(LAYERS)


def test_every_file_has_a_name_of_its_own():
    stems = [path.stem for path in imports() if not path.stem.startswith('__')]
    assert sorted(set(stems)) == sorted(stems)


def test_doors_lead_downwards():
    """So what is on one floor stays apart: commissioning, control, simulation and analysis; the
    kernel and the definitions that it is compared with."""
    def upwards(own, name):
        # Names of the façade stand behind the dot.
        if not name.startswith(f'{PACKAGE.name}.'):
            return False
        other = layer_of(name)
        return other != own and LAYERS[other] >= LAYERS[own]

    assert offences(upwards) == []


def test_only_nodes_know_ros():
    elsewhere = tuple(name for name in LAYERS if name != 'nodes')
    assert offences(lambda _, name: is_ros(name), elsewhere) == []


def test_simulation_knows_geometry_only():
    """It never uses J or T, so that it can prove the controller wrong."""
    def kinematics(_, name):
        return name.startswith('fault_tolerance.kinematics')

    assert offences(kinematics, ('simulation',)) == []


def test_the_core_has_no_clock_and_no_log():
    assert offences(lambda _, name: name in OUTSIDE_WORLD, PURE) == []


def test_the_kernel_is_plain_loops_that_know_of_no_compiler():
    """But for the one module that compiles them, and its command."""
    makers = ('compilation.py', '__main__.py')
    allowed = {'__future__', 'dataclasses', 'functools', 'math', 'numpy', 'typing', PACKAGE.name}
    for path, names in imports().items():
        roots = {name.partition('.')[0] for name in names}
        if room(path) == 'kernel' and path.name not in makers:
            assert roots <= allowed, path
        assert 'numba' not in roots or path.name == 'compilation.py', path


@pytest.mark.parametrize('folder', ['examples', 'test/core'])
def test_examples_and_core_tests_do_without_ros(folder):
    for path in sorted((ROOT / folder).rglob('*.py')):
        assert not [name for name in imported(path) if is_ros(name)], path


def test_the_walk_finds_every_way_to_import(tmp_path):
    path = tmp_path / 'module.py'
    path.write_text(
        'import rclpy.node as n\n'
        'def f():\n'
        '    from std_msgs.msg import String\n'
        '    from fault_tolerance import cli\n'
        'm = importlib.import_module("launch")\n'
        'k = __import__("sensor_msgs")\n'
    )
    found = imported(path)
    assert {'rclpy.node', 'std_msgs.msg', 'launch', 'sensor_msgs', 'fault_tolerance.cli'} <= found
    assert sum(is_ros(name) for name in found) == 5
    assert layer_of('fault_tolerance.cli') == 'cli'
    assert layer_of('fault_tolerance.strut_rows') == '__init__'


WITHOUT_ROS = '''
import importlib, pkgutil, sys

class Refuse:
    """Let nothing of ROS be imported, installed or not."""
    def find_spec(self, name, path=None, target=None):
        root = name.partition('.')[0]
        if root in {ros!r} or root.endswith(('_msgs', '_interfaces', '_srvs')):
            raise ModuleNotFoundError(f'{{name}} is refused here', name=name)
        return None

sys.meta_path.insert(0, Refuse())
try:
    import rclpy
except ModuleNotFoundError:
    pass
else:
    raise SystemExit('rclpy came in')

import fault_tolerance
count = 0
for module in pkgutil.walk_packages(fault_tolerance.__path__, 'fault_tolerance.'):
    if module.name.startswith('fault_tolerance.nodes') or module.name.endswith('__main__'):
        continue
    try:
        importlib.import_module(module.name)
    except ModuleNotFoundError as error:
        # Drawing, recording and compiling are extras.
        if error.name.partition('.')[0] not in ('matplotlib', 'rosbags', 'numba'):
            raise
    count += 1
from fault_tolerance.cli import main
code = main(['measures', 'fsm_4_strut', '--failed', 'stuck:theta_4', '--json'])
print(count, 'modules', file=sys.stderr)
sys.exit(code)
'''


def test_the_core_and_the_command_line_run_without_ros():
    environment = {name: value for name, value in os.environ.items() if name != 'PYTHONPATH'}
    environment['PYTHONPATH'] = str(ROOT)
    done = subprocess.run(
        [sys.executable, '-c', WITHOUT_ROS.format(ros=sorted(ROS))],
        capture_output=True, text=True, env=environment, timeout=60, check=False,
    )
    assert done.returncode == 0, done.stderr
    assert '"tolerable": true' in done.stdout
    outside = [path for path in imports() if room(path) not in ('nodes', '__init__')
               and path.stem != '__main__']
    assert done.stderr.split()[-2:] == [str(len(outside)), 'modules']
