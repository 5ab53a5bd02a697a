# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance watch``: the live view of a running controller."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from time import monotonic

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rich.console import Console
from rich.live import Live

from fault_tolerance.analysis.live_view import LiveView, plain_line
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.spinning import make_executor
from fault_tolerance.nodes.watching import REFRESH_PERIOD, Watcher

_LINE_PERIOD = 5.0
_STEP = 0.05


def watch(namespace: str = '', mechanism: str = '', duration: float = math.inf) -> int:
    """Show the controller in ``namespace`` until Ctrl-C, or for ``duration`` seconds."""
    machine = mechanism_named(mechanism) if mechanism else None
    console = Console()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node(f'watch_{os.getpid()}', namespace=namespace, enable_rosout=False)
    executor = make_executor()
    executor.add_node(node)
    try:
        watcher, end = Watcher(node, machine), monotonic() + duration
        show = _on_screen if console.is_terminal else _in_lines
        for _ in show(watcher, console):
            executor.spin_once(timeout_sec=_STEP)
            if monotonic() > end:
                break
    except KeyboardInterrupt:
        pass
    finally:
        executor.remove_node(node)
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _on_screen(watcher: Watcher, console: Console) -> Iterator[None]:
    """Paint the view anew now and then."""
    with Live(console=console, auto_refresh=False, transient=False) as live:
        painted = -math.inf
        while True:
            if monotonic() - painted >= REFRESH_PERIOD:
                live.update(LiveView(watcher.snapshot()), refresh=True)
                painted = monotonic()
            yield


def _in_lines(watcher: Watcher, console: Console) -> Iterator[None]:
    """Print a line whenever the verdict changes, and every few seconds."""
    begin, printed, before = monotonic(), -math.inf, None
    while True:
        snapshot, now = watcher.snapshot(), monotonic()
        verdict = (snapshot.state, snapshot.reason)
        # While the metrics have not followed the state yet there is no reason.
        changed = verdict != before and (snapshot.reason or not snapshot.state)
        if changed or now - printed >= _LINE_PERIOD:
            print(f'{now - begin:7.1f} s  {plain_line(snapshot)}', flush=True)
            printed, before = now, verdict
        yield
