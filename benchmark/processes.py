# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Processes under measurement, and the processor time they take."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

_PATIENCE = 5.0
ROOT = Path(__file__).resolve().parent.parent


class Processes:
    """Python modules run as processes, ended together.

    Parameters
    ----------
    commands : mapping of str to list of str
        Module and arguments by a name of one's own.
    settings : mapping of str to str, optional
        Environment variables they have besides the present ones.
    """

    def __init__(
        self, commands: Mapping[str, list[str]], settings: Mapping[str, str] | None = None
    ) -> None:
        self._commands = commands
        self._environment = {**os.environ, **(settings or {})}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Processes:
        for name, command in self._commands.items():
            # A group of its own: Ctrl-C reaches only the one who cleans up.
            self._running[name] = subprocess.Popen(
                [sys.executable, '-m', *command],
                cwd=ROOT, env=self._environment, start_new_session=True,
            )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for process in self._running.values():
            process.send_signal(signal.SIGINT)
        for process in self._running.values():
            try:
                process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def check(self) -> None:
        """Raise RuntimeError if one of them has ended."""
        for name, process in self._running.items():
            if process.poll() is not None:
                raise RuntimeError(f'{name} ended with exit code {process.returncode}')

    def cpu(self, name: str) -> float:
        """Return the processor time a process has taken, seconds, all threads."""
        total = 0
        for task in Path(f'/proc/{self._running[name].pid}/task').iterdir():
            try:
                total += int((task / 'schedstat').read_text().split()[0])
            except (FileNotFoundError, ProcessLookupError):  # a thread that has just ended
                continue
        return total * 1e-9
