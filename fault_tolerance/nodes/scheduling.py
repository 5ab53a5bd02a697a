# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Real-time scheduling of this process, where the system grants it."""

from __future__ import annotations

import os
from pathlib import Path


def scheduled_real_time(priority: int) -> str:
    """Put all threads of this process under SCHED_FIFO; return why that failed, if it did.

    Threads made later inherit it from those that make them.

    Parameters
    ----------
    priority : int
        1 to 99; 0 leaves everything as it is.
    """
    if priority == 0:
        return ''
    try:
        threads = [int(task.name) for task in Path('/proc/self/task').iterdir()]
        for thread in threads:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except (AttributeError, OSError, ValueError) as error:
        return f'no real-time scheduling (priority {priority}): {error}'
    return ''
