# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Results in files, one for each piece of work: what is there already is not done again."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

from fault_tolerance.executors import Watch, finished

_Run = TypeVar('_Run')


def results_of(
    runs: Sequence[_Run],
    function: Callable[[_Run], dict[str, Any]],
    folder: Path,
    executor: Executor | None = None,
    watch: Watch | None = None,
) -> list[dict[str, Any]]:
    """Return what ``function`` makes of each run, from files where they are there.

    Parameters
    ----------
    runs : sequence
        Their `repr` says all that determines them.
    function : callable
        Returns plain values for JSON.
    folder : Path
        Of the files; is made if it is missing.
    executor : concurrent.futures.Executor, optional
        What does the work; it needs no access to the folder.
    watch : Watch, optional

    Returns
    -------
    list of dict
        In the order of the runs.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f'{sha256(repr(run).encode()).hexdigest()[:32]}.json' for run in runs]
    found = {place: stored for place, file in enumerate(files) if (stored := _stored(file))}
    missing = [place for place in range(len(runs)) if place not in found]
    for number, result in finished(function, [runs[place] for place in missing], executor):
        found[missing[number]] = result
        # Another campaign may do the same runs.
        beside = files[missing[number]].with_suffix(f'.{os.getpid()}')
        beside.write_text(json.dumps(result), encoding='utf-8')
        # All of it or nothing, whenever this is interrupted.
        beside.replace(files[missing[number]])
        if watch is not None:
            watch(len(found), len(runs))
    return [found[place] for place in range(len(runs))]


def _stored(file: Path) -> dict[str, Any] | None:
    try:
        found: dict[str, Any] = json.loads(file.read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return None
    return found
