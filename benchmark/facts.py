# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What machine and which versions the figures were measured with."""

from __future__ import annotations

import os
import platform
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from fault_tolerance.kernel.compilation import best_kernel

PACKAGES = (
    'numpy', 'scipy', 'numba', 'ros-rclpy', 'ros-rmw-fastrtps-cpp', 'pin', 'pin-pink', 'mujoco',
    'mink',
)
SETTINGS = ('RMW_IMPLEMENTATION', 'FASTDDS_BUILTIN_TRANSPORTS', 'OPENBLAS_NUM_THREADS')


def machine_facts() -> dict[str, Any]:
    """Return them, as JSON has them."""
    return {
        'cpu': _cpu(),
        'cores': len(os.sched_getaffinity(0)),
        'load': list(os.getloadavg()),
        'python': sys.version.split()[0],
        'versions': {name: found for name in PACKAGES if (found := _version(name))},
        'executor': _executor(),
        'settings': {name: os.environ[name] for name in SETTINGS if name in os.environ},
        'scheduling': _scheduling(),
        'kernel': platform.release(),
        'compiled': best_kernel().compiled,
    }


def _cpu() -> str:
    for line in Path('/proc/cpuinfo').read_text().splitlines():
        if line.startswith('model name'):
            return line.partition(':')[2].strip()
    return platform.machine()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ''


def _executor() -> str:
    try:
        from rclpy.experimental import events_executor
    except ImportError:
        return 'SingleThreadedExecutor'
    return events_executor.EventsExecutor.__name__


def _scheduling() -> str:
    policies = {os.SCHED_OTHER: 'ordinary', os.SCHED_FIFO: 'FIFO', os.SCHED_RR: 'RR'}
    policy = policies.get(os.sched_getscheduler(0), 'other')
    return f'{policy}, nice {os.nice(0)}'
