# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Controller and mirror on two hosts; the cable between them is pulled and put back.

Run in a network namespace of its own, which becomes the controller's host; another one becomes
the mirror's. Both share a file system, so shared memory is ruled out as a transport: it would
reach from one host to the other without the cable.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HOSTS = {'veth0': '10.77.0.1/24', 'veth1': '10.77.0.2/24'}
MOVING = 1e-4
"""Metres per second; a millirad circle at 1 Hz takes more."""

CUT = 2.0
"""Seconds for which the cable stays out once the controller holds."""


def run(*command: object) -> None:
    subprocess.run([str(part) for part in command], check=True)


def bring_up(name: str, *before: object) -> None:
    """Give one end of the cable its address."""
    run(*before, 'ip', 'link', 'set', 'lo', 'up')
    run(*before, 'ip', 'addr', 'add', HOSTS[name], 'dev', name)
    run(*before, 'ip', 'link', 'set', name, 'up', 'multicast', 'on')


class OtherHost:
    """A second network namespace, at the far end of a cable, and the processes in it."""

    def __init__(self) -> None:
        run('ip', 'link', 'add', 'veth0', 'type', 'veth', 'peer', 'name', 'veth1')
        own = os.readlink('/proc/self/ns/net')
        self._holder = subprocess.Popen(['unshare', '--net', 'sleep', '600'])
        self._processes: list[subprocess.Popen] = []
        while os.readlink(f'/proc/{self._holder.pid}/ns/net') == own:
            assert self._holder.poll() is None, 'the second namespace was refused'
            time.sleep(0.01)
        self.inside = ('nsenter', '--target', self._holder.pid, '--net')
        run('ip', 'link', 'set', 'veth1', 'netns', self._holder.pid)
        bring_up('veth0')
        bring_up('veth1', *self.inside)

    def start(self, *command: object) -> None:
        arguments = [str(part) for part in (*self.inside, *command)]
        self._processes.append(subprocess.Popen(arguments, start_new_session=True))

    def end(self) -> None:
        for process in (*reversed(self._processes), self._holder):
            process.kill()
            process.wait()


def watch(path: str) -> None:
    """On the mirror's host: write down how fast its drives move."""
    import rclpy
    from node_rig import Probe

    rclpy.init(args=[])
    probe = Probe()
    joint_states = probe.joint_states()
    with Path(path).open('w') as file:
        while True:
            joint_states.clear()
            probe.wait(lambda: joint_states, 'joint states', 60.0)
            speed = max(map(abs, joint_states[-1].velocity))
            file.write(json.dumps([time.monotonic(), speed]) + '\n')
            file.flush()


def main() -> None:
    import rclpy
    from node_rig import NodeProcess, Probe

    other = OtherHost()
    folder = Path(tempfile.mkdtemp())
    speeds = folder / 'speeds'
    node = 'fault_tolerance.nodes.'
    started: list[NodeProcess] = []
    try:
        other.start(sys.executable, '-m', f'{node}fsm_simulator')
        other.start(sys.executable, '-m', f'{node}pointing_reference')
        other.start(sys.executable, __file__, speeds)
        started.append(NodeProcess('controller', folder / 'controller.log'))
        rclpy.init(args=[])
        probe = Probe()

        def commanded() -> bool:
            return bool(probe.commands) and max(map(abs, probe.commands[-1].data)) > MOVING

        def reason() -> str:
            return probe.metrics[-1].status[0].message if probe.metrics else ''

        def mirror_speed() -> float:
            lines = speeds.read_text().splitlines() if speeds.exists() else []
            whole = [json.loads(line) for line in lines if line.endswith(']')]
            assert not whole or time.monotonic() - whole[-1][0] < 5.0, 'nobody watches the mirror'
            return whole[-1][1] if whole else 0.0

        probe.wait_for_state('nominal')
        probe.wait(commanded, 'commands across the cable')
        probe.wait(lambda: mirror_speed() > MOVING, 'the mirror to move')

        run('ip', 'link', 'set', 'veth0', 'down')
        cut = time.monotonic()
        probe.wait_for_state('hold')
        held = time.monotonic() - cut
        probe.wait(lambda: 'no usable joint state' in reason(), 'the reason')
        probe.wait(lambda: not any(probe.commands[-1].data), 'a command of rest')
        count = len(probe.commands)
        probe.wait(lambda: mirror_speed() < 0.01 * MOVING, 'the mirror to stop by itself')
        stood = time.monotonic() - cut
        probe.spin(CUT)
        assert not any(any(one.data) for one in probe.commands[count:])
        assert probe.state == 'hold'
        assert mirror_speed() < 0.01 * MOVING

        run('ip', 'link', 'set', 'veth0', 'up')
        joined = time.monotonic()
        probe.wait_for_state('nominal')
        probe.wait(commanded, 'commands again')
        probe.wait(lambda: mirror_speed() > MOVING, 'the mirror to move again')
        back = time.monotonic() - joined
        assert all(process.alive for process in started)
        print(f'hold after {held:.2f} s, mirror at rest after {stood:.2f} s, back {back:.2f} s')
    finally:
        for process in started:
            process.end()
            print(process.output)
        other.end()


if __name__ == '__main__':
    if len(sys.argv) > 1:
        watch(sys.argv[1])
    else:
        main()
