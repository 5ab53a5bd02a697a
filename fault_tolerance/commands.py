# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the command line does with one mechanism or several: measure, compare, examine, draw."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any, Literal

from rich.console import Console, RenderableType

from fault_tolerance.analysis.check_tables import check_table
from fault_tolerance.analysis.checks import check_report
from fault_tolerance.analysis.demonstration import summary, summary_table
from fault_tolerance.analysis.recording import recordings_of
from fault_tolerance.analysis.reports import measures_report
from fault_tolerance.analysis.runs import run_of
from fault_tolerance.analysis.tables import (
    measures_records,
    measures_table,
    paper_records,
    paper_rows,
    paper_table,
)
from fault_tolerance.errors import ClosureError, FaultToleranceError
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import PostFailure, reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import Configuration, solved_configuration

Form = Literal['text', 'json', 'csv']


def measures(
    name: str,
    at: Mapping[str, float],
    failed: Iterable[tuple[str, str]],
    form: Form,
    *,
    pairs: bool,
) -> None:
    """Print what the mechanism ``name`` can lose, and what it costs."""
    _, state = _examined(name, at, failed)
    report = measures_report(state, pairs=pairs)
    if form == 'json':
        _print_json(report)
    elif form == 'csv':
        _print_csv(measures_records(report))
    else:
        _print_text(measures_table(report))


def table(names: Sequence[str], form: Form) -> None:
    """Print the paper's Table I for the mechanisms ``names``."""
    reports = [measures_report(_examined(name, {}, [])[1]) for name in names]
    if form == 'json':
        _print_json(paper_rows(reports))
    elif form == 'csv':
        _print_csv(paper_records(reports))
    else:
        _print_text(paper_table(reports))


def check(
    name: str,
    at: Mapping[str, float],
    failed: Iterable[tuple[str, str]],
    form: Form,
    picture: Path | None,
) -> None:
    """Print the examination of the mechanism ``name``, and draw it into ``picture``."""
    configuration, state = _examined(name, at, failed)
    report = check_report(configuration, state)
    if picture is not None:
        draw(configuration, state, picture)
    if form == 'json':
        _print_json(report)
    elif form == 'csv':
        _print_csv([('key', 'value'), *flattened(report)])
    else:
        _print_text(check_table(report))


def flattened(content: Any, path: str = '') -> list[tuple[str, Any]]:
    """Return the leaves of JSON data with their dotted paths, places in lists counted from 0."""
    if isinstance(content, Mapping):
        items: Iterable[tuple[Any, Any]] = content.items()
    elif isinstance(content, list):
        items = enumerate(content)
    else:
        return [(path, '' if content is None else content)]
    return [
        leaf
        for key, value in items
        for leaf in flattened(value, f'{path}.{key}' if path else str(key))
    ]


def draw(configuration: Configuration, state: PostFailure, picture: Path) -> None:
    """Write a drawing of the mechanism in the format of the ending of ``picture``."""
    try:
        # Only this needs matplotlib, which a robot may well not have.
        from fault_tolerance.analysis.drawing import mechanism_figure, save_figure
    except ImportError as error:
        reason = f'drawing needs matplotlib, which is not installed ({error})'
        raise FaultToleranceError(reason) from None
    figure = mechanism_figure(configuration, state.failures)
    try:
        save_figure(figure, picture)
    except (OSError, ValueError) as error:
        raise FaultToleranceError(f'{picture}: cannot be written ({error})') from None


def report(bag: Path, folder: Path | None, namespace: str | None) -> None:
    """Print what the recording ``bag`` shows, and write the report of it."""
    try:
        # Only this needs rosbags and matplotlib, which a robot may well not have.
        from fault_tolerance.analysis.bags import read_messages
        from fault_tolerance.analysis.report_page import write_report
    except ImportError as error:
        reason = f'reports need rosbags and matplotlib: {error.name} is not installed'
        raise FaultToleranceError(reason) from None
    run = run_of(recordings_of(read_messages(bag)), namespace)
    _print_text(summary_table(summary(run)))
    if folder is None:
        folder = bag if bag.is_dir() else bag.parent
    for path in write_report(run, folder):
        print(path)


def _examined(
    name: str, at: Mapping[str, float], failed: Iterable[tuple[str, str]]
) -> tuple[Configuration, PostFailure]:
    mechanism = mechanism_named(name)
    failures = failure_set(mechanism, failed)
    try:
        configuration = solved_configuration(mechanism, at)
    except ClosureError:
        # A lost strut may have hung on to a place the others have left since.
        if not failures.lost:
            raise
        configuration = solved_configuration(mechanism, at, lost=failures.lost)
    return configuration, reconfigured(strut_rows(configuration), failures)


def _print_text(content: RenderableType) -> None:
    # Names are written as they are, even if they look like rich's markup.
    console = Console(markup=False, emoji=False, highlight=False)
    # rich ends the whole program itself when the reader has gone.
    with console.capture() as text:
        console.print(content)
    print(text.get(), end='')


def _print_json(content: object) -> None:
    print(json.dumps(content, indent=2, allow_nan=False))


def _print_csv(records: Iterable[Sequence[Any]]) -> None:
    text = StringIO()
    csv.writer(text, lineterminator='\n').writerows(records)
    print(text.getvalue(), end='')
