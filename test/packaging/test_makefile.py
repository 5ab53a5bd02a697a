# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The Makefile explains itself and chooses an interpreter that can work."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def make(*arguments, **environment):
    """Run make without touching anything: targets that would install are only printed."""
    kept = {name: value for name, value in os.environ.items()
            if not name.startswith(('MAKE', 'MFLAGS', 'PYTHON', 'ROS_DISTRO'))}
    return subprocess.run(['make', *arguments], cwd=ROOT,
                          env={**kept, **environment}, capture_output=True, text=True,
                          check=False)


@pytest.fixture
def empty(tmp_path):
    """Return a folder that looks like a checkout in which nothing has been prepared."""
    for name in ('setup.py', 'setup.cfg', 'package.xml', 'Makefile'):
        shutil.copy(ROOT / name, tmp_path)
    return tmp_path


def interpreter(folder, name, body):
    file = folder / name
    file.write_text(f'#!/bin/sh\n{body}\n')
    file.chmod(0o755)
    return file


def test_bare_make_lists_the_targets():
    answer = make()
    assert answer.returncode == 0
    for target in ('demo', 'campaign', 'fuzz', 'soak', 'test', 'test-pins', 'lint', 'colcon',
                   'clean'):
        assert f'make {target} ' in answer.stdout


def test_unsuitable_python_is_refused_in_one_line(empty):
    answer = make('-C', empty, 'venv', 'PYTHON=/nonexistent/python')
    assert answer.returncode != 0
    assert 'Python 3.10 to 3.13 is needed' in answer.stderr
    assert not (empty / '.venv').exists()


def test_python_that_does_not_run_is_passed_over(empty, tmp_path):
    """A shim that is there and fails, as pyenv has them, does not stop the search."""
    shims = tmp_path / 'shims'
    shims.mkdir()
    interpreter(shims, 'python3', 'echo broken >&2; exit 127')
    for version in ('3.13', '3.12', '3.11'):
        interpreter(shims, f'python{version}', 'exit 127')
    interpreter(shims, 'python3.10', f'exec {sys.executable} "$@"')
    answer = make('-C', empty, '-n', 'venv', PATH=f'{shims}{os.pathsep}{os.environ["PATH"]}')
    assert answer.returncode == 0, answer.stderr
    chosen = getattr(sys, '_base_executable', sys.executable)
    assert f'Preparing .venv with {chosen} (wheels)' in answer.stdout


def test_sourced_ros_is_used(empty, tmp_path):
    sourced = interpreter(tmp_path, 'python3', 'exit 0')
    answer = make('-C', empty, '-n', 'venv', f'PYTHON={sourced}', ROS_DISTRO='jazzy')
    assert f'Preparing .venv with {sourced} (jazzy)' in answer.stdout
    assert '--system-site-packages' in answer.stdout
    assert "pip install -q --disable-pip-version-check -e '.[plot,record,test]'" in answer.stdout


def test_ros_that_cannot_be_imported_is_not_used(empty):
    answer = make('-C', empty, '-n', 'venv', f'PYTHON={sys.executable}', ROS_DISTRO='')
    assert '(wheels)' in answer.stdout
    assert "-e '.[ros,plot,record,test]'" in answer.stdout


def test_demo_passes_engine_and_arguments_on():
    answer = make('-n', 'demo', 'ENGINE=elastic', 'ARGS=--quick')
    assert '-m fault_tolerance demo --engine elastic --quick' in answer.stdout


def test_long_runs_may_be_shortened():
    fuzz = make('-n', 'fuzz', 'SECONDS=5', 'SEED=7').stdout
    assert 'FUZZ_SECONDS=5 FUZZ_SEED=7' in fuzz
    assert 'test/system/test_fuzz.py' in fuzz
    assert 'SOAK_SECONDS=1800 ' in make('-n', 'soak').stdout
    assert 'SOAK_SECONDS=20 ' in make('-n', 'soak', 'SECONDS=20').stdout
    campaign = make('-n', 'campaign', 'ARGS=--singles').stdout
    assert '-m fault_tolerance campaign --singles' in campaign
