# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How a node gets its kernel: compiled if it can be had at once, else later, without a pause.

Where the kernel has never been compiled, the node starts with the same source as Python, and
another process compiles it. Compiling in a thread would stall the node's callbacks.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from importlib.util import find_spec
from shutil import rmtree
from tempfile import mkdtemp
from threading import Thread

from rclpy.impl.rcutils_logger import RcutilsLogger

from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.kernel.compilation import (
    Kernel,
    best_kernel,
    can_be_kept,
    is_cached,
    is_wanted,
    python_kernel,
)

# The same package as here, wherever the node was started.
_COMPILE = (
    'import sys; sys.path[:] = {}; '
    'from fault_tolerance.kernel.compilation import best_kernel; best_kernel()'
)
_SLOW = 'commands are computed by Python, about a hundred times slower'


class KernelStartup:
    """Gives the ``kernel`` to begin with, and the compiled one when it is ready.

    ``remark`` is one line for the log; empty if the kernel is compiled.
    """

    def __init__(self) -> None:
        self._ready: Kernel | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._folder = ''
        if not is_wanted() or is_cached() or find_spec('numba') is None:
            self.kernel = best_kernel()
            self.remark = f'{_SLOW}: {self.kernel.reason}' if self.kernel.reason else ''
            return
        self.kernel = python_kernel('being compiled')
        self.remark = f'{_SLOW}, while the kernel is compiled for this machine, once (a minute)'
        try:
            if not can_be_kept():
                # The process that compiles gets a private folder to leave the machine code in.
                self._folder = mkdtemp(prefix='fault_tolerance_')
                os.environ['XDG_CACHE_HOME'] = self._folder
            self._process = subprocess.Popen(
                [sys.executable, '-c', _COMPILE.format(sys.path)],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )
        except OSError as error:
            self.remark = f'{_SLOW}: {error}'
            return
        Thread(target=self._wait, args=(self._process,), daemon=True).start()

    def exchange(self, supervisor: Supervisor, logger: RcutilsLogger) -> None:
        """Give the kernel to go on with to ``supervisor``, once, as soon as it is ready.

        The ``logger`` tells which it is.
        """
        kernel = self._ready
        if kernel is None:
            return
        # Only now: the thread may set it at any moment.
        self._ready, supervisor.kernel = None, kernel
        gc.freeze()  # what numba has brought need not be collected
        tell = logger.warning if kernel.reason else logger.info
        tell(f'kernel: {kernel.reason or "compiled"}')

    def end(self) -> None:
        """End the process that compiles, if it still runs."""
        if self._process is not None:
            self._process.kill()
        if self._folder:
            rmtree(self._folder, ignore_errors=True)

    def _wait(self, process: subprocess.Popen[bytes]) -> None:
        process.wait()
        # Loading machine code takes a fraction of a second, most of it without Python's lock.
        self._ready = best_kernel() if is_cached() else python_kernel('compiling failed')
