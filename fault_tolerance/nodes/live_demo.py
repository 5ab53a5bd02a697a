# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance demo``: all nodes, live, with recovery and without."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from fault_tolerance.analysis.demo_summary import (
    PHASES,
    Phase,
    summary,
    summary_table,
    unrecovered_phases,
)
from fault_tolerance.analysis.recorded_data import Sample, recordings_of
from fault_tolerance.analysis.runs import UNRECOVERED, run_of
from fault_tolerance.analysis.terminal import console_for_text
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.demo_pass import DemoPass, require_no_other_controller
from fault_tolerance.nodes.operator_client import OperatorClient
from fault_tolerance.nodes.processes import NodeProcesses
from fault_tolerance.nodes.recorder import Recorder, decoded
from fault_tolerance.nodes.spinning import spun
from fault_tolerance.simulation.engines import ENGINES

MECHANISM = 'mirror_4_strut'
_DISCOVERY = 2.0  # seconds after which a running controller is known


def demonstrate(folder: Path, phases: Sequence[Phase] = PHASES, engine: str = ENGINES[0]) -> int:
    """Run the demonstration with and without recovery, and write its results.

    ``folder`` is created if missing and gets summary, report and recording; the failures of the
    ``phases`` are injected in this order; ``engine`` is that of the simulator. Returns the exit
    code: 1 if a tolerable failure was not recovered. Raises `FaultToleranceError` if a node ends
    or does not answer.
    """
    console = console_for_text()
    samples: list[Sample] = []
    for title, recovery in (('With recovery', True), ('The same without recovery', False)):
        console.rule(f'{title}: {MECHANISM}, circle of 1 mrad at 1 Hz')
        samples += _one_pass(recovery, engine, phases, console)
    run = run_of(recordings_of(decoded(samples)))
    result = summary(run)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'summary.json').write_text(json.dumps(result, indent=2, allow_nan=False) + '\n')
    console.print(summary_table(result))
    try:
        from fault_tolerance.analysis.report_page import write_report

        write_report(run, folder)
    except ImportError as error:
        console.print(f'No report: {error.name} is not installed.')
    try:
        from fault_tolerance.analysis.bags import write_bag

        write_bag(folder / 'run.mcap', samples)
    except ImportError as error:
        console.print(f'No recording: {error.name} is not installed.')
    console.print(f'Written to {folder}/')
    wrong = unrecovered_phases(result)
    for line in wrong:
        console.print(f'[bold red]{line}[/bold red]')
    return 1 if wrong else 0


def _one_pass(
    recovery: bool, engine: str, phases: Sequence[Phase], console: Console
) -> list[Sample]:
    """Run ``phases``; return what was recorded, without recovery in a namespace of its own."""
    namespace = '' if recovery else UNRECOVERED
    parameters = {
        'fsm_simulator': {'mechanism': MECHANISM, 'engine': engine},
        'controller': {
            'mechanism': MECHANISM, 'recovery': recovery, 'detect': 'act' if recovery else 'off',
            'convert': 'act' if recovery else 'advise',
        },
        'pointing_reference': {'mechanism': MECHANISM},
    }
    with spun(lambda: OperatorClient(namespace)) as (operator, executor):
        # Before anything of ours drives what may be a machine.
        require_no_other_controller(operator, executor, discovery=_DISCOVERY)
        recorder = Recorder(operator)
        with NodeProcesses(parameters, namespace) as nodes:
            mechanism = mechanism_named(MECHANISM)
            one = DemoPass(mechanism, operator, executor, nodes, console, acts=recovery)
            one.go_through(phases)
            return recorder.samples
