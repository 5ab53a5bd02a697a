# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""One pass of the demonstration through its phases: inject, observe, repair."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from time import monotonic

from rclpy.executors import Executor
from rich.console import Console
from rich.live import Live

from fault_tolerance.analysis.live_view import LiveView
from fault_tolerance.analysis.phases import LISTENING, Note, Phase, note_as_text
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.controller_monitor import REFRESH_PERIOD, ControllerMonitor
from fault_tolerance.nodes.operator_client import OperatorClient
from fault_tolerance.nodes.processes import NodeProcesses

PERIOD = 1.0
SETTLING = 1.0
PERIODS = 3
"""The circle takes 1 s; the error is evaluated from 1 s after a failure, over three turns."""

START_UP = 1.2
"""Seconds from rest to steady tracking of the circle."""

FOLLOWING = 1e-4
"""Radians; a mirror with a smaller error follows the circle of 1 mrad."""

ENGAGEMENT = 0.6
"""Seconds in which a repaired part takes up its load: twelve of its time constants."""

_START_PATIENCE = 30.0
_PATIENCE = 8.0
_COMMANDS = 'velocity_controller/commands'
_STEP = 0.05


def require_no_other_controller(
    operator: OperatorClient, executor: Executor, own: int = 0, discovery: float = 0.0
) -> None:
    """Raise `FaultToleranceError` if another controller commands in this ROS domain.

    ``executor`` spins the ``operator``, for at least ``discovery`` seconds; ``own`` is how many
    controllers are ours.
    """
    def others() -> int:
        return operator.count_publishers(_COMMANDS) - own

    begin = monotonic()
    # The controller of the pass before may still be known.
    while (passed := monotonic() - begin) < discovery or (others() > 0 and passed < _PATIENCE):
        executor.spin_once(timeout_sec=_STEP)
    if others() > 0:
        raise FaultToleranceError(
            f'{others()} more on {_COMMANDS} in this ROS domain: end that controller, or set'
            ' another ROS_DOMAIN_ID'
        )


class DemoPass:
    """One pass through all phases, with the ``nodes`` running.

    ``executor`` spins the ``operator``; ``console`` gets progress and results; the controller
    ``acts`` on what nobody reports, and with brakes, or does not.
    """

    def __init__(
        self, mechanism: Mechanism, operator: OperatorClient, executor: Executor,
        nodes: NodeProcesses, console: Console, *, acts: bool,
    ) -> None:
        self._acts = acts
        self._mechanism = mechanism
        self._operator = operator
        self._executor = executor
        self._nodes = nodes
        self._console = console
        self._monitor = ControllerMonitor(operator, mechanism)
        self._live = Live(console=console, auto_refresh=False) if console.is_terminal else None
        self._shown = 0.0

    def go_through(self, phases: Sequence[Phase]) -> None:
        """Run the ``phases``, and repair the faults between two of them.

        Raises `FaultToleranceError` if a node exits or does not answer.
        """
        with self._live or nullcontext():
            operator = self._operator
            self._wait(
                lambda: operator.ready and operator.is_recorded, 'the nodes', _START_PATIENCE
            )
            require_no_other_controller(operator, self._executor, own=1)
            self._wait_for_state('nominal')
            # That every node is there does not mean that commands reach the mirror.
            self._wait(lambda: operator.error < FOLLOWING, 'the mirror', _PATIENCE, missing=True)
            self._pass(START_UP)
            for phase in phases:
                self._show_phase(phase)
                if phase.failures and phase is not phases[-1]:
                    self._mend(phase)

    def _show_phase(self, phase: Phase) -> None:
        operator = self._operator
        self._console.print(f'[bold]{phase.name}[/bold]')
        self._pass(LISTENING)
        stamp = operator.get_clock().now().nanoseconds
        operator.note(note_as_text(Note(phase, SETTLING, PERIOD, stamp)))
        for words in phase.words:
            operator.inject(words)
        if phase.failures and (self._acts or not phase.silent):
            wanted = phase if self._acts else replace(phase, converts=False)
            tolerable = wanted.is_tolerable(self._mechanism)
            self._wait_for_state('degraded' if tolerable else 'stopped')
        self._pass(SETTLING + PERIODS * PERIOD)
        operator.note('')
        self._pass(_STEP)
        error = self._monitor.snapshot().rms_error
        words = '' if error is None else f'; pointing error {1e6 * error:.1f} urad rms of late'
        self._console.print(f'    {operator.state}{words}')

    def _mend(self, phase: Phase) -> None:
        """Repair the faults of ``phase`` with the mirror at rest.

        A repaired drive gets rate 0 until its failure is cleared: in motion it would block the
        others. What it does while it takes up its load nobody has commanded: a controller that
        notices failures has to be told to forget it.
        """
        operator = self._operator
        self._wait(operator.pause(True), 'an answer', _PATIENCE)
        for words in phase.mending:
            operator.inject(words)
        self._pass(ENGAGEMENT)
        deadline = monotonic() + _PATIENCE
        while True:
            self._wait(operator.clear(), 'an answer', _PATIENCE)
            self._pass(2.0 * _STEP)
            if operator.active_failures == 0 and operator.state != 'stopped':
                break
            # The drives' reports of health may arrive after the first request.
            if monotonic() > deadline:
                raise FaultToleranceError('the failures could not be cleared')
        self._wait(operator.pause(False), 'an answer', _PATIENCE)
        self._wait_for_state('nominal')
        self._pass(START_UP)

    def _wait_for_state(self, state: str) -> None:
        # The summary judges the controller's decision: go on if it is another one.
        self._wait(lambda: self._operator.state == state, state, _PATIENCE, missing=True)

    def _pass(self, duration: float) -> None:
        end = self._operator.now + duration
        self._wait(lambda: self._operator.now >= end, 'joint states', duration + _PATIENCE)

    def _wait(
        self, condition: Callable[[], bool], what: str, patience: float, *, missing: bool = False
    ) -> None:
        deadline = monotonic() + patience
        while not condition():
            self._nodes.check()
            if monotonic() > deadline:
                if missing:
                    return
                raise FaultToleranceError(f'no answer within {patience:g} s from {what}')
            self._executor.spin_once(timeout_sec=_STEP)
            self._refresh()

    def _refresh(self) -> None:
        """Refresh the live view periodically, on a terminal."""
        if self._live is not None and monotonic() - self._shown >= REFRESH_PERIOD:
            self._live.update(LiveView(self._monitor.snapshot()), refresh=True)
            self._shown = monotonic()
