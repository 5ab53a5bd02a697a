# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Rules: which topic, which field, whose drive, and what its values say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fault_tolerance.drive_rules.conditions import Case, Says
from fault_tolerance.drive_rules.field_paths import DRIVE, FieldPath, Value
from fault_tolerance.mechanism.description import Mechanism

JOINT, NUMBER, INDEX = '{joint}', '{number}', '{index}'
"""In a template for what messages call a drive: its name in joint states, its place from 1 and
from 0 in the mechanism's order."""

Drives = Mapping[str, str] | str
"""What messages call the drives, by actuator, strut or group; or a template for all actuators."""

DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'


@dataclass(frozen=True)
class Reset:
    """The service that resets a drive, or several.

    Attributes
    ----------
    service : str
        Its name; may contain ``{drive}``.
    kind : str
        Its type, as ``std_srvs/srv/Trigger``.
    request : tuple of (str, value)
        Fields of the request; the others stay as they are in a new one.
    """

    service: str
    kind: str
    request: tuple[tuple[str, Value], ...] = ()

    def of_drive(self, called: str) -> Reset:
        """Return that of the drive that messages call ``called``."""
        request = tuple(
            (key, value.replace(DRIVE, called) if isinstance(value, str) else value)
            for key, value in self.request
        )
        return Reset(self.service.replace(DRIVE, called), self.kind, request)


@dataclass(frozen=True)
class Rule:
    """One rule.

    Attributes
    ----------
    name : str
    topic : str
        May contain ``{drive}``.
    kind : str
        Type of its messages, as ``std_msgs/msg/Int32``.
    field : FieldPath
        Where the value stands in a message.
    cases : tuple of Case
        The first that holds counts.
    otherwise : Says
        What a value says for which no case holds.
    drives : mapping of str to str, or str
    best_effort : bool
        Whether messages may be lost on the way: sensor data is published so.
    reset : Reset, optional
        What resets a drive of which the rule says that it has failed.
    """

    name: str
    topic: str
    kind: str
    field: FieldPath
    cases: tuple[Case, ...]
    otherwise: Says
    drives: Drives
    best_effort: bool = False
    reset: Reset | None = None

    @property
    def is_per_drive(self) -> bool:
        """Whether it tells drives apart; else what it finds is about all of them."""
        return DRIVE in self.topic or self.field.is_per_drive

    def case_of(self, value: Value) -> Case:
        """Return the case that holds for ``value``."""
        return next(
            (case for case in self.cases if case.holds(value)),
            Case(self.otherwise, 'unknown value'),
        )

    def called(self, mechanism: Mechanism) -> dict[str, str]:
        """Return what messages call the drives of ``mechanism``, by the part each carries."""
        if not isinstance(self.drives, str):
            return dict(self.drives)
        return {
            one.name: self.drives.replace(JOINT, one.joint_state_name)
            .replace(NUMBER, str(place + 1)).replace(INDEX, str(place))
            for place, one in enumerate(mechanism.actuators)
        }


@dataclass(frozen=True)
class RuleSet:
    """The rules of one file, ``source``."""

    source: str
    rules: tuple[Rule, ...]
