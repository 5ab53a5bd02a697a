# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Nodes refuse to start with one line that says why, and bring the drives to rest as they end."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time

import pytest
from node_rig import PATIENCE, Plant

ATTEMPTS = 3
MODULES = {
    'controller': 'fault_tolerance',
    'drive_reports': 'drive_reports',
    'fsm_simulator': 'fsm',
    'pointing_reference': 'pointing',
}
BAD = [
    ('controller', {'joint_state_timeout': 'soon'}, 'joint_state_timeout'),
    ('controller', {'joint_state_timeout': 1}, 'joint_state_timeout: 1 is not of type float'),
    ('controller', {'joint_state_timeout': -1.0}, 'joint_state_timeout'),
    ('controller', {'tolerance_threshold': '.nan'}, 'tolerance_threshold'),
    ('controller', {'unknown_mode': 'panic'}, 'unknown_mode'),
    ('controller', {'recovery': 'maybe'}, 'recovery'),
    ('controller', {'hold_below': 0.5}, 'hold_below'),
    ('controller', {'mechanism': 'no_such_mirror'}, 'no_such_mirror'),
    ('drive_reports', {'rules': 'no_such_rules'}, 'no_such_rules'),
    ('drive_reports', {'rules': 5}, 'rules'),
    ('drive_reports', {'mechanism': 'no_such_mirror'}, 'no_such_mirror'),
    ('fsm_simulator', {'rate': 'fast'}, 'rate'),
    ('fsm_simulator', {'engine': 'steam'}, 'engine'),
    ('fsm_simulator', {'disturbance': '[1.0, 2.0]'}, 'disturbance'),
    ('fsm_simulator', {'encoders': 'both'}, 'encoders'),
    ('fsm_simulator', {'weak_share': 1.5}, 'weak_share'),
    ('fsm_simulator', {'breakaway': -1.0}, 'breakaway'),
    ('fsm_simulator', {'faults.theta_1': 'melted'}, 'faults.theta_1'),
    ('fsm_simulator', {'faults.theta_9': 'torque'}, 'faults.theta_9'),
    ('fsm_simulator', {'mechanism': 'no_such_mirror'}, 'no_such_mirror'),
    ('pointing_reference', {'kind': 'spiral'}, 'kind'),
    ('pointing_reference', {'lines': 0}, 'lines'),
    ('pointing_reference', {'mechanism': 'serial_3r'}, 'mechanism'),
]


ONE_BY_ONE = """
import json, sys
from fault_tolerance.nodes.{} import main
for arguments in json.loads(sys.argv[1]):
    print(main(arguments), file=sys.stderr, flush=True)
"""


def refused(module, cases):
    """Check that what each case names is refused in one line that says so.

    In one process: the node starts, is refused, and starts again with the next.
    """
    command_lines = [
        ['--ros-args', *(word for key, value in parameters.items()
                         for word in ('-p', f'{key}:={value}'))]
        for parameters, _ in cases
    ]
    done = subprocess.run(
        [sys.executable, '-c', ONE_BY_ONE.format(module), json.dumps(command_lines)],
        capture_output=True, text=True, timeout=60, check=False,
    )
    lines = [line for line in done.stderr.splitlines() if 'FAULT_TOLERANCE_COMPILED' not in line]
    assert len(lines) == 2 * len(cases), done.stderr
    for (_, name), line, code in zip(cases, lines[::2], lines[1::2], strict=True):
        assert line.startswith(f'{MODULES[module]}: ')
        assert name in line
        assert code == '2'


@pytest.mark.parametrize('module', MODULES)
def test_a_bad_parameter_is_named_in_one_line(module, tmp_path):
    """Of a bad mechanism file also the key and the reason."""
    file = tmp_path / 'mirror.yaml'
    file.write_text(
        'mechanism: mirror\nplatform: {origin: [0, 0]}\n'
        'task: {coordinates: [wx]}\nstruts: []\n'
    )
    refused(module, [
        *((parameters, name) for node, parameters, name in BAD if node == module),
        ({'mechanism': str(file)}, f'{file}: platform.origin: '),
    ])


def test_a_parameter_nobody_knows_is_warned_of(start):
    process = start('controller', joint_state_time_out=0.2)
    deadline = time.monotonic() + PATIENCE
    while 'joint_state_time_out' not in process.output:
        assert process.alive
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_the_bare_word_off_is_no_boolean(start, probe):
    start('controller', detect='off')
    assert probe.parameter('fault_tolerance', 'detect') == 'off'


def least_time_to_end(running, number, ended) -> float:
    """Return the least time a node took to end by a signal: the machine itself only adds to it."""
    took = []
    while len(took) < ATTEMPTS and min(took, default=2.0) >= 2.0:
        process = running()
        took.append(process.signal(number))
        ended(process)
    return min(took)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_brings_the_drives_to_rest(start, probe, number):
    plant = Plant(probe, ['theta_1', 'theta_2', 'theta_3', 'theta_4'])

    def running():
        controller = start('controller', mechanism='fsm_4_strut')
        plant.asked = None
        plant.connect()
        plant.asked = (0.01, 0.02)
        probe.wait(lambda: any(plant.step()), 'a command that moves')
        return controller

    def ended(controller):
        assert controller.process.returncode == 0
        probe.wait(lambda: not any(probe.commands[-1].data), 'a command of rest')
        assert len(probe.commands[-1].data) == 4
        assert 'Traceback' not in controller.output
        probe.wait(lambda: not plant.joint_states.get_subscription_count(), 'its end')
        probe.states.clear()

    assert least_time_to_end(running, number, ended) < 2.0


@pytest.mark.parametrize(('module', 'topic'), [
    ('fsm_simulator', '/joint_states'), ('pointing_reference', '/fault_tolerance/task_velocity'),
])
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_other_nodes_too(start, probe, module, topic, number):
    # Publishers are counted, not names of nodes: when a participant is gone before its last
    # word of discovery is read, rmw_fastrtps keeps the name for ever.
    def running():
        process = start(module)
        probe.wait(lambda: probe.node.count_publishers(topic), module)
        return process

    def ended(process):
        assert process.process.returncode == 0
        assert process.output == ''
        probe.wait(lambda: not probe.node.count_publishers(topic), 'its end')

    assert least_time_to_end(running, number, ended) < 2.0


@pytest.mark.paced
def test_the_plant_stops_by_itself_when_the_controller_is_killed(start, probe):
    start('fsm_simulator')
    controller = start('controller')
    start('pointing_reference', amplitude=0.01)
    joint_states = probe.joint_states()

    def moving():
        return any(abs(speed) > 1e-5 for speed in joint_states[-1].velocity)

    probe.wait(lambda: joint_states and moving(), 'the mirror to move')
    controller.signal(signal.SIGKILL)
    killed = time.monotonic()
    probe.wait(lambda: not moving(), 'the mirror to stop')
    assert time.monotonic() - killed < 1.0


IN_THE_LOOP = """
import gc, os, signal, sys
from rclpy.node import Node
from fault_tolerance.nodes.spinning import Deferred, run

class Watcher(Node):
    def __init__(self):
        super().__init__('watcher', enable_rosout=False)
        self.deferred, self.calls = Deferred(), 0
        self.create_timer(0.01, self.call)

    def call(self):
        self.calls += 1
        if self.calls == 20:
            print(gc.isenabled(), gc.get_freeze_count() > 10_000)
            os.kill(os.getpid(), signal.SIGINT)

code = run('watcher', Watcher, [])
print(code, gc.isenabled())
"""


def test_in_the_loop_callbacks_come_and_garbage_is_not_collected_by_itself():
    done = subprocess.run(
        [sys.executable, '-c', IN_THE_LOOP], capture_output=True, text=True, timeout=60,
        check=False,
    )
    assert done.stdout.split() == ['False', 'True', '0', 'True'], done.stdout + done.stderr
