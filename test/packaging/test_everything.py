# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""`make test` runs each test once, side by side where it may, and leaves out nothing."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from everything import LONGEST, groups

TEST_FOLDER = Path(__file__).resolve().parents[1]
TIMED = ('import pytest\n\n@pytest.mark.timed\ndef test_that_takes_time():\n    pass\n\n'
         '@pytest.mark.paced\ndef test_that_keeps_pace():\n    pass\n\n')
PASSES = 'def test_that_passes():\n    pass\n\n'
FAILS = 'def test_that_fails():\n    assert 1 == 2\n'
CHECKED = ('import os, pytest\n\ndef test_environment():\n'
           "    assert os.environ['ROS_PYTHON_CHECK_FIELDS'] == '1'\n\n"
           '@pytest.mark.timed\ndef test_time():\n'
           "    assert 'ROS_PYTHON_CHECK_FIELDS' not in os.environ\n\n"
           '@pytest.mark.paced\ndef test_pace():\n'
           "    assert 'ROS_PYTHON_CHECK_FIELDS' not in os.environ\n"
           "    open('kept', 'w').close()\n")
GIVES_WAY = ('import os, time\n\ndef test_that_it_gives_way():\n'
             "    open('given', 'w').close()\n"
             '    end = time.monotonic() + 60.0\n'
             "    while not os.path.exists('kept') and time.monotonic() < end:\n"
             '        assert os.sched_getscheduler(0) == os.SCHED_IDLE\n'
             '        time.sleep(0.01)\n')
# Those that others give way to end later, here.
HAS_ITS_WAY = ('import os, time\n\ndef test_that_it_does_not():\n'
               '    assert os.sched_getscheduler(0) != os.SCHED_IDLE\n'
               '    end = time.monotonic() + 60.0\n'
               "    while not os.path.exists('given') and time.monotonic() < end:\n"
               '        time.sleep(0.05)\n\n')
SKIPS = "import pytest\n\ndef test_it():\n    pytest.skip('not today')\n"
ENDS = 'import os\nos._exit(0)\n'


@pytest.fixture
def run_everything(tmp_path):
    """Return a function that runs what `make test` runs on folders with one module each."""
    tests = tmp_path / 'test'

    def run(*arguments, table='', **sources):
        for name, source in {'ros': TIMED + PASSES, 'core': PASSES, 'system': PASSES,
                             'packaging': PASSES, **sources}.items():
            (tests / name).mkdir(parents=True, exist_ok=True)
            (tests / name / f'test_of_{name}.py').write_text(source)
        (tmp_path / 'docs').mkdir()
        (tmp_path / 'docs' / 'robustness.md').write_text(table)
        shutil.copy(TEST_FOLDER / 'everything.py', tests)
        kept = {name: value for name, value in os.environ.items()
                if name not in ('ROS_PYTHON_CHECK_FIELDS', 'FAULT_TOLERANCE_PARTS')}
        return subprocess.run(
            [sys.executable, tests / 'everything.py', *arguments],
            env={**kept, 'PYTEST_ADDOPTS': '-p no:cacheprovider -W ignore',
                 'PYTEST_DISABLE_PLUGIN_AUTOLOAD': '1'},
            capture_output=True, text=True, check=False)

    return run


def last_line(result):
    line = result.stdout.splitlines()[-1]
    # As .ci/run looks for it.
    assert re.search(r'^=+ .* in [0-9.]+s.* =+$', line), result.stdout
    return line


def test_every_test_runs_once_checked_or_timed_and_politely_without_nodes(run_everything):
    table = ''.join(f'`{name}/test_of_{name}.py::test_that_passes`' for name in ('system', 'new'))
    result = run_everything(core=GIVES_WAY, ros=CHECKED, new=PASSES,
                            system=HAS_ITS_WAY + PASSES, table=table)
    assert result.returncode == 0, result.stdout + result.stderr
    assert ' 8 passed in ' in last_line(result)
    assert result.stdout.count('test/ros/test_of_ros.py .') == 3
    for name in ('core', 'system', 'packaging', 'new'):
        assert result.stdout.count(f'test/{name}/test_of_{name}.py .') == 1


def test_a_failure_of_any_part_counts_and_so_does_what_the_table_names(run_everything):
    table = '`core/test_of_core.py::test_that_fails` `core/test_of_core.py::test_that_passes`'
    result = run_everything(ros=TIMED + FAILS, core=PASSES + FAILS, table=table)
    assert result.returncode == 1, result.stdout
    assert ' 2 failed, 5 passed, 1 error in ' in last_line(result)
    assert 'assert 1 == 2' in result.stdout
    assert 'not passed: core/test_of_core.py::test_that_fails\n' in result.stdout
    assert 'not passed: core/test_of_core.py::test_that_passes' not in result.stdout


def fails_once(count):
    """Return a module of ``count`` tests that fail when they run first."""
    return ('import pathlib, pytest\n\n'
            f'@pytest.mark.parametrize("number", range({count}))\n'
            'def test_that_fails_once(number):\n'
            "    tried = pathlib.Path(f'tried_{number}')\n"
            '    first = not tried.exists()\n'
            '    tried.touch()\n'
            '    assert not first\n\n')


def test_what_fails_beside_others_runs_again_alone_and_is_named(run_everything):
    table = '`ros/test_of_ros.py::test_that_fails_once`'
    result = run_everything(ros=TIMED + PASSES + fails_once(1), table=table)
    assert result.returncode == 0, result.stdout
    name = 'test/ros/test_of_ros.py::test_that_fails_once[0]'
    assert f'\nfailed beside others, passed alone: {name}\n' in result.stdout
    assert ' 7 passed in ' in last_line(result)


@pytest.mark.parametrize('sources', [
    {'core': fails_once(1)}, {'ros': TIMED + FAILS}, {'ros': TIMED + fails_once(4)},
], ids=['without nodes', 'twice', 'several'])
def test_what_fails_again_or_without_nodes_has_failed(run_everything, sources):
    result = run_everything(**sources)
    assert result.returncode == 1, result.stdout
    assert ' failed, ' in last_line(result)


@pytest.mark.parametrize('turn', range(2))
def test_a_part_that_runs_nothing_fails(run_everything, turn):
    sources = ['', ENDS, SKIPS]
    result = run_everything(**{
        name: sources[(turn + place) % 3]
        for place, name in enumerate(('ros', 'core', 'system', 'packaging'))
    })
    assert result.returncode == 1, result.stdout
    for name in ('packaging', 'nodes', 'others', 'core', 'paced', 'timed'):
        assert f'\n{name}: ended without a result, or nothing has run\n' in result.stdout
    assert 'passed' not in last_line(result)


def test_fixtures_of_a_folder_end_where_the_next_module_is_taken_by_another(run_everything,
                                                                            tmp_path):
    """Modules take turns in their order; each folder is set up and left by whoever is in it."""
    source = ('import pytest, time\n\n@pytest.fixture(scope="package", autouse=True)\n'
              'def folder():\n    yield\n\n@pytest.mark.parametrize("n", range(3))\n'
              'def test_it(n):\n    time.sleep(0.02)\n')
    for number in range(12):
        folder = tmp_path / 'test' / 'core' / f'part_{number % 3}'
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f'test_{number}.py').write_text(source)
    result = run_everything()
    assert result.returncode == 0, result.stdout
    assert f' {12 * 3 + 6} passed in ' in last_line(result)


def test_arguments_are_passed_on(run_everything):
    # What does not run then need not.
    table = '`core/test_of_core.py::test_that_fails`'
    result = run_everything('-k', 'passes', core=PASSES + FAILS, table=table)
    assert result.returncode == 0, result.stdout
    assert ' 4 passed in ' in last_line(result)


def test_every_module_belongs_to_one_group():
    side_by_side, paced, alone = groups()
    modules = [name for group in side_by_side for name in group.modules]
    assert sorted(modules) == sorted(
        str(path.relative_to(TEST_FOLDER.parent)) for path in TEST_FOLDER.rglob('test_*.py'))
    assert {group.name for group in side_by_side} == {'packaging', 'nodes', 'others', 'core'}
    for one in (paced, alone):
        assert set() < set(one.modules) < set(modules)
    assert {f'test/{name}' for name in LONGEST} <= set(modules)
