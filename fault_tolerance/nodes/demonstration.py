# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance demo``: the whole thing, live, with recovery and without."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import Executor
from rclpy.signals import SignalHandlerOptions
from rich.console import Console

from fault_tolerance.analysis.demonstration import (
    PHASES,
    Phase,
    PhaseRecord,
    summary,
    summary_table,
    unrecovered_phases,
)
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.demo_operator import Deadline, Operator
from fault_tolerance.nodes.processes import NodeProcesses
from fault_tolerance.nodes.spinning import make_executor
from fault_tolerance.simulation.engines import ENGINES

MECHANISM = 'mirror_4_strut'
PERIOD = 1.0
SETTLING = 1.0
PERIODS = 3
"""The circle takes 1 s; after a failure the error counts from 1 s on, over three turns."""

START_UP = 1.2
"""Seconds for the mirror to get from rest back to the circle."""

_LISTENING = 0.5
_SHOWN_EVERY = 0.1
_START_PATIENCE = 30.0
_PATIENCE = 8.0
_STEP = 0.05


class Demonstration:
    """One pass through all phases, with the nodes running.

    Parameters
    ----------
    operator : Operator
    executor : Executor
        Spins the operator.
    nodes : NodeProcesses
    console : Console
        Where it tells what happens.
    """

    def __init__(
        self, operator: Operator, executor: Executor, nodes: NodeProcesses, console: Console
    ) -> None:
        self._operator = operator
        self._executor = executor
        self._nodes = nodes
        self._console = console
        self._live = console.status('starting the nodes')
        self._shown = 0.0

    def records(self, phases: Sequence[Phase]) -> list[PhaseRecord]:
        """Go through ``phases``, mending everything in between."""
        with self._live:
            self._wait(lambda: self._operator.ready, 'the nodes to appear', _START_PATIENCE)
            self._wait_for_state('nominal')
            self._pass(START_UP)
            result = []
            for phase in phases:
                result.append(self._record(phase))
                if phase.failures and phase is not phases[-1]:
                    self._mend()
            return result

    def _record(self, phase: Phase) -> PhaseRecord:
        operator = self._operator
        self._console.print(f'[bold]{phase.name}[/bold]')
        self._pass(_LISTENING)
        begin = operator.now
        _, before = operator.efforts.since(begin - _LISTENING)
        for words in phase.words:
            operator.inject(words)
        if phase.failures:
            tolerable = phase.is_tolerable(mechanism_named(MECHANISM))
            self._wait_for_state('degraded' if tolerable else 'stopped')
        self._pass(SETTLING + PERIODS * PERIOD)
        end = operator.now
        times, errors = operator.errors.since(begin, end)
        _, references = operator.references.since(begin, end)
        _, efforts = operator.efforts.since(begin, end)
        count = min(len(errors), len(references))
        record = PhaseRecord(
            phase,
            operator.state,
            times[:count] - begin,
            errors[:count],
            references[:count],
            efforts,
            before.mean(axis=0),
            dict(operator.metrics),
            SETTLING,
        )
        self._console.print(
            f'    {record.state}; pointing error {1e6 * record.error_rms(PERIOD):.1f} urad rms, '
            f'largest force {record.peak_force:.2f} N'
        )
        return record

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
        while operator.metrics.get('active_failures') != 0.0:
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
            self._show()

    def _show(self) -> None:
        """Say what is going on in the line below, where there is a terminal."""
        operator = self._operator
        if not self._console.is_terminal or operator.now - self._shown < _SHOWN_EVERY:
            return
        self._shown = operator.now
        error, forces = operator.errors.last, operator.efforts.last
        self._live.update(
            f'{operator.state}  error {1e6 * float(np.hypot(*error)):7.1f} urad  forces, N '
            + ' '.join(f'{force:7.2f}' for force in forces)
            if error and forces
            else 'waiting for the mirror'
        )


def demonstrate(folder: Path, phases: Sequence[Phase] = PHASES, engine: str = ENGINES[0]) -> int:
    """Run the demonstration, write its results to ``folder`` and return the exit code."""
    console = Console()
    mechanism = mechanism_named(MECHANISM)
    passes = {}
    for name, recovery in (('recovered', True), ('unrecovered', False)):
        title = 'With recovery' if recovery else 'The same without recovery'
        console.rule(f'{title}: {MECHANISM}, circle of 1 mrad at 1 Hz')
        passes[name] = _one_pass(recovery, engine, phases, console)
    result = summary(mechanism, passes, PERIOD)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'summary.json').write_text(json.dumps(result, indent=2, allow_nan=False) + '\n')
    console.print(summary_table(result))
    _draw(passes, folder / 'report.png', console)
    console.print(f'Written to {folder}/')
    wrong = unrecovered_phases(result)
    for line in wrong:
        console.print(f'[bold red]{line}[/bold red]')
    return 1 if wrong else 0


def _one_pass(
    recovery: bool, engine: str, phases: Sequence[Phase], console: Console
) -> list[PhaseRecord]:
    parameters = {
        'fsm_simulator': {'mechanism': MECHANISM, 'engine': engine},
        'controller': {'mechanism': MECHANISM, 'recovery': recovery},
        'pointing_reference': {'mechanism': MECHANISM},
    }
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    operator = Operator()
    executor = make_executor()
    executor.add_node(operator)
    try:
        with NodeProcesses(parameters) as nodes:
            return Demonstration(operator, executor, nodes, console).records(phases)
    finally:
        executor.remove_node(operator)
        operator.destroy_node()
        rclpy.try_shutdown()


def _draw(passes: dict[str, list[PhaseRecord]], path: Path, console: Console) -> None:
    try:
        from fault_tolerance.analysis.figures import demonstration_figure, save_figure
    except ImportError:
        console.print('No picture: matplotlib is not installed.')
        return
    save_figure(demonstration_figure(passes, PERIOD), path)
