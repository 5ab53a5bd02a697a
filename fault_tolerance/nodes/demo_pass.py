# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""One pass of the demonstration through its phases: break, look, mend."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from time import monotonic

from rclpy.executors import Executor
from rich.console import Console
from rich.live import Live

from fault_tolerance.analysis.live_view import LiveView
from fault_tolerance.analysis.phases import LISTENING, Note, Phase, note_as_text
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.demo_operator import Deadline, Operator
from fault_tolerance.nodes.processes import NodeProcesses
from fault_tolerance.nodes.watching import REFRESH_PERIOD, Watcher

PERIOD = 1.0
SETTLING = 1.0
PERIODS = 3
"""The circle takes 1 s; after a failure the error counts from 1 s on, over three turns."""

START_UP = 1.2
"""Seconds for the mirror to get from rest back to the circle."""

_START_PATIENCE = 30.0
_PATIENCE = 8.0
_STEP = 0.05


class DemoPass:
    """One pass through all phases, with the nodes running.

    Parameters
    ----------
    mechanism : Mechanism
    operator : Operator
    executor : Executor
        Spins the operator.
    nodes : NodeProcesses
    console : Console
        Where it tells what happens.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        operator: Operator,
        executor: Executor,
        nodes: NodeProcesses,
        console: Console,
    ) -> None:
        self._mechanism = mechanism
        self._operator = operator
        self._executor = executor
        self._nodes = nodes
        self._console = console
        self._watcher = Watcher(operator, mechanism)
        self._live = Live(console=console, auto_refresh=False) if console.is_terminal else None
        self._shown = 0.0

    def go_through(self, phases: Sequence[Phase]) -> None:
        """Go through ``phases``, mending everything in between."""
        view: AbstractContextManager[object] = self._live or nullcontext()
        with view:
            operator = self._operator
            self._wait(
                lambda: operator.ready and operator.is_recorded, 'the nodes', _START_PATIENCE
            )
            self._wait_for_state('nominal')
            self._pass(START_UP)
            for phase in phases:
                self._show_phase(phase)
                if phase.failures and phase is not phases[-1]:
                    self._mend()

    def _show_phase(self, phase: Phase) -> None:
        operator = self._operator
        self._console.print(f'[bold]{phase.name}[/bold]')
        self._pass(LISTENING)
        operator.note(note_as_text(Note(phase, SETTLING, PERIOD)))
        for words in phase.words:
            operator.inject(words)
        if phase.failures:
            tolerable = phase.is_tolerable(self._mechanism)
            self._wait_for_state('degraded' if tolerable else 'stopped')
        self._pass(SETTLING + PERIODS * PERIOD)
        operator.note('')
        self._pass(_STEP)
        error = self._watcher.snapshot().rms_error
        words = '' if error is None else f'; pointing error {1e6 * error:.1f} urad rms of late'
        self._console.print(f'    {operator.state}{words}')

    def _mend(self) -> None:
        """Mend everything with the mirror at rest, as one would.

        A mended drive gets no rate until its failure is cleared: in motion it would be in the
        way of the others.
        """
        operator = self._operator
        self._wait(operator.pause(True), 'an answer', _PATIENCE)
        operator.inject('ok all')
        # The drives' report that they are well may come after the first request.
        deadline = Deadline(_PATIENCE)
        while operator.active_failures != 0:
            if deadline.passed:
                raise FaultToleranceError('the failures could not be cleared')
            self._wait(operator.clear(), 'an answer', _PATIENCE)
            self._pass(2.0 * _STEP)
        self._wait(operator.pause(False), 'an answer', _PATIENCE)
        self._wait_for_state('nominal')
        self._pass(START_UP)

    def _wait_for_state(self, state: str) -> None:
        # What the controller decides is for the summary to judge: go on if it differs.
        self._wait(lambda: self._operator.state == state, state, _PATIENCE, missing=True)

    def _pass(self, duration: float) -> None:
        end = self._operator.now + duration
        self._wait(lambda: self._operator.now >= end, 'joint states', duration + _PATIENCE)

    def _wait(
        self,
        condition: Callable[[], bool],
        what: str,
        patience: float,
        *,
        missing: bool = False,
    ) -> None:
        deadline = Deadline(patience)
        while not condition():
            self._nodes.check()
            if deadline.passed:
                if missing:
                    return
                raise FaultToleranceError(f'waited {patience:g} s for {what} in vain')
            self._executor.spin_once(timeout_sec=_STEP)
            self._refresh()

    def _refresh(self) -> None:
        """Paint the live view anew now and then, where there is a terminal."""
        if self._live is not None and monotonic() - self._shown >= REFRESH_PERIOD:
            self._live.update(LiveView(self._watcher.snapshot()), refresh=True)
            self._shown = monotonic()
