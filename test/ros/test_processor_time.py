# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""No node keeps a core busy: neither idle, nor with BLAS workers that wait for their next task."""

from __future__ import annotations

import ctypes
import time
from pathlib import Path

import pytest

from fault_tolerance.nodes.scheduling import limit_blas_threads

WINDOW = 2.0
ATTEMPTS = 3
IDLE = 0.2
"""Share of a core."""

NODES = {
    'controller': 'fault_tolerance',
    'fsm_simulator': 'fsm',
    'pointing_reference': 'pointing',
}


@pytest.fixture(autouse=True)
def _as_users_run_them(monkeypatch):
    """Nodes limit their BLAS themselves; what runs side by side is told to."""
    monkeypatch.delenv('OPENBLAS_NUM_THREADS', raising=False)


def processor_time(pid: int) -> tuple[float, float]:
    """Return the seconds that the main thread and all other threads of a process have taken."""
    seconds = {}
    for task in Path(f'/proc/{pid}/task').iterdir():
        try:
            seconds[int(task.name)] = 1e-9 * int((task / 'schedstat').read_text().split()[0])
        except (FileNotFoundError, ProcessLookupError):  # a thread that has just ended
            continue
    main = seconds.pop(pid)
    return main, sum(seconds.values())


def shares(probe, processes) -> dict[str, tuple[float, float]]:
    """Return the share of a core that main and other threads of each process take."""
    before = {name: processor_time(process.process.pid) for name, process in processes.items()}
    begin = time.monotonic()
    probe.spin(WINDOW)
    passed = time.monotonic() - begin
    return {
        name: tuple(
            (after - then) / passed
            for after, then in zip(
                processor_time(process.process.pid), before[name], strict=True
            )
        )
        for name, process in processes.items()
    }


def test_an_idle_node_leaves_the_processor_alone(start, probe):
    """The simulator goes on at 10 Hz."""
    processes = {
        'controller': start('controller', joint_state_timeout=30.0),
        'fsm_simulator': start('fsm_simulator', rate=10.0),
        'pointing_reference': start('pointing_reference', namespace='elsewhere'),
    }
    probe.wait_for_state('nominal')
    probe.wait(
        lambda: set(NODES.values()) <= set(probe.node.get_node_names()), 'all nodes'
    )
    for _ in range(ATTEMPTS):
        found = shares(probe, processes)
        if all(sum(share) < IDLE for share in found.values()):
            break
    for name, share in found.items():
        assert sum(share) < IDLE, (name, found)


def test_in_a_busy_loop_all_the_work_is_done_by_the_main_thread(start, probe):
    """What the middleware's threads take is a fraction of that; spinning workers take more."""
    processes = {
        'fsm_simulator': start('fsm_simulator', rate=200.0),
        'controller': start('controller'),
        'pointing_reference': start('pointing_reference', amplitude=1e-3),
    }
    probe.wait_for_state('nominal')
    probe.wait(lambda: probe.commands and any(probe.commands[-1].data), 'a command that moves')
    for _ in range(ATTEMPTS):
        found = shares(probe, processes)
        if all(others < max(0.5 * main, 0.1) for main, others in found.values()):
            break
    for name, (main, others) in found.items():
        assert others < max(0.5 * main, 0.1), (name, found)


def test_the_blas_of_this_process_is_limited():
    import numpy as np
    import scipy.linalg  # noqa: F401  (a wheel of scipy brings its own)

    names = ('scipy_openblas_{}_num_threads64_', 'scipy_openblas_{}_num_threads',
             'openblas_{}_num_threads64_', 'openblas_{}_num_threads')
    found = []
    for line in Path('/proc/self/maps').read_text().splitlines():
        if 'openblas' in line and '/' in line:
            library = ctypes.CDLL(line.split(maxsplit=5)[5])
            found += [(library, name) for name in names if hasattr(library, name.format('get'))]
    for library, name in found:
        getattr(library, name.format('set'))(2)
    limit_blas_threads()
    assert {getattr(library, name.format('get'))() for library, name in found} <= {1}
    assert np.eye(500) @ np.ones(500) == pytest.approx(np.ones(500))
