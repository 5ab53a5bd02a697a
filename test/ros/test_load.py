# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Under load: every message is taken, and a flood of diagnostics costs the commands nothing."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from node_rig import NodeProcess, Plant, Probe
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import UInt32

from fault_tolerance.nodes.spinning import Deferred, make_executor, turn

HERE = Path(__file__).parent
WINDOW = 1.0
FILLING = 0.4
RATE = 100.0
WINDOWS = 8
"""Attempts: the machine itself may be in the way."""


def test_every_message_of_a_run_is_taken_once_and_in_order(ros):
    node, executor = Node('counter', enable_rosout=False), make_executor()
    executor.add_node(node)
    everything = QoSProfile(depth=5000)
    taken: list[int] = []

    # Deferred work that never ends must not keep messages out.
    node.deferred = Deferred()

    def endless() -> None:
        node.deferred.add(endless)

    endless()
    node.create_subscription(
        UInt32, 'counted', lambda message: taken.append(message.data), everything
    )
    publisher = node.create_publisher(UInt32, 'counted', everything)
    deadline = time.monotonic() + 30.0
    while not publisher.get_subscription_count():
        assert time.monotonic() < deadline
        executor.spin_once(timeout_sec=0.02)
    for number in range(3000):
        publisher.publish(UInt32(data=number))
        if number % 7 == 0:
            turn(executor, node)
    while len(taken) < 3000:
        assert time.monotonic() < deadline, f'{len(taken)} of 3000'
        turn(executor, node)
    executor.remove_node(node)
    node.destroy_node()
    assert taken == list(range(3000))


def answered(probe: Probe, plant: Plant, window: float = WINDOW) -> float:
    """Return how many commands come per joint state, at 100 Hz."""
    before, sent = len(probe.commands), 0
    begin = time.monotonic()
    while (passed := time.monotonic() - begin) < window:
        if passed * RATE > sent:
            if sent % 5 == 0:
                plant.ask(0.01, 0.02)
            plant.joint_states.publish(plant.joint_state())
            sent += 1
        probe.spin_until(begin + sent / RATE)
    probe.spin(0.1)
    return (len(probe.commands) - before) / sent


def resident(pid: int) -> float:
    """Return the memory a process holds, megabytes."""
    pages = int(Path(f'/proc/{pid}/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


@pytest.mark.timed
def test_a_flood_of_diagnostics_costs_the_commands_nothing(plant, probe, controller):
    quiet = 0.0
    for _ in range(WINDOWS):
        quiet = max(quiet, answered(probe, plant))
        if quiet > 0.8:
            break
    assert quiet > 0.8
    for kind in ('identical', 'changing', 'ours'):
        check_flood(plant, probe, controller, kind, quiet)
    # Nobody here has wheels, so nothing has failed.
    assert {one.data for one in probe.states} <= {'waiting', 'nominal', 'hold'}


def check_flood(plant: Plant, probe: Probe, controller: NodeProcess, kind: str, quiet: float):
    """A flood of one kind leaves nearly as many commands per joint state as it was ``quiet``."""
    command = [sys.executable, str(HERE / 'flood.py'), kind]
    flood = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        flood.stdout.readline()
        answered(probe, plant, FILLING)  # what buffers there are fill
        before = resident(controller.process.pid)
        shares, metrics = [], []
        while len(shares) < WINDOWS and max(shares, default=0.0) < 0.95 * quiet:
            count = len(probe.metrics)
            shares.append(answered(probe, plant))
            metrics.append((len(probe.metrics) - count) / WINDOW)
        grown = resident(controller.process.pid) - before
    finally:
        flood.kill()
        sent = int(flood.communicate()[0].split()[-1])
    print(f'{kind}: {sent} sent, commands per joint state {shares}, {quiet} before; +{grown} MB')
    assert sent > 1000
    assert max(shares) >= 0.95 * quiet, (shares, quiet)
    assert max(metrics) >= 4.5, f'metrics at {metrics} Hz'
    assert grown < 20.0, f'{grown:.1f} MB more'
