# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Long and wide tests of the running nodes: once in `make test` is enough for these."""

from __future__ import annotations

import pytest
import rclpy
from node_rig import Probe, starting


@pytest.fixture(scope='session')
def ros():
    # Other folders' tests may have begun it in the same run; then they end it.
    first = not rclpy.ok()
    if first:
        rclpy.init(args=[])
    yield
    if first:
        rclpy.try_shutdown()


@pytest.fixture
def start(tmp_path):
    yield from starting(tmp_path)


@pytest.fixture
def probe(ros):
    probe = Probe()
    yield probe
    probe.close()
