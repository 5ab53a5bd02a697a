# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Nodes to test with, ended again whatever happens."""

from __future__ import annotations

import pytest
import rclpy
from node_rig import Plant, Probe, starting


@pytest.fixture(scope='session')
def ros():
    # Another folder's tests may have begun it in the same run; then they end it.
    first = not rclpy.ok()
    if first:
        rclpy.init(args=[])
    yield
    if first:
        rclpy.try_shutdown()


@pytest.fixture
def start(tmp_path):
    yield from starting(tmp_path)


@pytest.fixture(scope='module')
def start_for_module(tmp_path_factory):
    yield from starting(tmp_path_factory.mktemp('nodes'))


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
