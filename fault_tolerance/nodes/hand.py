# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance inject`` and ``clear``: for machines without the ros2 commands."""

from __future__ import annotations

from collections.abc import Callable

import rclpy
from rclpy.executors import Executor
from rclpy.signals import SignalHandlerOptions

from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.nodes.demo_operator import Deadline, Operator
from fault_tolerance.nodes.spinning import make_executor
from fault_tolerance.simulation.faults import EVERYTHING, SILENT, fault_words

_PATIENCE = 10.0
# Longer than the controller takes to act on what the simulator reports.
_ECHO = 1.0


def inject(words: str) -> str:
    """Order a fault of the simulated mechanism and return the controller's state after it.

    Raises
    ------
    FaultToleranceError
        If the words are refused, or no simulator or no controller runs.
    """
    mode, name, silent = fault_words(words)

    def act(operator: Operator, wait: Callable[[Callable[[], bool], str], None]) -> None:
        wait(lambda: operator.simulator_listens, 'the simulator')
        if name == EVERYTHING:
            operator.inject(words)
            return
        order = f'{SILENT} {mode}' if silent else mode
        wait(operator.set_fault(name, order), 'an answer of the simulator')
        if operator.refusal:
            raise FaultToleranceError(operator.refusal)

    return _with_operator(act)


def clear() -> str:
    """Ask the controller to release failures and return its answer."""

    def act(operator: Operator, wait: Callable[[Callable[[], bool], str], None]) -> None:
        wait(lambda: operator.controller_listens, 'the controller')
        wait(operator.clear(), 'an answer of the controller')

    return _with_operator(act)


def _with_operator(
    act: Callable[[Operator, Callable[[Callable[[], bool], str], None]], None]
) -> str:
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    operator, executor = Operator(), make_executor()
    executor.add_node(operator)

    def wait(condition: Callable[[], bool], what: str) -> None:
        _wait(executor, condition, what)

    try:
        wait(lambda: bool(operator.state), 'the controller')
        act(operator, wait)
        echo = Deadline(_ECHO)
        wait(lambda: echo.passed, 'the controller')
        return operator.answer or operator.state
    finally:
        executor.remove_node(operator)
        operator.destroy_node()
        rclpy.try_shutdown()


def _wait(executor: Executor, condition: Callable[[], bool], what: str) -> None:
    deadline = Deadline(_PATIENCE)
    while not condition():
        if deadline.passed:
            raise FaultToleranceError(f'waited {_PATIENCE:g} s for {what} in vain')
        executor.spin_once(timeout_sec=0.05)
