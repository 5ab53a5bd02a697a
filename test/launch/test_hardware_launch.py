# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The launch file of a real machine: what it starts, starts again, and gives up on."""

from __future__ import annotations

import os
import signal
import subprocess
import time

import pytest
from launch_cases import PATIENCE, Launched, entities

from fault_tolerance.resources import share_directory

LAUNCH = share_directory() / 'launch' / 'hardware.launch.py'
FSM = share_directory() / 'launch' / 'fsm.launch.py'

pytestmark = pytest.mark.needs_launch


@pytest.mark.parametrize(('given', 'wanted'), [
    ({}, ['controller']),
    ({'pointing': 'true'}, ['controller', 'pointing_reference']),
    ({'pointing': 'True', 'rules': 'mine.yaml'},
     ['controller', 'drive_reports', 'pointing_reference']),
])
def test_it_starts_what_is_asked_for(given, wanted, prefix, monkeypatch):
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    (prefix / 'lib' / 'fault_tolerance' / 'drive_reports').touch()
    assert [node.node_executable for node in entities(LAUNCH, **given)] == wanted


def test_without_the_executable_drive_reports_is_refused(prefix, monkeypatch):
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    with pytest.raises(RuntimeError, match='this installation has no drive_reports'):
        entities(LAUNCH, rules='mine.yaml')


@pytest.mark.parametrize('file', [LAUNCH, FSM])
def test_a_bad_mechanism_ends_the_launch_with_an_error_code(file, prefix, tmp_path):
    with Launched(file, prefix, tmp_path, 'mechanism:=no_such_mirror') as launch:
        assert launch.process.wait(PATIENCE) == 1
    assert 'no_such_mirror' in launch.output


def test_a_controller_that_dies_is_started_again(prefix, tmp_path):
    with Launched(LAUNCH, prefix, tmp_path, 'mechanism:=fsm_4_strut') as launch:
        def children():
            found = subprocess.run(
                ['ps', '--ppid', str(launch.process.pid), '-o', 'pid='],
                capture_output=True, text=True, check=False,
            )
            return [int(one) for one in found.stdout.split()]

        def wait(condition):
            deadline = time.monotonic() + PATIENCE
            while not condition():
                assert launch.process.poll() is None and time.monotonic() < deadline
                time.sleep(0.05)

        wait(children)
        (first,) = children()
        os.kill(first, signal.SIGKILL)
        wait(lambda: children() and first not in children())
        launch.process.send_signal(signal.SIGINT)
        assert launch.process.wait(PATIENCE) == 0
