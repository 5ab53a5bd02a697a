# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A whole campaign: its trials in parallel, and its results."""

from __future__ import annotations

import csv
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path

from rich import progress

from fault_tolerance.analysis.campaign import (
    TrialRecord,
    campaign_rows,
    campaign_summary,
    campaign_table,
)
from fault_tolerance.analysis.terminal import console_for_text
from fault_tolerance.campaign.cases import MECHANISMS, double_failures, single_failures
from fault_tolerance.campaign.trial import Bench, TrialSettings
from fault_tolerance.closed_loop import ClosedLoop
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.kinematics.common_causes import group_failures
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.catalogue import mechanism_named

SHOWN_MISTAKES = 20


@dataclass(frozen=True)
class Task:
    """One trial to be done."""

    mechanism: str
    failures: FailureSet
    settings: TrialSettings
    seed: int
    group: str = ''


def tasks(
    mechanisms: Sequence[str], settings: TrialSettings, *, doubles: bool = True,
    groups: bool = False,
) -> list[Task]:
    """Return the trials of a campaign, mechanism by mechanism.

    ``mechanisms`` are shipped names or files. The seed of a trial is that of ``settings`` plus its
    number among those of its mechanism. ``doubles`` adds pairs after the single failures, and
    ``groups`` the groups of the mechanism files. FaultToleranceError if a mechanism cannot be
    used, or cannot point, and if none has groups that are asked for.
    """
    found = []
    for name in mechanisms:
        mechanism = mechanism_named(name)
        ClosedLoop(mechanism)  # complains here, not in another process
        cases = single_failures(mechanism)
        cases += double_failures(mechanism) if doubles else ()
        named = [('', case) for case in cases]
        named += group_failures(mechanism).items() if groups else ()
        found += [
            Task(name, case, settings, seed, group)
            for seed, (group, case) in enumerate(named, settings.seed)
        ]
    if groups and not any(task.group for task in found):
        raise FaultToleranceError(f'no groups in {", ".join(mechanisms)}')
    return found


def records(todo: Sequence[Task], jobs: int, done: Callable[[], None]) -> list[TrialRecord]:
    """Return the results of ``todo``, in its order, from ``jobs`` processes at a time.

    ``done`` is called after each.
    """
    found = []
    with _mapping(jobs) as each:
        for record in each(todo):
            found.append(record)
            done()
    return found


def run_campaign(
    folder: Path,
    mechanisms: Sequence[str] = MECHANISMS,
    *,
    doubles: bool = True,
    groups: bool = False,
    jobs: int | None = None,
    settings: TrialSettings | None = None,
) -> int:
    """Run a campaign, write its results to ``folder``; return 0 if all is as theory says, else 1.

    ``mechanisms``, ``doubles``, ``groups`` and ``settings`` are those of `tasks`; ``jobs`` trials
    run at a time, on all cores by default. FaultToleranceError if a mechanism cannot be used,
    or the results cannot be written.
    """
    settings = settings or TrialSettings(clock=time.thread_time)
    console = console_for_text(markup=False, emoji=False, highlight=False)
    todo = tasks(tuple(dict.fromkeys(mechanisms)), settings, doubles=doubles, groups=groups)
    columns = (
        progress.TextColumn('{task.description}'), progress.BarColumn(),
        progress.MofNCompleteColumn(), progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
    )
    with progress.Progress(*columns, console=console) as bar:
        shown = bar.add_task('trials', total=len(todo))
        found = records(todo, jobs or _cores(), lambda: bar.advance(shown))
    summary = campaign_summary(found, settings.seed)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / 'results.csv').open('w', newline='', encoding='utf-8') as file:
            csv.writer(file, lineterminator='\n').writerows(campaign_rows(found))
        text = json.dumps(summary, indent=2, allow_nan=False) + '\n'
        (folder / 'summary.json').write_text(text, encoding='utf-8')
    except OSError as error:
        raise FaultToleranceError(f'{folder}: cannot be written ({error})') from None
    console.print(campaign_table(summary))
    mistakes = summary['mistakes']
    for one in mistakes[:SHOWN_MISTAKES]:
        console.print(f'{one["mechanism"]} {one["failures"]}: {"; ".join(one["mistakes"])}')
    if len(mistakes) > SHOWN_MISTAKES:
        console.print(f'... and {len(mistakes) - SHOWN_MISTAKES} more')
    console.print(f'{len(found)} trials, {len(mistakes)} not as they should be; see {folder}/')
    return 1 if mistakes else 0


def _record(task: Task) -> TrialRecord:
    return _bench(task.mechanism, task.settings).trial(task.failures, task.seed, task.group)


@cache
def _bench(mechanism: str, settings: TrialSettings) -> Bench:
    """Return the healthy run, made once in each process."""
    return Bench(mechanism_named(mechanism), settings)


@contextmanager
def _mapping(jobs: int) -> Iterator[Callable[[Sequence[Task]], Iterator[TrialRecord]]]:
    """Give a map of tasks to records, in this process or in ``jobs`` others."""
    if jobs == 1:
        yield lambda todo: map(_record, todo)
        return
    # Matrices are small: one BLAS thread per process.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    with ProcessPoolExecutor(jobs, mp_context=get_context('spawn')) as pool:
        try:
            yield lambda todo: pool.map(_record, todo)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else 1
