# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance inject`` and ``clear``: for machines without the ros2 commands."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.nodes.operator_client import OperatorClient
from fault_tolerance.nodes.spinning import spun
from fault_tolerance.simulation.faults import EVERYTHING, SILENT, fault_words

_PATIENCE = 10.0
# Longer than the controller takes to react to a report of the simulator.
_REACTION_TIME = 1.0

Wait = Callable[[Callable[[], bool], str], None]
"""Spins until a condition holds; the text names what it waits for."""


def inject(words: str) -> str:
    """Inject a fault, ``words`` as ``[silent] MODE NAME``; return the controller's state after it.

    Raises `FaultToleranceError` if the words are rejected, or no simulator or controller answers.
    """
    mode, name, silent = fault_words(words)

    def act(operator: OperatorClient, wait: Wait) -> None:
        wait(lambda: operator.simulator_listens, 'the simulator')
        if name == EVERYTHING:
            operator.inject(words)
            return
        order = f'{SILENT} {mode}' if silent else mode
        wait(operator.set_fault(name, order), 'the simulator')
        if operator.refusal:
            raise FaultToleranceError(operator.refusal)

    return _with_operator(act)


def clear() -> str:
    """Ask the controller to clear its failures and return its answer."""

    def act(operator: OperatorClient, wait: Wait) -> None:
        wait(lambda: operator.controller_listens, 'the controller')
        wait(operator.clear(), 'the controller')

    return _with_operator(act)


def _with_operator(act: Callable[[OperatorClient, Wait], None]) -> str:
    with spun(OperatorClient) as (operator, executor):

        def wait(condition: Callable[[], bool], what: str) -> None:
            deadline = monotonic() + _PATIENCE
            while not condition():
                if monotonic() > deadline:
                    raise FaultToleranceError(f'no answer within {_PATIENCE:g} s from {what}')
                executor.spin_once(timeout_sec=0.05)

        wait(lambda: bool(operator.state), 'the controller')
        act(operator, wait)
        reacted = monotonic() + _REACTION_TIME
        wait(lambda: monotonic() > reacted, 'the controller')
        return operator.answer or operator.state
