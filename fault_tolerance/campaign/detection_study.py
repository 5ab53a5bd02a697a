# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How often detection is wrong, and how soon it is right: many runs, on all cores.

Each run leaves a file. What is there already is not run again, so a study may be interrupted, and
may be made longer later. Random numbers depend on the run and not on who carries it out.
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from rich import progress

from fault_tolerance.analysis.study_results import study_rows, study_summary, study_table
from fault_tolerance.analysis.terminal import console_for_text
from fault_tolerance.campaign.detection_trials import FailureRun, HealthyRun, Run, result_of
from fault_tolerance.errors import FaultToleranceError
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


def results(runs: Sequence[Run], folder: Path, jobs: int) -> Iterator[dict[str, Any]]:
    """Yield the results of ``runs``, from files in ``folder`` where they are there.

    Parameters
    ----------
    runs : sequence
    folder : Path
        Is made if it is missing.
    jobs : int
        Processes at a time.

    Yields
    ------
    dict
    """
    folder.mkdir(parents=True, exist_ok=True)
    missing = []
    for run in runs:
        found = _stored(run, folder)
        if found is None:
            missing.append(run)
        else:
            yield found
    if jobs == 1 or len(missing) < 2:
        for run in missing:
            yield _carried_out(run, folder)
        return
    # Matrices are small: one BLAS thread per process.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    with ProcessPoolExecutor(jobs, mp_context=get_context('spawn')) as pool:
        try:
            for done in as_completed([pool.submit(_carried_out, run, folder) for run in missing]):
                yield done.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def run_study(
    folder: Path, cycles: int, trials: int, *, jobs: int | None = None, seed: int = 1
) -> int:
    """Run a study, or what is missing of it, and write what came of it to ``folder``.

    Parameters
    ----------
    folder : Path
        Gets ``parts``, ``results.csv``, ``summary.json``, and ``study.png`` with matplotlib.
    cycles, trials : int
        See `study_runs`.
    jobs : int, optional
        Processes at a time, on all cores by default.
    seed : int

    Returns
    -------
    int
        1 if there was a false alarm, else 0.

    Raises
    ------
    FaultToleranceError
        If the results cannot be written.
    """
    announced_kernel()
    runs = study_runs(cycles, trials, seed)
    console = console_for_text(markup=False, emoji=False, highlight=False)
    columns = (
        progress.TextColumn('{task.description}'), progress.BarColumn(),
        progress.MofNCompleteColumn(), progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
    )
    found = []
    try:
        with progress.Progress(*columns, console=console) as bar:
            shown = bar.add_task('runs', total=len(runs))
            for one in results(runs, folder / 'parts', jobs or _cores()):
                found.append(one)
                bar.advance(shown)
        summary = study_summary(found, seed)
        with (folder / 'results.csv').open('w', newline='', encoding='utf-8') as file:
            csv.writer(file, lineterminator='\n').writerows(study_rows(summary))
        text = json.dumps(summary, indent=2, allow_nan=False) + '\n'
        (folder / 'summary.json').write_text(text, encoding='utf-8')
        _draw(summary, folder)
    except OSError as error:
        raise FaultToleranceError(f'{folder}: cannot be written ({error})') from None
    console.print(study_table(summary))
    return 1 if summary['healthy']['alarms'] else 0


def _draw(summary: dict[str, Any], folder: Path) -> None:
    try:
        from fault_tolerance.analysis.study_figure import draw_study
    except ImportError:
        return
    draw_study(summary, folder / 'study.png')


def _carried_out(run: Run, folder: Path) -> dict[str, Any]:
    """Carry out a run and store its result."""
    found = result_of(run)
    place = folder / f'{run.label}.json'
    beside = place.with_suffix('.new')
    beside.write_text(json.dumps({'run': _plain(run), 'result': found}), encoding='utf-8')
    # All of it or nothing, whenever this is interrupted.
    beside.replace(place)
    return found


def _stored(run: Run, folder: Path) -> dict[str, Any] | None:
    """Return the result of the very same run, if it is there."""
    try:
        text = (folder / f'{run.label}.json').read_text(encoding='utf-8')
        kept: dict[str, Any] = json.loads(text)
    except (OSError, ValueError):
        return None
    found: dict[str, Any] | None = kept.get('result')
    return found if kept.get('run') == _plain(run) else None


def _plain(run: Run) -> dict[str, Any]:
    """Return what determines a run."""
    return {**asdict(run), 'key': list(run.key)}


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else 1
