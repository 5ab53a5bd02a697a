# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A whole campaign: its trials, whoever carries them out, and its results."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from fault_tolerance.analysis.campaign import (
    COLUMNS,
    TIMES,
    TrialRecord,
    campaign_rows,
    campaign_summary,
    campaign_table,
)
from fault_tolerance.analysis.terminal import console_for_text, progress_bar
from fault_tolerance.campaign.cases import MECHANISMS, double_failures, single_failures
from fault_tolerance.campaign.stored_results import results_of
from fault_tolerance.campaign.trial import Bench, TrialSettings
from fault_tolerance.closed_loop import ClosedLoop
from fault_tolerance.errors import FaultToleranceError, writing
from fault_tolerance.executors import Watch, executor_of
from fault_tolerance.kinematics.common_causes import group_failures
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.mechanism.catalogue import mechanism_path
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.resources import code_digest

SHOWN_MISTAKES = 20


@dataclass(frozen=True)
class Task:
    """One trial to be done, with all that determines it: so anybody can, anywhere."""

    mechanism: str
    text: str
    """What is in the mechanism's file."""
    failures: tuple[str, ...]
    settings: TrialSettings
    seed: int
    code: str
    """What tells versions of this package apart."""
    group: str = ''


def tasks(
    mechanisms: Sequence[str], settings: TrialSettings, *, doubles: bool = True,
    groups: bool = False,
) -> list[Task]:
    """Return the trials of a campaign, mechanism by mechanism.

    ``mechanisms`` are shipped names or files. The seed of a trial comes from that of ``settings``
    and from what fails in which mechanism. ``doubles`` adds pairs after the single failures, and
    ``groups`` the groups of the mechanism files. FaultToleranceError if a mechanism cannot be
    used, or cannot point, and if none has groups that are asked for.
    """
    found, code = [], code_digest()
    for name in mechanisms:
        try:
            text = mechanism_path(name).read_text(encoding='utf-8')
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, 'strerror', None) or error
            raise FaultToleranceError(f'{name}: cannot be read ({reason})') from None
        mechanism = mechanism_from_text(text, name)
        ClosedLoop(mechanism)  # complains here, not in another process
        cases = single_failures(mechanism)
        cases += double_failures(mechanism) if doubles else ()
        named = [('', case) for case in cases]
        named += group_failures(mechanism).items() if groups else ()
        for group, case in named:
            failures = tuple(map(str, case.failures))
            seed = case_seed(settings.seed, mechanism.name, failures)
            found.append(Task(name, text, failures, settings, seed, code, group))
    if groups and not any(task.group for task in found):
        raise FaultToleranceError(f'no groups in {", ".join(mechanisms)}')
    return found


def case_seed(entropy: int, mechanism: str, failures: Sequence[str]) -> int:
    """Return the seed of one case: ``failures`` of a ``mechanism``, of all those of ``entropy``.

    It depends on nothing else: not on who carries out the trial, nor on which others there are.
    """
    digest = sha256(' '.join((mechanism, *failures)).encode()).digest()
    key = tuple(map(int, np.frombuffer(digest, dtype='<u4')))
    return int(np.random.SeedSequence(entropy, spawn_key=key).generate_state(1)[0])


def records(
    todo: Sequence[Task], folder: Path, executor: Executor | None = None,
    watch: Watch | None = None,
) -> list[TrialRecord]:
    """Return the results of ``todo``, in its order, from files in ``folder`` where they are there.

    The others are found by ``executor``, or here; ``watch`` is told how far it is.
    """
    found = results_of(todo, _result, folder, executor, watch)
    return [TrialRecord(**{**one, 'states': tuple(one['states'])}) for one in found]


def run_campaign(
    folder: Path,
    mechanisms: Sequence[str] = MECHANISMS,
    *,
    doubles: bool = True,
    groups: bool = False,
    workers: str = '1',
    settings: TrialSettings | None = None,
) -> int:
    """Run a campaign, write its results to ``folder``; return 0 if all is as theory says, else 1.

    ``mechanisms``, ``doubles``, ``groups`` and ``settings`` are those of `tasks`; ``workers`` is
    that of `executor_of`. FaultToleranceError if a mechanism cannot be used, or the results cannot
    be written.
    """
    settings = settings or TrialSettings(clock=time.thread_time)
    console = console_for_text(markup=False, emoji=False, highlight=False)
    todo = tasks(tuple(dict.fromkeys(mechanisms)), settings, doubles=doubles, groups=groups)
    with writing(folder):
        with progress_bar('trials') as watch, executor_of(workers) as executor:
            found = records(todo, folder / 'parts', executor, watch)
        summary = campaign_summary(found, settings.seed)
        for name, columns in (('results.csv', COLUMNS), ('timings.csv', TIMES)):
            with (folder / name).open('w', newline='', encoding='utf-8') as file:
                csv.writer(file, lineterminator='\n').writerows(campaign_rows(found, columns))
        text = json.dumps(summary, indent=2, allow_nan=False) + '\n'
        (folder / 'summary.json').write_text(text, encoding='utf-8')
    console.print(campaign_table(summary))
    mistakes = summary['mistakes']
    for one in mistakes[:SHOWN_MISTAKES]:
        console.print(f'{one["mechanism"]} {one["failures"]}: {"; ".join(one["mistakes"])}')
    if len(mistakes) > SHOWN_MISTAKES:
        console.print(f'... and {len(mistakes) - SHOWN_MISTAKES} more')
    console.print(f'{len(found)} trials, {len(mistakes)} not as they should be; see {folder}/')
    return 1 if mistakes else 0


def _result(task: Task) -> dict[str, Any]:
    bench = _bench(task.mechanism, task.text, task.settings)
    failures = failure_set(bench.mechanism, task.failures)
    return asdict(bench.trial(failures, task.seed, task.group))


@cache
def _bench(name: str, text: str, settings: TrialSettings) -> Bench:
    """Return the healthy run, made once in each process."""
    return Bench(mechanism_from_text(text, name), settings)
