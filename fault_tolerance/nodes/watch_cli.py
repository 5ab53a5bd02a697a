# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance watch``: the live view of a running controller."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from time import monotonic

from rclpy.node import Node
from rich.console import Console
from rich.live import Live

from fault_tolerance.analysis.live_view import LiveView, plain_line
from fault_tolerance.analysis.terminal import console_for_text
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.controller_monitor import REFRESH_PERIOD, ControllerMonitor
from fault_tolerance.nodes.operator_client import CONTROLLER
from fault_tolerance.nodes.spinning import spun

_LINE_PERIOD = 5.0
_STEP = 0.05


NOT_HEARD = 1
"""Exit code if there was no controller to watch."""


def watch(
    namespace: str = '', mechanism: str = '', duration: float = math.inf,
    controller: str = CONTROLLER,
) -> int:
    """Show a controller until Ctrl-C: as a live view on a terminal, as lines elsewhere.

    ``namespace`` and ``controller`` are those of the node. ``mechanism`` is name or file of its
    mechanism, for limits and units; empty: the shipped one that it names. Returns the exit code of
    the process after ``duration`` seconds.
    """
    heard = False
    machine = mechanism_named(mechanism) if mechanism else None
    console = console_for_text()
    name = f'watch_{os.getpid()}'
    try:
        with spun(lambda: Node(name, namespace=namespace, enable_rosout=False)) as (
            node, executor
        ):
            monitor, end = ControllerMonitor(node, machine, controller), monotonic() + duration
            show = _on_screen if console.is_terminal else _in_lines
            for _ in show(monitor, console):
                executor.spin_once(timeout_sec=_STEP)
                heard = heard or monitor.heard
                if monotonic() > end:
                    break
    except KeyboardInterrupt:
        pass
    return 0 if heard else NOT_HEARD


def _on_screen(monitor: ControllerMonitor, console: Console) -> Iterator[None]:
    """Refresh the live view periodically."""
    with Live(console=console, auto_refresh=False, transient=False) as live:
        painted = -math.inf
        while True:
            if monotonic() - painted >= REFRESH_PERIOD:
                live.update(LiveView(monitor.snapshot()), refresh=True)
                painted = monotonic()
            yield


def _in_lines(monitor: ControllerMonitor, console: Console) -> Iterator[None]:
    """Print a line when the verdict or the suspicion changes, and periodically."""
    begin, printed, before = monotonic(), -math.inf, None
    while True:
        snapshot, now = monitor.snapshot(), monotonic()
        suspects = tuple(one.candidates for one in snapshot.suspects)
        verdict = (snapshot.state, snapshot.reason, suspects)
        # The reason is empty until the metrics have followed the state.
        changed = verdict != before and (snapshot.reason or not snapshot.state)
        if changed or now - printed >= _LINE_PERIOD:
            print(f'{now - begin:7.1f} s  {plain_line(snapshot)}', flush=True)
            printed, before = now, verdict
        yield
