# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How nodes run: set up, spin until a signal, stop the drives, return an exit code."""

from __future__ import annotations

import gc
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.nodes.scheduling import limit_blas_threads

BAD_SET_UP = 2
"""Exit code of a node that could not be set up."""

# Python runs signal handlers between callbacks: an idle node sees a signal within this time.
_PATIENCE = 0.1
_SET_UP_ERRORS = (
    FaultToleranceError, ParameterException, rclpy_implementation.RCLError, ValueError, OSError,
)
_NodeType = TypeVar('_NodeType', bound=Node)


class Deferred:
    """Work that must not delay a command, in the order in which it was added.

    The loop that spins a node with an attribute ``deferred`` runs it piece by piece: before each
    piece one pending message is taken, so that neither starves the other.
    """

    def __init__(self) -> None:
        self._work: dict[Callable[[], object], None] = {}

    def __len__(self) -> int:
        return len(self._work)

    def add(self, work: Callable[[], object]) -> None:
        """Queue ``work``, called without arguments, unless it is queued already."""
        self._work[work] = None

    def run_next(self) -> None:
        """Run the oldest piece. A piece that raises is not repeated."""
        work = next(iter(self._work))
        del self._work[work]
        work()


def run(name: str, create: Callable[[], Node], args: list[str] | None = None) -> int:
    """Run the node that ``create`` returns until SIGINT or SIGTERM; return the exit code.

    rclpy's signal handlers shut the context down at once, after which nothing can be published.
    These handlers leave the loop instead; a node may have a method ``on_shutdown``. ``name``
    begins the one line on standard error that says why the node could not start. ``args`` is the
    command line; that of the process by default.
    """
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: signals.append(number))
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy has one type for each kind of bad argument
        return _refuse(name, error)
    node = None
    try:
        node = create()
        limit_blas_threads()
        executor = make_executor()
        executor.add_node(node)
        gc.collect()
        gc.freeze()
        # A node with deferred work schedules its collections itself.
        if hasattr(node, 'deferred'):
            gc.disable()
        while not signals and rclpy.ok():
            turn(executor, node)
        if hasattr(node, 'on_shutdown') and rclpy.ok():
            node.on_shutdown()
        executor.remove_node(node)
    except _SET_UP_ERRORS as error:
        return _refuse(name, error)
    finally:
        gc.enable()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def turn(executor: Executor, node: Node) -> None:
    """Wait for a message and take it; with deferred work pending, do a piece of it after that.

    ``executor`` spins ``node``, which may have an attribute ``deferred``, a `Deferred`, and logs
    exceptions of callbacks.
    """
    deferred = getattr(node, 'deferred', None)
    try:
        if not deferred:
            executor.spin_once(timeout_sec=_PATIENCE)
            return
        executor.spin_once(timeout_sec=0.0)
        deferred.run_next()
    except ExternalShutdownException:
        pass
    except Exception as error:  # a failing callback must not end the node
        node.get_logger().error(
            f'a callback failed: {type(error).__name__}: {error}', throttle_duration_sec=1.0
        )


@contextmanager
def spun(create: Callable[[], _NodeType]) -> Iterator[tuple[_NodeType, Executor]]:
    """Initialise ROS for an interactive tool, and shut it down at the end, by a signal too.

    Yields the node that ``create`` returns, and the executor that spins it.
    """
    # By itself Python would end at once, and leave running what the tool has started.
    ending = [one for one in (signal.SIGTERM, signal.SIGHUP)
              if signal.getsignal(one) is signal.SIG_DFL]
    with handled(ending, _leave):
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        try:
            node, executor = create(), make_executor()
            limit_blas_threads()
            executor.add_node(node)
            try:
                yield node, executor
            finally:
                executor.remove_node(node)
                node.destroy_node()
        finally:
            rclpy.try_shutdown()


@contextmanager
def handled(
    numbers: Iterable[signal.Signals], handler: Callable[[int, object], object]
) -> Iterator[None]:
    """Have the ``handler`` called, with number and frame, at the signals ``numbers`` meanwhile.

    Yields None.
    """
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler_before in before.items():
            signal.signal(number, handler_before)


def _leave(number: int, _: object) -> None:
    raise SystemExit(128 + number)


def make_executor() -> Executor:
    """Return an EventsExecutor, which has the least overhead, else a SingleThreadedExecutor."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()


def _refuse(name: str, error: Exception) -> int:
    print(f'{name}: {" ".join(str(error).split())}', file=sys.stderr)
    return BAD_SET_UP
