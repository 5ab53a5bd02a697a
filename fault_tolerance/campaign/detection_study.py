# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How often detection is wrong, and how soon it is right: many runs, on all cores.

Each run leaves a file. What is there already is not run again, so a study may be interrupted, and
may be made longer later. Random numbers depend on the run and not on who carries it out.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

from fault_tolerance.analysis.study_results import study_rows, study_summary, study_table
from fault_tolerance.analysis.terminal import console_for_text, progress_bar
from fault_tolerance.campaign.detection_trials import FailureRun, HealthyRun, Run, result_of
from fault_tolerance.campaign.stored_results import results_of
from fault_tolerance.errors import writing
from fault_tolerance.executors import executor_of
from fault_tolerance.kernel.compilation import announced_kernel

SHARES = {
    'mirror_4_strut': 0.6, 'mirror_3_strut': 0.1, 'mirror_overactuated': 0.2,
    'gough_stewart_8': 0.1,
}
"""Of the healthy cycles, by mechanism."""

PIECE = 200_000
"""Healthy cycles of one run: one task, and one set of flaws."""

AMPLITUDES = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6)
"""Of the circle, radians."""

PROBES = (5e-9, 1e-8, 2e-8, 5e-8, 1e-7, 5e-7)
"""Amplitudes of the probe, metres."""

TRIALS = 20
"""Of one run of failures."""


def study_runs(cycles: int, trials: int, entropy: int) -> list[Run]:
    """Return the runs of a study.

    Parameters
    ----------
    cycles : int
        Healthy ones, of all mechanisms together.
    trials : int
        Of each failure at each amplitude.
    entropy : int
        The seed of it all.

    Returns
    -------
    list of HealthyRun and FailureRun
    """
    runs: list[Run] = []
    for place, (name, share) in enumerate(SHARES.items()):
        count = -(-round(share * cycles) // PIECE)
        runs += [HealthyRun(name, PIECE, (0, place, number), entropy) for number in range(count)]
    cases = [
        *((fault, size, False) for fault in ('stuck', 'frozen', 'weak') for size in AMPLITUDES),
        *((fault, size, True) for fault in ('stuck', 'free', 'lost') for size in PROBES),
    ]
    for place, name in enumerate(('mirror_4_strut', 'gough_stewart_8')):
        for case, (fault, size, probing) in enumerate(cases):
            # Legs as long as a man move farther for the same angle: the same ways then.
            amplitude = size * (1.0 if probing or name == 'mirror_4_strut' else 0.05)
            runs += [
                FailureRun(name, fault, amplitude, probing, TRIALS, (1, place, case, number),
                           entropy)
                for number in range(-(-trials // TRIALS))
            ]
    return runs


def run_study(
    folder: Path, cycles: int, trials: int, *, workers: str = '1', seed: int = 1
) -> int:
    """Run a study, or what is missing of it, and write what came of it to ``folder``.

    Parameters
    ----------
    folder : Path
        Gets ``parts``, ``results.csv``, ``summary.json``, and ``study.png`` with matplotlib.
    cycles, trials : int
        See `study_runs`.
    workers : str
        See `executor_of`.
    seed : int

    Returns
    -------
    int
        1 if there was a false alarm, else 0.

    Raises
    ------
    FaultToleranceError
        If the results cannot be written, or the workers fail.
    """
    announced_kernel()
    runs = study_runs(cycles, trials, seed)
    console = console_for_text(markup=False, emoji=False, highlight=False)
    with writing(folder):
        with progress_bar('runs') as watch, executor_of(workers) as executor:
            found = results_of(runs, result_of, folder / 'parts', executor, watch)
        summary = study_summary(found, seed)
        with (folder / 'results.csv').open('w', newline='', encoding='utf-8') as file:
            csv.writer(file, lineterminator='\n').writerows(study_rows(summary))
        text = json.dumps(summary, indent=2, allow_nan=False) + '\n'
        (folder / 'summary.json').write_text(text, encoding='utf-8')
        _draw(summary, folder)
    console.print(study_table(summary))
    return 1 if summary['healthy']['alarms'] else 0


def _draw(summary: dict[str, Any], folder: Path) -> None:
    try:
        from fault_tolerance.analysis.study_figure import draw_study
    except ImportError:
        return
    draw_study(summary, folder / 'study.png')
