# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Threads of a node's process: BLAS workers and real-time priority."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

from fault_tolerance.control.notices import Notice

# Builds differ by prefix and suffix: wheels of numpy and scipy have a BLAS each. Names that end in
# one more underscore are the Fortran interface, which takes a pointer.
_SETTERS = (
    *(f'{prefix}openblas_set_num_threads{suffix}'
      for prefix in ('', 'scipy_') for suffix in ('', '64_', '_64')),
    'bli_thread_set_num_threads', 'MKL_Set_Num_Threads',
)
_LIBRARIES = ('blas', 'blis', 'mkl_rt')


def limit_blas_threads() -> int:
    """Make every BLAS in this process compute in the calling thread; return how many there are.

    BLAS workers busy-wait for their next task. Matrices of a few rows keep them spinning on a
    whole core and gain nothing. The environment variables for this must be set before numpy is
    imported, which is too late for a node's entry point. Call after the last import. Systems
    without ``/proc`` are left as they are.
    """
    try:
        lines = Path('/proc/self/maps').read_text().splitlines()
    except OSError:
        return 0
    fields = (line.split(maxsplit=5) for line in lines)
    paths = {one[5] for one in fields if len(one) == 6 and one[5].startswith('/')}
    limited = 0
    for path in sorted(path for path in paths if any(word in path for word in _LIBRARIES)):
        try:
            library = ctypes.CDLL(path)
        except OSError:  # a data file, or a library that was replaced
            continue
        setters = [getattr(library, name) for name in _SETTERS if hasattr(library, name)]
        for setter in setters:
            setter(ctypes.c_ssize_t(1))
        limited += bool(setters)
    return limited


def set_realtime_priority(priority: int) -> Notice | None:
    """Put all threads of this process under SCHED_FIFO with ``priority``; 0 changes nothing.

    Threads created later inherit the policy from the thread that creates them. If the system
    refuses, the function returns a warning with the reason.
    """
    if priority == 0:
        return None
    try:
        threads = [int(task.name) for task in Path('/proc/self/task').iterdir()]
        for thread in threads:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except (AttributeError, OSError, ValueError) as error:
        text = f'no real-time scheduling (priority {priority}): {error}'
        return Notice('real_time', text, rejected=False)
    return None
