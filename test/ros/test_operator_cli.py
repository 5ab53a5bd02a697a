# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Breaking and mending by command line, where there is no ros2 command."""

import subprocess
import sys

import pytest
from node_rig import CALM

from fault_tolerance.nodes.parameter_tables import POINTING
from fault_tolerance.nodes.usage import exit_code


def begun(*words):
    return subprocess.Popen(
        [sys.executable, '-m', 'fault_tolerance', *words], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )


def ended(running):
    """Return what a command has done, with its output."""
    output, errors = running.communicate(timeout=60)
    return subprocess.CompletedProcess(running.args, running.returncode, output, errors)


def command(*words):
    return ended(begun(*words))


@pytest.fixture(scope='module', autouse=True)
def unanswered():
    """Return a command that waits for nodes that are not there, while other tests run."""
    running = begun('inject', '--namespace', '/nowhere', 'ok', 'all')
    yield running
    running.kill()
    running.wait()


def test_a_fault_is_injected_and_released(start, probe):
    start('fsm_simulator', mechanism='fsm_4_strut', rate=CALM)
    start('controller', mechanism='fsm_4_strut')
    probe.wait_for_state('nominal')

    # What is refused and what explains change nothing, and need not be waited for.
    bad = {words: begun('inject', *words.split()) for words in ('stuck theta_9',
                                                                'explode theta_1')}
    shown = begun('inject', '--help')
    broken = command('inject', 'stuck', 'theta_4')
    assert (broken.returncode, broken.stdout) == (0, 'degraded\n'), broken.stderr
    mended = command('inject', 'ok all')
    assert (mended.returncode, mended.stdout) == (0, 'degraded\n'), mended.stderr
    for words, running in bad.items():
        refused = ended(running)
        assert (refused.returncode, refused.stdout) == (2, '')
        assert refused.stderr.count('\n') == 1
        assert words.split()[1 if 'theta_9' in words else 0] in refused.stderr
        assert ('theta_9' in words) is ('theta_1, theta_2' in refused.stderr)
    released = command('clear')
    assert released.returncode == 0, released.stderr
    assert released.stdout == 'released theta_4 (position); now nominal\n'
    # Nobody hears of it.
    silent = command('inject', 'silent', 'frozen', 'theta_2')
    assert (silent.returncode, silent.stdout) == (0, 'nominal\n'), silent.stderr
    explained = ended(shown).stdout
    assert 'reversed' in explained and 'unactuated' in explained


def test_other_names_and_namespaces_can_be_told(start, probe):
    start('fsm_simulator', 'robot', '-r', '__node:=mirror', mechanism='fsm_4_strut', rate=CALM)
    start('controller', 'robot', '-r', '__node:=keeper', mechanism='fsm_4_strut')
    at_robot = ('--namespace', '/robot')

    broken = command('inject', *at_robot, '--node', 'mirror', 'stuck', 'theta_4')
    assert broken.returncode == 0, broken.stderr
    assert broken.stdout == 'injected; no controller /robot/fault_tolerance is heard\n'
    unseen = begun('watch', '--duration', '1')
    seen = command('watch', *at_robot, '--node', 'keeper', '--duration', '4')
    assert (seen.returncode, seen.stderr) == (0, '')
    assert 'theta_4 stuck' in seen.stdout
    kept = command('clear', *at_robot, '--node', 'keeper')
    assert (kept.returncode, kept.stdout) == (
        1, 'still reported: theta_4 (position); now degraded\n'
    )
    assert ended(unseen).returncode == 1


@pytest.mark.parametrize(
    'module', ['controller', 'drive_reports', 'fsm_simulator', 'pointing_reference'])
def test_a_node_has_help_and_refuses_what_it_does_not_know(module):
    def node(*words):
        return subprocess.run(
            [sys.executable, '-m', f'fault_tolerance.nodes.{module}', *words],
            capture_output=True, text=True, timeout=60,
        )

    helped = node('--help', '--ros-args', '-p', 'mechanism:=fsm_4_strut')
    assert (helped.returncode, helped.stderr) == (0, '')
    assert f'usage: python -m fault_tolerance.nodes.{module} ' in helped.stdout
    assert '  mechanism (default: mirror_4_strut)\n' in helped.stdout
    # As ros2 launch has it; rcl would take it for a remapping.
    refused = node('mechanism:=fsm_4_strut', '--ros-args', '--log-level', 'warn', '--')
    assert (refused.returncode, refused.stdout) == (2, '')
    assert refused.stderr.count('\n') == 1 and "argument 'mechanism:=fsm" in refused.stderr


def test_what_launch_adds_is_for_ros():
    words = ['--ros-args', '--log-level', 'info', '--ros-args', '-r', '__node:=x', '--']
    assert exit_code('pointing_reference', 'Points.', POINTING, words) is None
    assert exit_code('pointing_reference', 'Points.', POINTING, [*words, 'x']) == 2


def test_without_nodes_it_says_so_in_one_line(unanswered):
    done = ended(unanswered)
    assert done.returncode == 2
    words = 'no answer within 10 s from the simulator /nowhere/fsm'
    assert done.stderr == f'fault_tolerance: {words}\n'
