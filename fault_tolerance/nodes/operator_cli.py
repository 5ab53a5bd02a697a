# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance inject`` and ``clear``: for machines without the ros2 commands."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.nodes.operator_client import CONTROLLER, SIMULATOR, OperatorClient
from fault_tolerance.nodes.spinning import spun
from fault_tolerance.simulation.faults import EVERYTHING, SILENT, fault_words

NOTHING_RELEASED = 1
"""Exit code of a clear that has released nothing."""

_PATIENCE = 10.0
# For a clear that resets drives first: longer than the parameter reset_timeout may be.
_RESET_PATIENCE = 70.0
# Longer than the controller takes to react to a report of the simulator.
_REACTION_TIME = 1.0
# In which a controller that runs is heard of.
_DISCOVERY_TIME = 4.0

Wait = Callable[..., None]
"""Spins until a condition holds; the text names what it waits for."""


def inject(words: str, namespace: str = '', node: str = SIMULATOR) -> str:
    """Inject a fault, ``words`` as ``[silent] MODE NAME``; return the controller's state after it.

    ``namespace`` is that of controller and simulator, ``node`` the simulator's name. If there is
    no controller the result says so. Raises `FaultToleranceError` if the words are rejected, or no
    simulator answers.
    """
    mode, name, silent = fault_words(words)

    def act(operator: OperatorClient, wait: Wait) -> None:
        wait(lambda: operator.simulator_listens, f'the simulator {operator.simulator}')
        if name == EVERYTHING:
            operator.inject(words)
            return
        order = f'{SILENT} {mode}' if silent else mode
        parts: list[str] = []
        wait(operator.ask_parts(parts), f'the simulator {operator.simulator}')
        if name not in parts:
            known = ', '.join((*parts, EVERYTHING))
            raise FaultToleranceError(f'{name!r} is no actuator or strut of it; there is: {known}')
        wait(operator.set_fault(name, order), f'the simulator {operator.simulator}')
        if operator.refusal:
            raise FaultToleranceError(operator.refusal)

    done = _with_operator(lambda: OperatorClient(namespace, simulator=node), act)
    return done.state or f'injected; no controller {done.controller} is heard'


def clear(namespace: str = '', node: str = CONTROLLER) -> tuple[str, int]:
    """Ask the controller ``node`` in ``namespace`` to clear its failures.

    Returns its answer, and the exit code: `NOTHING_RELEASED` if so, else 0. Raises
    `FaultToleranceError` if it does not answer.
    """

    def act(operator: OperatorClient, wait: Wait) -> None:
        wait(lambda: bool(operator.state), f'the controller {operator.controller}')
        wait(lambda: operator.controller_listens, f'the controller {operator.controller}')
        wait(operator.clear(), f'the controller {operator.controller}', _RESET_PATIENCE)

    done = _with_operator(lambda: OperatorClient(namespace, controller=node), act)
    return done.answer, 0 if done.released else NOTHING_RELEASED


def _with_operator(
    create: Callable[[], OperatorClient], act: Callable[[OperatorClient, Wait], None]
) -> OperatorClient:
    """Return the operator after it has acted and what follows has been heard of."""
    with spun(create) as (operator, executor):

        def wait(
            condition: Callable[[], bool], what: str, patience: float = _PATIENCE
        ) -> None:
            deadline = monotonic() + patience
            while not condition():
                if monotonic() > deadline:
                    raise FaultToleranceError(f'no answer within {patience:g} s from {what}')
                executor.spin_once(timeout_sec=0.05)

        act(operator, wait)
        acted = monotonic()
        wait(
            lambda: monotonic() - acted > (_REACTION_TIME if operator.state else _DISCOVERY_TIME),
            'the clock',
        )
        return operator
