# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Nodes to test with, ended again whatever happens."""

from __future__ import annotations

import pytest
import rclpy
from node_rig import NodeProcess, Plant, Probe


@pytest.fixture(scope='session')
def ros():
    rclpy.init(args=[])
    yield
    rclpy.shutdown()


def _starting(folder):
    """Yield start(module, namespace='', **parameters) -> NodeProcess, and end all it started."""
    processes = []

    def started(module: str, namespace: str = '', **parameters: object) -> NodeProcess:
        log = folder / f'{len(processes)}_{module}.log'
        processes.append(NodeProcess(module, log, namespace, **parameters))
        return processes[-1]

    yield started
    for process in reversed(processes):
        process.end()
    for process in processes:
        print(process.output)


@pytest.fixture
def start(tmp_path):
    yield from _starting(tmp_path)


@pytest.fixture(scope='module')
def start_for_module(tmp_path_factory):
    yield from _starting(tmp_path_factory.mktemp('nodes'))


@pytest.fixture
def probe(ros):
    probe = Probe()
    yield probe
    probe.close()


@pytest.fixture
def controller(start, probe):
    """A controller of fsm_4_strut whose drives are played by the test."""
    return start('controller', mechanism='fsm_4_strut')


@pytest.fixture
def plant(controller, probe):
    plant = Plant(probe, ['theta_1', 'theta_2', 'theta_3', 'theta_4'])
    plant.connect()
    return plant
