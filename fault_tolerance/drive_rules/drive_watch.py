# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The state of every drive by the rules, from one message to the next.

A failure holds until a value says that the drive is well again, not for a time.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import isnan
from types import SimpleNamespace
from typing import Any, NamedTuple

from fault_tolerance.drive_rules.conditions import Says, shown
from fault_tolerance.drive_rules.field_paths import DRIVE, FieldError, FieldPath, Value
from fault_tolerance.drive_rules.rules import DIAGNOSTICS, Reset, Rule, RuleSet
from fault_tolerance.errors import FailureError, MechanismError
from fault_tolerance.kinematics.common_causes import members, worse_modes
from fault_tolerance.kinematics.failures import FailureMode
from fault_tolerance.mechanism.description import Mechanism

UNIDENTIFIED = 'unidentified'
"""A failure mode that no controller knows: at level ERROR it stops the machine."""

LONGEST_MESSAGE = 200
"""Characters of a report's message."""

MOST_ELEMENTS = 100
"""Elements of one drive in one rule that may have failed at the same time."""

_IN_TOPIC = re.compile(r'\w+(/\w+)*', re.ASCII)
_ANSWERS = ('failure_mode', 'suspected_mode')
_MODES: dict[Says, FailureMode] = {
    'stuck': FailureMode.POSITION, 'free': FailureMode.TORQUE, 'lost': FailureMode.HARD,
}


class DriveReport(NamedTuple):
    """What one rule says about one actuator."""

    rule: str
    actuator: str
    mode: str
    """A failure mode, ``none``, or `UNIDENTIFIED`."""
    message: str


class Taken(NamedTuple):
    """What a message has brought."""

    changed: bool
    """Whether any report is another than before."""
    complaints: tuple[tuple[str, str], ...]
    """Rules that do not fit the message, and why."""


@dataclass(eq=False)
class WatchedDrive:
    """One drive in one rule."""

    rule: Rule
    part: str
    """The actuator, strut or group that it carries."""
    called: str
    """What messages call it."""
    topic: str
    path: FieldPath
    actuators: tuple[str, ...]
    """Those it carries."""
    reset: Reset | None = None
    seen: bool = False
    """Whether any message had a value for it."""
    enabled: bool = False
    """Whether it has been well."""
    failures: dict[str, tuple[Says, str]] = field(default_factory=dict)
    """What has failed, and in words, by the element that said so."""

    def take(self, element: str, value: Value) -> bool:
        """Take the ``value`` of an ``element``; return whether anything is another than before."""
        self.seen = True
        if isinstance(value, float) and isnan(value):
            return False
        case = self.rule.case_of(value)
        if case.says == 'nothing' or (case.once_enabled and not self.enabled):
            return False
        if case.says == 'well':
            first, self.enabled = not self.enabled, True
            return self.failures.pop(element, None) is not None or first
        if element not in self.failures and len(self.failures) >= MOST_ELEMENTS:
            return False
        words = f'{case.text or case.says}: {shown(value)}'[:LONGEST_MESSAGE]
        before = self.failures.get(element)
        self.failures[element] = (case.says, words)
        return before is None or before[0] != case.says


class DriveWatch:
    """Watches the drives of ``mechanism`` by ``rules``.

    MechanismError if the rules name parts that the mechanism does not have.
    """

    def __init__(self, rules: RuleSet, mechanism: Mechanism) -> None:
        self.rules, self.mechanism = rules, mechanism
        self._worse = worse_modes(mechanism)
        self.drives = tuple(
            drive for rule in rules.rules for drive in _watched(rules.source, rule, mechanism)
        )
        self._by_topic: dict[str, list[WatchedDrive]] = defaultdict(list)
        for drive in self.drives:
            self._by_topic[drive.topic].append(drive)
            rule, other = drive.rule, self._by_topic[drive.topic][0].rule
            place = f'rules.{rule.name}'
            if rule.kind != other.kind:
                reason = f'{drive.topic} is of type {other.kind} in another rule'
                raise MechanismError(rules.source, f'{place}.type', reason)
            if rule.best_effort != other.best_effort:
                reason = f'{drive.topic} is of another quality in another rule'
                raise MechanismError(rules.source, f'{place}.best_effort', reason)

    @property
    def topics(self) -> dict[str, Rule]:
        """A rule for every topic that has to be listened to, for its type and quality."""
        return {topic: drives[0].rule for topic, drives in self._by_topic.items()}

    @property
    def unwatched(self) -> tuple[str, ...]:
        """Actuators that no rule is about."""
        watched = {one for drive in self.drives for one in drive.actuators}
        return tuple(one for one in self.mechanism.actuator_names if one not in watched)

    @property
    def resets(self) -> tuple[Reset, ...]:
        """The services that reset drives."""
        return tuple(dict.fromkeys(one.reset for one in self.drives if one.reset))

    @property
    def failed(self) -> dict[str, list[Reset]]:
        """Parts whose drives have failed by any rule, and what resets them by those rules."""
        found: dict[str, list[Reset]] = {}
        for one in self.drives:
            if one.failures:
                found.setdefault(one.part, []).extend([one.reset] if one.reset else [])
        return found

    @property
    def idle(self) -> tuple[str, ...]:
        """Parts with a drive that was heard of, and neither was well nor has failed."""
        found = (
            one.part for one in self.drives if one.seen and not (one.enabled or one.failures)
        )
        return tuple(dict.fromkeys(found))

    def unseen(self, topic: str) -> tuple[str, ...]:
        """Return the parts of which no message on ``topic`` has had a value."""
        return tuple(one.part for one in self._by_topic[topic] if not one.seen)

    def take(self, topic: str, message: Any) -> Taken:
        """Take a ``message`` on ``topic``; return what it has brought."""
        changed, complaints = False, {}
        drives = self._by_topic[topic]
        if drives[0].rule.kind == DIAGNOSTICS:
            message = _without_reports(message)
        for drive in drives:
            try:
                for element, value in drive.path.values(message):
                    changed |= drive.take(element, value)
            except FieldError as error:
                complaints[drive.rule.name] = error.reason
        return Taken(changed, tuple(complaints.items()))

    def reports(self) -> tuple[DriveReport, ...]:
        """Return what every rule says about every actuator of which it knows anything."""
        found = []
        for rule in self.rules.rules:
            mine = [drive for drive in self.drives if drive.rule is rule]
            for name in self.mechanism.actuator_names:
                about = [drive for drive in mine if name in drive.actuators]
                said = [one for drive in about for one in drive.failures.values()]
                if said:
                    says, words = max(said, key=lambda one: self._severity(one[0], name))
                    found.append(DriveReport(rule.name, name, self.mode_of(says, name), words))
                elif any(drive.enabled for drive in about):
                    found.append(DriveReport(rule.name, name, FailureMode.NONE.value, 'well'))
        return tuple(found)

    def mode_of(self, says: Says, actuator: str) -> str:
        """Return the failure mode of ``actuator`` that ``says`` means."""
        if says == 'stop':
            return UNIDENTIFIED
        if says in _MODES:
            return _MODES[says].value
        when_off = self.mechanism.actuators[self.mechanism.actuator_index(actuator)].when_off
        if says == 'when_off' and when_off:
            return _MODES[when_off].value
        return self._worse[actuator].value

    def _severity(self, says: Says, actuator: str) -> int:
        mode = self.mode_of(says, actuator)
        return len(FailureMode) if mode == UNIDENTIFIED else FailureMode(mode).severity


def _watched(source: str, rule: Rule, mechanism: Mechanism) -> Iterable[WatchedDrive]:
    for part, called in rule.called(mechanism).items():
        key = f'rules.{rule.name}.drives.{part}'
        try:
            actuators = members(mechanism, part)
        except FailureError:
            known = (*mechanism.actuator_names, *mechanism.strut_names, *mechanism.groups)
            reason = f'is no drive of {mechanism.name}; known: {", ".join(known)}'
            raise MechanismError(source, key, reason) from None
        try:
            path = rule.field.of_drive(called)
        except FieldError as error:
            raise MechanismError(source, key, error.reason) from None
        topic = rule.topic.replace(DRIVE, called)
        names = (rule.topic, rule.reset.service if rule.reset else '')
        if any(DRIVE in one for one in names) and not _IN_TOPIC.fullmatch(called):
            reason = f'{called!r} cannot stand in the name of a topic or service'
            raise MechanismError(source, key, reason)
        reset = rule.reset.of_drive(called) if rule.reset else None
        yield WatchedDrive(rule, part, called, topic, path, actuators, reset)


def _without_reports(message: Any) -> Any:
    """Return diagnostics without failure reports and suspicions: nobody is to answer those."""
    status = [
        one for one in message.status if all(pair.key not in _ANSWERS for pair in one.values)
    ]
    return SimpleNamespace(status=status)
