# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance demo``: the whole thing, live, with recovery and without."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import rclpy
from rclpy.signals import SignalHandlerOptions
from rich.console import Console

from fault_tolerance.analysis.demonstration import (
    PHASES,
    Phase,
    summary,
    summary_table,
    unrecovered_phases,
)
from fault_tolerance.analysis.recording import Sample, recordings_of
from fault_tolerance.analysis.runs import UNRECOVERED, Run, run_of
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.demo_operator import Operator
from fault_tolerance.nodes.demo_pass import DemoPass
from fault_tolerance.nodes.processes import NodeProcesses
from fault_tolerance.nodes.recording import Recorder, decoded
from fault_tolerance.nodes.spinning import make_executor
from fault_tolerance.simulation.engines import ENGINES

MECHANISM = 'mirror_4_strut'


def demonstrate(folder: Path, phases: Sequence[Phase] = PHASES, engine: str = ENGINES[0]) -> int:
    """Run the demonstration, write its results to ``folder`` and return the exit code."""
    console = Console()
    samples: list[Sample] = []
    for title, recovery in (('With recovery', True), ('The same without recovery', False)):
        console.rule(f'{title}: {MECHANISM}, circle of 1 mrad at 1 Hz')
        samples += _one_pass(recovery, engine, phases, console)
    run = run_of(recordings_of(decoded(samples)))
    result = summary(run)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'summary.json').write_text(json.dumps(result, indent=2, allow_nan=False) + '\n')
    console.print(summary_table(result))
    _write_report(run, folder, console)
    _write_recording(samples, folder / 'run.mcap', console)
    console.print(f'Written to {folder}/')
    wrong = unrecovered_phases(result)
    for line in wrong:
        console.print(f'[bold red]{line}[/bold red]')
    return 1 if wrong else 0


def _one_pass(
    recovery: bool, engine: str, phases: Sequence[Phase], console: Console
) -> list[Sample]:
    """Go through ``phases``; return what was published, the second pass under its own name."""
    namespace = '' if recovery else UNRECOVERED
    parameters = {
        'fsm_simulator': {'mechanism': MECHANISM, 'engine': engine},
        'controller': {'mechanism': MECHANISM, 'recovery': recovery},
        'pointing_reference': {'mechanism': MECHANISM},
    }
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    operator = Operator(namespace)
    recorder = Recorder(operator)
    executor = make_executor()
    executor.add_node(operator)
    try:
        with NodeProcesses(parameters, namespace) as nodes:
            mechanism = mechanism_named(MECHANISM)
            DemoPass(mechanism, operator, executor, nodes, console).go_through(phases)
            return recorder.samples
    finally:
        executor.remove_node(operator)
        operator.destroy_node()
        rclpy.try_shutdown()


def _write_report(run: Run, folder: Path, console: Console) -> None:
    try:
        from fault_tolerance.analysis.report_page import write_report
    except ImportError as error:
        console.print(f'No report: {error.name} is not installed.')
        return
    write_report(run, folder)


def _write_recording(samples: Iterable[Sample], file: Path, console: Console) -> None:
    try:
        from fault_tolerance.analysis.bags import write_bag
    except ImportError as error:
        console.print(f'No recording: {error.name} is not installed.')
        return
    write_bag(file, samples)
