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

from rich.console import RenderableType

from fault_tolerance.analysis.check_tables import check_table
from fault_tolerance.analysis.checks import check_report
from fault_tolerance.analysis.class_tables import class_table
from fault_tolerance.analysis.demo_summary import summary, summary_table
from fault_tolerance.analysis.finding_tables import (
    FINDING_KEYS,
    finding_records,
    finding_table,
)
from fault_tolerance.analysis.gallery_tables import gallery_records, gallery_rows, gallery_table
from fault_tolerance.analysis.hints import text_hints
from fault_tolerance.analysis.recorded_data import recordings_of
from fault_tolerance.analysis.reports import measures_report
from fault_tolerance.analysis.rule_tables import (
    RULE_EVENT_KEYS,
    rule_event_records,
    rule_table,
)
from fault_tolerance.analysis.runs import run_of
from fault_tolerance.analysis.tables import (
    measures_records,
    measures_table,
    paper_records,
    paper_rows,
    paper_table,
)
from fault_tolerance.analysis.terminal import console_for_text
from fault_tolerance.detection.isolability import Isolability, isolability_report
from fault_tolerance.detection.isolability import isolability as isolability_of
from fault_tolerance.detection.responses import Sensors
from fault_tolerance.drive_rules.drive_watch import DriveWatch
from fault_tolerance.drive_rules.rule_report import replayed_report, rules_report, topics_of
from fault_tolerance.drive_rules.rules import RuleSet
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.kinematics.failures import FailureLike
from fault_tolerance.kinematics.reconfiguration import PostFailure, after
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.replay.detection_options import DetectOptions

Form = Literal['text', 'json', 'csv']


def measures(post: PostFailure, form: Form, *, pairs: bool) -> None:
    """Print what the mechanism of ``post`` can lose and what it costs, in ``form``.

    ``pairs`` adds every pair of further failures.
    """
    report = measures_report(post, pairs=pairs)
    show(form, report, measures_records(report), measures_table(report))


def table(names: Sequence[str], form: Form) -> None:
    """Print the paper's Table I for mechanisms or files ``names``, in ``form``."""
    reports = [measures_report(after(mechanism_named(name))) for name in names]
    show(form, paper_rows(reports), paper_records(reports), paper_table(reports))


def gallery(names: Sequence[str], form: Form) -> None:
    """Print the mechanisms or files ``names`` side by side, in ``form``."""
    rows = gallery_rows([after(mechanism_named(name)) for name in names])
    show(form, rows, gallery_records(rows), gallery_table(rows))


def check(post: PostFailure, source: Path, form: Form, picture: Path | None) -> None:
    """Print the examination of the mechanism of ``post`` in ``form``; draw it into ``picture``.

    It comes from the file ``source``, whose text may look odd as well.
    """
    report = check_report(post.configuration, post)
    report['hints'] += text_hints(source.read_text(encoding='utf-8'))
    if picture is not None:
        draw(post, picture)
    show(form, report, [('key', 'value'), *flattened(report)], check_table(report))
    for hint in report['hints'] if form == 'text' else ():
        print(f'hint: {hint}')  # a line each, however long


def isolability(
    mechanism: Mechanism, failed: Sequence[FailureLike], sensors: Sensors, form: Form,
    *, probe: bool,
) -> None:
    """Print which further failures of ``mechanism`` can be told apart, after those ``failed``.

    With ``sensors`` beside the encoders and with a ``probe`` or without, in ``form``, at home.
    """
    post = after(mechanism, failed)

    def found(sensors: Sensors, probe: bool) -> Isolability:
        return isolability_of(post.rows, post.failures, sensors=sensors, probe=probe)

    result = found(sensors, probe)
    options = {
        'a probe': (sensors, True),
        'efforts': (sensors._replace(efforts=True), probe),
        'a pose sensor': (sensors._replace(pose=True), probe),
    }
    report = isolability_report(mechanism, result)
    helps = [
        words for words, option in options.items()
        if len(found(*option).classes) > len(result.classes)
    ]
    records = [('class', 'hypothesis'), *(
        (number, one) for number, group in enumerate(report['classes']) for one in group
    )]
    show(form, report, records, class_table({**report, 'would_help': helps}))


def flattened(content: Any, path: str = '') -> list[tuple[str, Any]]:
    """Return the leaves of JSON ``content`` with their dotted paths below ``path``, for CSV.

    Places in lists are counted from 0; None becomes an empty text.
    """
    if not isinstance(content, (Mapping, list, tuple)):
        return [(path, '' if content is None else content)]
    items = content.items() if isinstance(content, Mapping) else enumerate(content)
    return [
        leaf
        for key, value in items
        for leaf in flattened(value, f'{path}.{key}' if path else str(key))
    ]


def draw(post: PostFailure, picture: Path) -> None:
    """Write a drawing of ``post`` to ``picture``, whose ending says the format.

    FaultToleranceError without matplotlib, or if the file cannot be written.
    """
    try:
        # matplotlib is optional, and needed here only.
        from fault_tolerance.analysis.drawing import mechanism_figure, save_figure
    except ImportError as error:
        reason = f'drawing needs matplotlib, which is not installed ({error})'
        raise FaultToleranceError(reason) from None
    figure = mechanism_figure(post.configuration, post.failures)
    try:
        save_figure(figure, picture)
    except (OSError, ValueError) as error:
        raise FaultToleranceError(f'{picture}: cannot be written ({error})') from None


def report(
    bag: Path, folder: Path | None, namespace: str | None, mechanism: Mechanism | None
) -> None:
    """Print what the recording ``bag`` shows, and write the report of it to ``folder``.

    ``bag`` is an .mcap or .db3 file, or the folder of a bag; without a ``folder`` the report goes
    beside it. ``namespace`` is that of the robot, if there are several in the bag, ``mechanism``
    what was recorded; None: as the metrics say. FaultToleranceError without rosbags and
    matplotlib, or if the recording cannot be used.
    """
    try:
        # rosbags and matplotlib are optional, and needed here only.
        from fault_tolerance.analysis.bags import read_messages
        from fault_tolerance.analysis.report_page import write_report
    except ImportError as error:
        reason = f'reports need rosbags and matplotlib: {error.name} is not installed'
        raise FaultToleranceError(reason) from None
    run = run_of(recordings_of(read_messages(bag), mechanism), namespace, mechanism)
    show('text', None, (), summary_table(summary(run)))
    if folder is None:
        folder = bag if bag.is_dir() else bag.parent
    for path in write_report(run, folder):
        print(path)


def detect(bag: Path, options: DetectOptions, folder: Path | None, form: Form) -> None:
    """Print in ``form`` what detection finds in the recording ``bag``, and draw its evidence.

    With ``options``; the figure goes to ``folder``, without one beside the bag.
    FaultToleranceError without rosbags, or if the recording cannot be used.
    """
    try:
        from fault_tolerance.analysis.recorded_inputs import recorded_inputs
        from fault_tolerance.replay.detection_report import (
            detection_report,
            evidence_of,
            mechanism_of,
        )
        from fault_tolerance.replay.replayed import replayed
    except ImportError as error:
        reason = f'recordings need rosbags: {error.name} is not installed'
        raise FaultToleranceError(reason) from None
    inputs = recorded_inputs(bag, options.namespace, options.pose)
    mechanism = mechanism_of(inputs, options)
    result = replayed(inputs, mechanism, options.detect, options.delay)
    report = detection_report(inputs, mechanism, options, result)
    records = [FINDING_KEYS, *finding_records(report)]
    show(form, report, records, finding_table(report))
    try:
        from fault_tolerance.analysis.odds_figure import write_odds_figure
    except ImportError:
        return
    picture = (folder or (bag if bag.is_dir() else bag.parent)) / 'detection.png'
    write_odds_figure(evidence_of(inputs, mechanism, result), picture)
    if form == 'text':
        print(picture)


def check_rules(
    rules: RuleSet, mechanism: Mechanism | None, form: Form, bag: Path | None, namespace: str
) -> None:
    """Print what ``rules`` mean for the drives of ``mechanism``, in ``form``.

    With a ``bag`` also what they would have reported of the robot in ``namespace``.
    FaultToleranceError if there is a bag but no mechanism, or it cannot be read.
    """
    watch = None if mechanism is None else DriveWatch(rules, mechanism)
    report = rules_report(rules, watch)
    if bag is not None:
        if watch is None:
            raise FaultToleranceError('a bag needs the drives it is about: --mechanism M')
        try:
            from fault_tolerance.analysis.bags import read_topics, topics_in
        except ImportError as error:
            reason = f'recordings need rosbags: {error.name} is not installed'
            raise FaultToleranceError(reason) from None
        chosen, remarks = topics_of(watch, topics_in(bag), namespace)
        report |= replayed_report(watch, chosen, read_topics(bag, chosen), remarks)
    records = [RULE_EVENT_KEYS, *rule_event_records(report)]
    show(form, report, records, rule_table(report))


def show(
    form: Form, content: object, records: Iterable[Sequence[Any]], shown: RenderableType
) -> None:
    """Print in ``form``: ``content`` as JSON, ``records`` as CSV or ``shown`` as text."""
    text = StringIO()
    if form == 'json':
        text.write(json.dumps(content, indent=2, allow_nan=False) + '\n')
    elif form == 'csv':
        csv.writer(text, lineterminator='\n').writerows(records)
    else:
        # Names may look like rich's markup. On a broken pipe rich would end the program itself.
        console = console_for_text(markup=False, emoji=False, highlight=False)
        with console.capture() as captured:
            console.print(shown)
        text.write(captured.get())
    print(text.getvalue(), end='')
