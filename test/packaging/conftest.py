# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A copy of the checkout to build from, so that no build leaves anything in the checkout."""

import os
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MADE = shutil.ignore_patterns('.*', '*.egg-info', '__pycache__', 'build', 'dist', 'install', 'log',
                              '*_output')


@pytest.fixture(scope='session')
def source(tmp_path_factory):
    """Return the folder of a fresh copy of the checkout."""
    return Path(shutil.copytree(ROOT, tmp_path_factory.mktemp('source') / 'fault_tolerance',
                                ignore=MADE))


@pytest.fixture
def environment():
    """Return this process's environment without what would point a child back at the checkout."""
    kept = dict(os.environ)
    for name in ('PYTEST_ADDOPTS', 'COLCON_PREFIX_PATH', 'AMENT_PREFIX_PATH'):
        kept.pop(name, None)
    # Code that is installed anew is compiled anew, which takes half a minute.
    kept['FAULT_TOLERANCE_KERNEL'] = 'python'
    return kept
