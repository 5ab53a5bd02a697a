# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The cable between controller and mirror is pulled: hold, zeros, and back by itself."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent


@pytest.mark.needs_network_namespaces
def test_a_cut_link_holds_and_its_return_resumes(network):
    path = [str(HERE.parent / 'ros'), os.environ.get('PYTHONPATH', '')]
    environment = {
        **os.environ,
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
        'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
        'PYTHONPATH': os.pathsep.join(part for part in path if part),
    }
    done = subprocess.run(
        [*network, sys.executable, HERE / 'two_hosts.py'],
        env=environment, capture_output=True, text=True, timeout=120, check=False,
    )
    assert done.returncode == 0, f'{done.stdout}\n{done.stderr}'
    print(done.stdout)
