# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""An installation for launch to look into."""

from __future__ import annotations

import sys

import pytest
from launch_cases import EXECUTABLES


@pytest.fixture
def prefix(tmp_path):
    """An installation in which launch finds the executables of this very copy of the code."""
    index = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
    index.mkdir(parents=True)
    (index / 'fault_tolerance').touch()
    folder = tmp_path / 'lib' / 'fault_tolerance'
    folder.mkdir(parents=True)
    for name in EXECUTABLES:
        script = folder / name
        script.write_text(
            f'#!/bin/sh\nexec {sys.executable} -m fault_tolerance.nodes.{name} "$@"\n'
        )
        script.chmod(0o755)
    return tmp_path
