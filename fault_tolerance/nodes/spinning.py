# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How the nodes run: set up, spin until a signal, say farewell, and leave with an exit code."""

from __future__ import annotations

import gc
import signal
import sys
from collections.abc import Callable
from types import FrameType

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.nodes.idle import IdleTime

BAD_SET_UP = 2
"""Exit code of a node that could not be set up."""

# Python runs signal handlers between callbacks; an idle node gets to it this often.
_PATIENCE = 0.1
_SET_UP_ERRORS = (
    FaultToleranceError,
    ParameterException,
    rclpy_implementation.RCLError,
    ValueError,
    OSError,
)


def run(name: str, create: Callable[[], Node], args: list[str] | None = None) -> int:
    """Run a node until SIGINT or SIGTERM; return the exit code of the process.

    rclpy's own signal handlers close the context at once, after which nothing can be published
    any more; so the handlers are ours, and a node may have a `farewell`.

    Parameters
    ----------
    name : str
        For the one line that tells why the node could not start.
    create : callable
        Returns the node.
    args : list of str, optional
        Command line; that of the process by default.
    """
    leaving = []

    def leave(number: int, _frame: FrameType | None) -> None:
        leaving.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, leave)
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy's own, one for each kind of bad argument
        return _refused(name, error)
    node = None
    try:
        node = create()
        executor = make_executor()
        executor.add_node(node)
        idle = getattr(node, 'idle', None)
        # Garbage is collected in idle time where a node provides for it, and not in between.
        gc.collect()
        gc.freeze()
        if idle is not None:
            gc.disable()
        while not leaving and rclpy.ok():
            turn(executor, node, idle)
        if hasattr(node, 'farewell') and rclpy.ok():
            node.farewell()
        executor.remove_node(node)
    except _SET_UP_ERRORS as error:
        return _refused(name, error)
    finally:
        gc.enable()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def turn(executor: Executor, node: Node, idle: IdleTime | None) -> None:
    """Wait for a message and take it, or do what is due while none is waiting."""
    try:
        if idle is None or idle.next_job() is None:
            executor.spin_once(timeout_sec=_PATIENCE)
            return
        activity = idle.activity
        executor.spin_once(timeout_sec=0.0)
        if idle.activity == activity and (job := idle.next_job()) is not None:
            job.do()
    except ExternalShutdownException:
        pass
    except Exception as error:  # a callback failed: that must not take the node down
        node.get_logger().error(
            f'a callback failed: {type(error).__name__}: {error}', throttle_duration_sec=1.0
        )


def make_executor() -> Executor:
    """Return the executor with the least overhead there is."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()


def _refused(name: str, error: Exception) -> int:
    print(f'{name}: {" ".join(str(error).split())}', file=sys.stderr)
    return BAD_SET_UP
