# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The first motion over DDS: a right file, wrong ones, and everything that has to stop it."""

import json
import os
import pty
import signal
import subprocess
import sys
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_rig import CALM, Probe
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path
from fault_tolerance.nodes.commissioner import Commissioner


def process(*words, stdin=subprocess.DEVNULL):
    return subprocess.Popen(
        [sys.executable, '-m', 'fault_tolerance', 'commission', *map(str, words)], text=True,
        stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def ended(running):
    """Return exit code, standard output and standard error."""
    output, errors = running.communicate(timeout=90)
    assert 'Traceback' not in errors
    return running.returncode, output, errors


def file_of(folder, name, *replacements, first=''):
    text = mechanism_path(name).read_text()
    for old, new in replacements:
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = folder / f'{name}_changed.yaml'
    path.write_text(first + text)
    return path


@pytest.fixture(scope='module')
def heard_early(ros):
    """Return a probe of the mirror that is commissioned by the right file."""
    probe = Probe('right')
    yield probe
    probe.close()


@pytest.fixture(scope='module')
def begun_early(heard_early, start_for_module, tmp_path_factory):
    """Return the runs nobody touches, by namespace: they take long, while other tests run."""
    wrong = file_of(tmp_path_factory.mktemp('wrong'), 'mirror_3_strut',
                    first='actuators: [theta_2, theta_3, theta_1]\n')
    words = {'right': ['mirror_3_strut', '--yes'], 'wrong': [wrong, '--yes', '--json'],
             'nobody': ['mirror_3_strut', '--yes']}
    mirrors = {
        name: start_for_module('fsm_simulator', name, mechanism='mirror_3_strut', rate=CALM)
        for name in ('right', 'wrong')
    }
    runs = {name: Run(mirrors.get(name), *given, '--namespace', f'/{name}')
            for name, given in words.items()}
    yield runs
    for run in runs.values():
        run.running.kill()
        run.running.wait()


class Run:
    """One that is begun again where a stall of a busy host, rightly a surprise, has stopped it."""

    def __init__(self, mirror, *words):
        self.mirror, self.words = mirror, words
        self.running = process(*words)

    def ended(self):
        """Return exit code, output and errors of the first one that was not stopped.

        The mirror, which nobody needs any more, ends with it.
        """
        found = ended(self.running)
        for _ in range(2):
            if found[0] == 2:
                self.running = process(*self.words)
                found = ended(self.running)
        self.mirror.end()
        return found


@pytest.fixture(scope='module')
def mirror(start_for_module, begun_early):
    return start_for_module('fsm_simulator', mechanism='mirror_3_strut', rate=CALM)


@pytest.fixture
def simulator(mirror, probe):
    """Return a simulated mirror of three struts whose joint states are heard."""
    heard = probe.joint_states()
    probe.wait(lambda: heard, 'joint states')
    return mirror


def begun(running, probe):
    """Return whether it has begun to move, and not ended."""
    probe.wait(lambda: any(any(one.data) for one in probe.commands)
               or running.poll() is not None, 'a motion')
    return running.poll() is None


@pytest.fixture
def moving(simulator, probe):
    """Return a machine and its first motion, which has begun."""
    for _ in range(3):
        probe.commands.clear()
        running = process('mirror_3_strut', '--yes', '--json')
        if begun(running, probe):
            break
        # A stall of a busy host is a surprise, and stops it: rightly so.
        print(*ended(running))
    else:
        pytest.fail('it never began to move')
    yield simulator, running
    if running.poll() is None:
        running.kill()
        running.wait()


def stopped(moving, probe):
    """Return why a motion has stopped, having left zeros."""
    code, output, _ = ended(moving[1])
    assert code == 2
    probe.spin(0.2)
    assert not any(probe.commands[-1].data)
    return json.loads(output)['stopped']


def test_wrong_names_are_listed_and_nothing_moves(simulator, probe, tmp_path):
    name = '{name: theta_2, '
    file = file_of(tmp_path, 'mirror_3_strut', (name, f'{name}joint_state_name: theta2, '))
    code, output, _ = ended(process(file, '--yes'))
    assert code == 1
    assert '`joint_state_name` of theta_2: no joint state is called theta2; there is theta_2' in \
        ' '.join(output.split())
    assert not probe.commands


def test_without_a_terminal_it_needs_yes(simulator, probe):
    code, output, errors = ended(process('mirror_3_strut'))
    assert (code, output) == (2, '')
    assert errors.count('\n') == 1
    assert '--yes' in errors
    probe.spin(0.2)
    assert not probe.commands


@pytest.mark.parametrize('answer', ['\n'])
def test_an_answer_that_is_not_yes_moves_nothing(simulator, probe, answer):
    ours, theirs = pty.openpty()
    running = process('mirror_3_strut', stdin=theirs)
    os.write(ours, answer.encode())
    code, output, errors = ended(running)
    os.close(ours)
    os.close(theirs)
    assert code == 2
    assert output.endswith('type yes to go on: ')
    assert errors == 'fault_tolerance: not confirmed: nothing has been moved\n'
    assert not probe.commands


def test_another_node_that_commands_is_refused(start, simulator, probe):
    start('controller', mechanism='mirror_3_strut')
    probe.wait_for_state('nominal')
    code, output, errors = ended(process('mirror_3_strut', '--yes'))
    # Where it is discovered late, the motion is stopped as soon as it is.
    assert code == 2
    assert 'fault_tolerance publishes /velocity_controller/commands' in errors or \
        'a node publishes /velocity_controller/commands' in errors or 'commanded' in output


def test_a_rival_may_have_the_same_name(probe):
    """Names end in the number of the process, which is the same in two containers."""
    ours = Commissioner(mechanism_named('mirror_3_strut'), 'contended')
    ours.begin()
    assert not ours.rivals
    theirs = Node(ours.get_name(), namespace='contended', enable_rosout=False)
    theirs.create_publisher(Float64MultiArray, 'velocity_controller/commands', 10)
    probe.wait(lambda: ours.rivals, 'a rival')
    assert ours.rivals == [ours.get_name()]
    for node in (ours, theirs):
        node.destroy_node()


@pytest.mark.slow
def test_a_right_file(begun_early, heard_early):
    code, output, errors = begun_early['right'].ended()
    assert (code, errors) == (0, ''), output
    assert 'WRONG' not in output
    assert output.endswith('all that could be told agrees with the file\n')
    assert 'theta_3' in output
    heard_early.spin(0.2)
    assert not any(heard_early.commands[-1].data)


@pytest.mark.slow
def test_a_wrong_order(begun_early):
    code, output, _ = begun_early['wrong'].ended()
    assert code == 1
    report = json.loads(output)
    (found,) = [one for one in report['findings'] if one['level'] == 'wrong']
    assert (found['entry'], found['probable']) == ('actuators', ['theta_1', 'theta_2', 'theta_3'])
    assert report['stopped'] is None
    assert len(report['motions']) == 3


def test_without_a_machine_it_says_so_in_one_line(begun_early):
    code, output, errors = ended(begun_early['nobody'].running)
    assert (code, output) == (2, '')
    assert errors == 'fault_tolerance: no joint state on /nobody/joint_states (0 publishers)\n'


def test_joint_states_that_cease_stop_it(moving, probe):
    node, running = moving
    os.killpg(node.process.pid, signal.SIGSTOP)
    begin = time.monotonic()
    try:
        code, output, _ = ended(running)
        assert time.monotonic() - begin < 5.0
    finally:
        os.killpg(node.process.pid, signal.SIGCONT)
    assert code == 2
    assert 'no reading for' in json.loads(output)['stopped']
    probe.spin(0.2)
    assert not any(probe.commands[-1].data)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGHUP])
def test_an_interrupt_leaves_zeros(moving, probe, number):
    moving[1].send_signal(number)
    assert stopped(moving, probe) == 'interrupted'


def test_a_second_publisher_stops_it(moving, probe):
    publisher = probe.node.create_publisher(Float64MultiArray, 'velocity_controller/commands', 10)
    assert stopped(moving, probe) == 'probe publishes commands too'
    probe.node.destroy_publisher(publisher)


def test_a_failure_that_is_reported_stops_it(moving, probe):
    publisher = probe.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
    probe.wait(lambda: publisher.get_subscription_count(), 'a subscriber')
    foreign = DiagnosticStatus(level=DiagnosticStatus.ERROR, name='drive', hardware_id='axis_7')
    publisher.publish(DiagnosticArray(status=[foreign]))
    probe.spin(0.3)
    assert moving[1].poll() is None
    mine = DiagnosticStatus(
        level=DiagnosticStatus.ERROR, name='drive', hardware_id='theta_2', message='too hot')
    publisher.publish(DiagnosticArray(status=[mine]))
    assert stopped(moving, probe) == 'theta_2 is reported to have failed: too hot'
    probe.node.destroy_publisher(publisher)
