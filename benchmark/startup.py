# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From the start of the controller's process to its first command, and the kernel's compilation.

On a machine with no cache of machine code the controller begins with the kernel as Python, while
another process compiles. Joint states and task velocities come all the time.

``python -m benchmark.startup`` runs this alone.
"""

from __future__ import annotations

import resource
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from benchmark.echo import NEWEST
from benchmark.middleware import MECHANISM, controller_command
from benchmark.motion import circle
from benchmark.names import COMPILATION, FIRST_START, LATER_START
from benchmark.prober import START_PATIENCE, Mailbox, Prober, joint_state, probing, twist
from benchmark.processes import ROOT, Processes
from benchmark.samples import main, row
from fault_tolerance.mechanism.catalogue import mechanism_named

_PERIOD = 0.005


def run(repeats: int = 5, quick: bool = False) -> list[dict[str, Any]]:
    """Return the rows of this benchmark; a ``quick`` one does not compile."""
    first, later = [], []
    with probing({}) as (prober, _):
        for _ in range(repeats):
            with TemporaryDirectory() as empty:
                first.append([_start(prober, {'XDG_CACHE_HOME': empty})])
            later.append([_start(prober, {})])
    struts = len(mechanism_named(MECHANISM).struts)
    rows = [
        row(name, samples, mechanism=MECHANISM, struts=struts, note='interpreter and imports too')
        for name, samples in ((FIRST_START, first), (LATER_START, later))
    ]
    return rows if quick else [*rows, row(COMPILATION, [[_compilation()]], note='processor time')]


def _start(prober: Prober, settings: dict[str, str]) -> float:
    """Return the microseconds from the start of a controller to its first command."""
    names, places = mechanism_named(MECHANISM).joint_state_names, circle(MECHANISM)
    node = prober.node
    joint_states = node.create_publisher(JointState, 'joint_states', NEWEST)
    velocities = node.create_publisher(TwistStamped, 'fault_tolerance/task_velocity', 10)
    commands = Mailbox(node, Float64MultiArray, 'velocity_controller/commands')
    begun = perf_counter()
    with Processes({'controller': controller_command(MECHANISM)}, settings) as processes:
        while not (commands.last and any(commands.last.data)):
            processes.check()
            if perf_counter() - begun > START_PATIENCE:
                raise RuntimeError('the controller has sent no command')
            joint_states.publish(joint_state(node, names, places[0]))
            velocities.publish(twist(node, (1e-3, 7e-4)))
            prober.rest(_PERIOD)
        taken = perf_counter() - begun
    for publisher in (joint_states, velocities):
        node.destroy_publisher(publisher)
    node.destroy_subscription(commands.subscription)
    return taken * 1e6


def _compilation() -> float:
    """Return the microseconds of processor time that compiling the kernel takes."""
    with TemporaryDirectory() as empty:
        begun = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            ['env', f'XDG_CACHE_HOME={empty}', sys.executable, '-m', 'fault_tolerance.kernel'],
            cwd=ROOT, check=True, capture_output=True,
        )
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return 1e6 * (ended.ru_utime - begun.ru_utime + ended.ru_stime - begun.ru_stime)


if __name__ == '__main__':
    main(run)
