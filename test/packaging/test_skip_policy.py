# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A run is green only if something ran and nothing was left out that could have run."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TEST_FOLDER = Path(__file__).resolve().parents[1]


@pytest.fixture
def run_pytest(tmp_path):
    """Return a function that runs pytest on a module under this package's conftest."""
    shutil.copy(TEST_FOLDER / 'conftest.py', tmp_path)
    shutil.copy(TEST_FOLDER.parent / 'pyproject.toml', tmp_path)

    def run(source, *, conftest='', arguments=(), where=('.',), test=None):
        (tmp_path / 'test_given.py').write_text(source)
        if test is not None:
            (tmp_path / 'test' / 'test_given.py').write_text(test)
        with (tmp_path / 'conftest.py').open('a') as file:
            file.write(conftest)
        environment = {
            **os.environ, 'PYTEST_ADDOPTS': '', 'PYTEST_DISABLE_PLUGIN_AUTOLOAD': '1'}
        return subprocess.run(
            [sys.executable, '-m', 'pytest', '-p', 'no:cacheprovider', *where, *arguments],
            cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    return run


PASSES = 'import pytest\n\ndef test_that_passes():\n    pass\n\n'


def test_passing_run_is_green(run_pytest):
    result = run_pytest(PASSES)
    assert result.returncode == 0, result.stdout
    assert '1 passed' in result.stdout.splitlines()[-1]


def test_run_without_tests_fails(run_pytest):
    result = run_pytest('')
    assert result.returncode == pytest.ExitCode.USAGE_ERROR
    assert 'no test passed' in result.stdout


def test_run_with_everything_deselected_fails(run_pytest):
    result = run_pytest(PASSES, arguments=['-k', 'no_such_name'])
    assert result.returncode == pytest.ExitCode.USAGE_ERROR
    assert 'no test passed' in result.stdout


SKIPS = (
    "@pytest.mark.skip(reason='not today: 1')\ndef test_1():\n    pass\n\n"
    "@pytest.mark.skipif(True, reason='not today: 2')\ndef test_2():\n    pass\n\n"
    "def test_3():\n    pytest.skip('not today: 3')\n\n"
    "@pytest.fixture\ndef value():\n    pytest.skip('not today: 4')\n\n"
    'def test_4(value):\n    pass\n\n'
    "@pytest.mark.xfail(reason='not today: 5')\ndef test_5():\n    assert False\n\n"
    'import unittest\n\nclass TestIt(unittest.TestCase):\n'
    "    @unittest.skip('not today: 6')\n    def test_6(self):\n        pass\n"
)


def test_skips_outside_the_allow_list_fail_in_every_form(run_pytest):
    result = run_pytest(PASSES + SKIPS)
    assert result.returncode == 1, result.stdout
    last = result.stdout.splitlines()[-1]
    # What fails before the test itself is an error.
    bad = sum(int(number) for number in re.findall(r'(\d+) (?:failed|error)', last))
    assert (bad, '1 passed' in last) == (6, True), last
    assert 'skipped' not in last and 'xfailed' not in last
    for number in range(1, 7):
        reason = rf'not run, for a reason that is not allowed: .*not today: {number}'
        assert re.search(reason, result.stdout), number


@pytest.mark.parametrize('source', [
    "pytest.skip('not today', allow_module_level=True)\n",
    "pytest.importorskip('no_such_middleware')\n",
])
def test_skipped_module_fails(run_pytest, source):
    result = run_pytest(PASSES + source)
    assert result.returncode != 0, result.stdout
    assert 'not run, for a reason that is not allowed' in result.stdout


MARKED = PASSES + '@pytest.mark.needs_launch\ndef test_it():\n    pass\n'


def holds(value):
    return ("\n_mark, _ = ALLOWED_SKIPS['launch is not installed']\n"
            f"ALLOWED_SKIPS['launch is not installed'] = (_mark, lambda: {value})\n")


def test_allowed_reason_skips_and_is_printed(run_pytest):
    result = run_pytest(MARKED, conftest=holds(True))
    assert result.returncode == 0, result.stdout
    assert 'SKIPPED [1]' in result.stdout
    assert 'launch is not installed' in result.stdout
    assert '1 passed, 1 skipped' in result.stdout.splitlines()[-1]


def test_what_is_not_missing_is_not_skipped(run_pytest):
    result = run_pytest(MARKED, conftest=holds(False))
    assert '2 passed' in result.stdout.splitlines()[-1]


def test_allowed_reason_that_does_not_hold_fails(run_pytest):
    source = PASSES + "def test_it():\n    pytest.skip('launch is not installed')\n"
    result = run_pytest(source, conftest=holds(False))
    assert result.returncode == 1
    assert '1 failed, 1 passed' in result.stdout.splitlines()[-1]


def test_run_of_allowed_skips_alone_fails(run_pytest):
    source = 'import pytest\n@pytest.mark.needs_launch\ndef test_it():\n    pass\n'
    result = run_pytest(source, conftest=holds(True))
    assert result.returncode == pytest.ExitCode.USAGE_ERROR
    assert 'no test passed' in result.stdout


TABLE = '| J1 | what | `test_given.py::test_that_passes` `test_given.py::test_{}` |\n'


def test_a_whole_run_must_include_what_the_table_names(run_pytest, tmp_path):
    (tmp_path / 'docs').mkdir()
    (tmp_path / 'test').mkdir()
    for name, code, said in (('gone', 1, True), ('that_passes', 0, False)):
        (tmp_path / 'docs' / 'robustness.md').write_text(TABLE.format(name))
        result = run_pytest('', where=[], test=PASSES)
        assert result.returncode == code, result.stdout
        assert ('but not run: test/test_given.py::test_gone' in result.stdout) is said


def test_a_run_of_whole_folders_must_include_what_the_table_names_of_them(run_pytest, tmp_path):
    (tmp_path / 'docs').mkdir()
    for name in ('core', 'ros'):
        (tmp_path / 'test' / name).mkdir(parents=True)
        (tmp_path / 'test' / name / f'test_of_{name}.py').write_text(PASSES)
    table = ''.join(TABLE.format(name).replace('test_given', f'{folder}/test_of_{folder}')
                    for folder in ('core', 'ros') for name in (f'gone_{folder}', 'that_passes'))
    (tmp_path / 'docs' / 'robustness.md').write_text(table)
    result = run_pytest('', where=['test/core'])
    assert result.returncode == 1, result.stdout
    assert 'but not run: test/core/test_of_core.py::test_gone_core' in result.stdout
    assert result.stdout.count('but not run') == 1
    result = run_pytest('', where=['test/core', 'test/ros/test_of_ros.py'])
    assert result.returncode == 0, result.stdout


def test_a_run_of_some_tests_need_not_include_what_the_table_names(run_pytest, tmp_path):
    (tmp_path / 'docs').mkdir()
    (tmp_path / 'test').mkdir()
    (tmp_path / 'docs' / 'robustness.md').write_text(TABLE.format('gone'))
    for arguments in (['test/test_given.py'], ['-k', 'that_passes']):
        source = PASSES + 'def test_another():\n    pass\n'
        result = run_pytest('', where=[], test=source, arguments=arguments)
        assert result.returncode == 0, result.stdout


def test_folder_named_launch_is_not_launch(run_pytest, tmp_path):
    (tmp_path / 'launch').mkdir()
    source = ('import importlib.machinery\nimport sys\n'
              'from conftest import launch_is_missing\n\n'
              'def test_it(monkeypatch):\n'
              f'    monkeypatch.setattr(sys, "path", [{str(tmp_path)!r}])\n'
              '    launch_is_missing.cache_clear()\n'
              '    assert launch_is_missing()\n')
    result = run_pytest(source)
    assert result.returncode == 0, result.stdout


def test_test_that_hangs_is_ended(run_pytest):
    source = PASSES + 'import time\n\ndef test_it():\n    time.sleep(60)\n'
    result = run_pytest(source, conftest='\nLONGEST_TEST = 1\n')
    assert result.returncode == 1
    assert 'still running after 1 s' in result.stdout
    assert '1 failed, 1 passed' in result.stdout.splitlines()[-1]


def test_every_run_has_a_domain_of_its_own(run_pytest):
    source = ('import os\n\ndef test_it():\n'
              "    assert 1 <= int(os.environ['ROS_DOMAIN_ID']) <= 101\n"
              f"    assert os.environ['ROS_DOMAIN_ID'] != '{os.environ['ROS_DOMAIN_ID']}'\n"
              "    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'\n")
    result = run_pytest(source)
    assert result.returncode == 0, result.stdout
