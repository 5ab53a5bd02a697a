# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The three nodes as child processes."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Mapping

from fault_tolerance.errors import FaultToleranceError

# A node exits within 2 s of SIGINT; one that takes longer is killed.
_PATIENCE = 5.0

# PR_SET_PDEATHSIG (1) of Linux: a node ends with its parent, however that ends.
_START = (
    'import ctypes, runpy, signal, sys; '
    'getattr(ctypes.CDLL(None), "prctl", max)(1, int(signal.SIGTERM)); '
    'runpy.run_module(sys.argv.pop(1), run_name="__main__", alter_sys=True)'
)


class NodeProcesses:
    """The controller, the simulator and the pointing reference, each a process of its own.

    ``parameters`` are by module name of the node (``controller``, ``fsm_simulator``,
    ``pointing_reference``). All three are in one ``namespace``.
    """

    def __init__(
        self, parameters: Mapping[str, Mapping[str, object]], namespace: str = ''
    ) -> None:
        self._parameters = parameters
        self._remapping = ['-r', f'__ns:=/{namespace}'] if namespace else []
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> NodeProcesses:
        """Start them."""
        try:
            for module, values in self._parameters.items():
                self._start(module, values)
        except BaseException:
            self.__exit__()
            raise
        return self

    def _start(self, module: str, values: Mapping[str, object]) -> None:
        command = [sys.executable, '-c', _START, f'fault_tolerance.nodes.{module}', '--ros-args']
        # The terminal is the parent's; what they say is on /rosout.
        command += ['--disable-stdout-logs', *self._remapping]
        for name, value in values.items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            command += ['-p', f'{name}:={text}']
        # A process group of its own: Ctrl-C in the terminal reaches only the parent.
        self._processes[module] = subprocess.Popen(command, start_new_session=True)

    def check(self) -> None:
        """Raise `FaultToleranceError` if one of the processes has exited."""
        for module, process in self._processes.items():
            if process.poll() is not None:
                raise FaultToleranceError(f'{module} ended with exit code {process.returncode}')

    def __exit__(self, *_: object) -> None:
        """Interrupt them in reverse order, and wait until they have exited."""
        running = list(reversed(self._processes.values()))
        for process in running:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in running:
            try:
                process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
