# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""`make test` runs its parts beside each other, and leaves nothing out, nor any failure."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TEST_FOLDER = Path(__file__).resolve().parents[1]
PASSES = 'def test_that_passes():\n    pass\n'
FAILS = 'def test_that_fails():\n    assert 1 == 2\n'
CHECKED = ('import os\n\ndef test_environment():\n'
           "    if 'ROS_PYTHON_CHECK_FIELDS' in os.environ:\n"
           "        raise RuntimeError('fields' + ' are checked')\n")
SCHEDULED = 'import os\n\ndef test_how_it_runs():\n    assert os.sched_getscheduler(0) == {}\n'


@pytest.fixture
def run_everything(tmp_path):
    """Return a function that runs what `make test` runs on folders with one module each."""
    tests = tmp_path / 'test'

    def run(*arguments, **sources):
        for name, source in {'ros': PASSES, 'core': PASSES, 'system': PASSES, **sources}.items():
            (tests / name).mkdir(parents=True, exist_ok=True)
            (tests / name / f'test_of_{name}.py').write_text(source)
        shutil.copy(TEST_FOLDER / 'everything.py', tests)
        kept = {name: value for name, value in os.environ.items()
                if name != 'ROS_PYTHON_CHECK_FIELDS'}
        return subprocess.run(
            [sys.executable, tests / 'everything.py', *arguments],
            env={**kept, 'PYTEST_ADDOPTS': '-p no:cacheprovider',
                 'PYTEST_DISABLE_PLUGIN_AUTOLOAD': '1'},
            capture_output=True, text=True, check=False)

    return run


def last_line(result):
    line = result.stdout.splitlines()[-1]
    # As .ci/run looks for it.
    assert re.search(r'^=+ .* in [0-9.]+s.* =+$', line), result.stdout
    return line


def test_nodes_run_twice_and_everything_else_once_and_politely(run_everything):
    result = run_everything(core=SCHEDULED.format(os.SCHED_IDLE),
                            ros=SCHEDULED.format(os.sched_getscheduler(0)),
                            new=PASSES)
    assert result.returncode == 0, result.stdout + result.stderr
    assert ' 5 passed in ' in last_line(result)
    assert result.stdout.count('test/ros/test_of_ros.py .') == 2
    for name in ('core', 'system', 'new'):
        assert result.stdout.count(f'test/{name}/test_of_{name}.py .') == 1


def test_a_failure_of_any_part_counts(run_everything):
    result = run_everything(ros=CHECKED, core=FAILS)
    assert result.returncode == 1, result.stdout
    assert ' 2 failed, 2 passed in ' in last_line(result)
    assert 'assert 1 == 2' in result.stdout
    # And of both runs of the nodes' tests, one had the fields checked.
    assert 'RuntimeError: fields are checked' in result.stdout


@pytest.mark.parametrize('name', ['ros', 'core', 'system'])
@pytest.mark.parametrize('source', [
    '', 'import os\nos._exit(0)\n',
    "import pytest\n\ndef test_it():\n    pytest.skip('not today')\n"])
def test_a_part_that_runs_nothing_fails(run_everything, name, source):
    result = run_everything(**{name: source})
    assert result.returncode == 1, result.stdout
    assert re.search(r' [12] error', last_line(result))


def test_arguments_are_passed_on(run_everything):
    result = run_everything('-k', 'passes', core=PASSES + FAILS)
    assert result.returncode == 0, result.stdout
    assert ' 4 passed in ' in last_line(result)
