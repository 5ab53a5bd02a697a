# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What rules mean, and what they would have reported, as data for programs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from fault_tolerance.drive_rules.conditions import MEANING, Case
from fault_tolerance.drive_rules.drive_watch import DriveReport, DriveWatch
from fault_tolerance.drive_rules.rules import Rule, RuleSet

_MOST_COMPLAINTS = 20


def rules_report(rules: RuleSet, watch: DriveWatch | None) -> dict[str, Any]:
    """Return what ``rules`` mean, for JSON; with a ``watch``, for which drives of a mechanism."""
    report: dict[str, Any] = {
        'source': rules.source,
        'mechanism': None if watch is None else watch.mechanism.name,
        'rules': [_rule(rule, watch) for rule in rules.rules],
        'unwatched': [] if watch is None else list(watch.unwatched),
    }
    if watch is not None:
        report['when_off'] = {
            one: watch.mode_of('when_off', one) for one in watch.mechanism.actuator_names
        }
        report['worse'] = {
            one: watch.mode_of('worse', one) for one in watch.mechanism.actuator_names
        }
    return report


def topics_of(
    watch: DriveWatch, kinds: Mapping[str, str], namespace: str
) -> tuple[dict[str, str], list[str]]:
    """Return where in a recording the topics of ``watch`` are, and what is missing, in words.

    Parameters
    ----------
    watch : DriveWatch
    kinds : mapping of str to str
        Types of the topics in the recording, by full name.
    namespace : str
        Of the robot.

    Returns
    -------
    dict of str to str
        The topic's name in the rules by its full name.
    list of str
    """
    prefix = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
    found, remarks = {}, []
    for topic, rule in watch.topics.items():
        full = topic if topic.startswith('/') else f'{prefix}/{topic}'
        if full not in kinds:
            remarks.append(f'{full} is not in it')
        elif kinds[full] != rule.kind:
            remarks.append(f'{full} is of type {kinds[full]} in it, not {rule.kind}')
        else:
            found[full] = topic
    return found, remarks


def replayed_report(
    watch: DriveWatch, topics: Mapping[str, str], messages: Iterable[Any], remarks: Iterable[str]
) -> dict[str, Any]:
    """Return what ``watch`` would have reported of ``messages``, for JSON.

    Parameters
    ----------
    watch : DriveWatch
    topics : mapping of str to str
        From `topics_of`.
    messages : iterable of (topic, time, message)
        In their order, times in nanoseconds.
    remarks : iterable of str
        What is known to be missing.

    Returns
    -------
    dict
        ``messages``, ``begin`` (seconds), ``events`` and ``remarks``.
    """
    before: dict[tuple[str, str], DriveReport] = {}
    events, begin, count = [], None, 0
    complaints: dict[str, None] = dict.fromkeys(remarks)
    for topic, time, message in messages:
        count += 1
        begin = time if begin is None else begin
        taken = watch.take(topics[topic], message)
        for name, reason in taken.complaints:
            if len(complaints) < _MOST_COMPLAINTS:
                complaints[f'{topic} does not fit the rule {name}: {reason}'] = None
        for one in watch.reports() if taken.changed else ():
            old = before.get((one.rule, one.actuator))
            before[one.rule, one.actuator] = one
            if one.mode != ('none' if old is None else old.mode):
                events.append({'time': (time - begin) / 1e9, **one._asdict()})
    for topic in topics.values():
        parts = ', '.join(dict.fromkeys(watch.unseen(topic)))
        if parts:
            text = f'{topic} says nothing of {parts}: check the drive names in the rule file'
            complaints[text] = None
    return {
        'messages': count, 'begin': None if begin is None else begin / 1e9,
        'events': events, 'remarks': list(complaints),
    }


def _rule(rule: Rule, watch: DriveWatch | None) -> dict[str, Any]:
    drives: dict[str, str] | str | None = None
    if watch is not None:
        mine = [one for one in watch.drives if one.rule is rule]
        drives = {name: one.called for one in mine for name in one.actuators}
    elif rule.is_per_drive:
        drives = rule.drives if isinstance(rule.drives, str) else dict(rule.drives)
    return {
        'name': rule.name, 'topic': rule.topic, 'type': rule.kind, 'field': str(rule.field),
        'per_drive': rule.is_per_drive, 'drives': drives,
        'cases': [_case(case) for case in rule.cases],
        'reset': None if rule.reset is None else {
            'service': rule.reset.service, 'type': rule.reset.kind,
            'request': dict(rule.reset.request),
        },
        'otherwise': {'says': rule.otherwise, 'meaning': MEANING[rule.otherwise]},
    }


def _case(case: Case) -> dict[str, str]:
    return {
        'if': str(case), 'says': case.says, 'text': case.text, 'meaning': MEANING[case.says]
    }
