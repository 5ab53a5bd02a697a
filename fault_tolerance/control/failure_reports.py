# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Failure reports: what a diagnostic status says about a part of this mechanism.

A status is a failure report when it carries a failure mode (mechanism/failure_modes.py) and its
hardware id is the name of an actuator or a strut, alone or behind a prefix: ``strut_4``,
``mirror/strut_4``. The prefix keeps robots apart that share one diagnostics topic.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.failures import FailureMode, actuators_hit
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.failure_modes import mode_from_word

OK, WARN, ERROR, STALE = 0, 1, 2, 3
"""The levels of a diagnostic status."""

LONGEST_WORD = 40
"""Characters of a failure mode that are looked at."""


class Report(NamedTuple):
    """What one source says about one actuator or strut."""

    source: tuple[str, str]
    """Who says it: the status' name and hardware id."""
    target: str | None
    """The actuator or strut; None where the hardware id names nothing of this mechanism."""
    mode: str
    """The failure mode as it was written, in one printable line."""
    level: int
    """The diagnostic level."""
    stamp: float | None = None
    """When it was written, seconds on the time line of ``now``; None: when it is received."""


class Statement(NamedTuple):
    """A report understood."""

    target: str
    """Actuator or strut."""
    mode: FailureMode | None
    """None: unknown mode at level ERROR or above."""
    word: str
    """The mode as it was written."""

    @property
    def severity(self) -> int:
        """How bad it is, for comparison: none, torque, position, hard, unknown."""
        return self.mode.severity if self.mode else len(FailureMode)

    @property
    def text(self) -> str:
        """It in words, as in ``theta_4 (position)``."""
        return f'{self.target} ({self.mode.value if self.mode else self.word})'


def part_names(mechanism: Mechanism) -> dict[str, str]:
    """Return the actuators and struts of ``mechanism`` by the hardware ids that mean them.

    These are their own names, and for an actuator also that of its joint in joint states, unless
    another part has that name.
    """
    joints = zip(mechanism.joint_state_names, mechanism.actuator_names, strict=True)
    parts = (*mechanism.actuator_names, *mechanism.strut_names)
    return {**dict(joints), **{name: name for name in parts}}


def target_of(hardware_id: str, prefix: str, names: Mapping[str, str]) -> str | None:
    """Return the actuator or strut that a ``hardware_id`` means, by ``names`` (see `part_names`).

    None where it means none of them, or has the prefix of another robot than ``prefix``.
    """
    if hardware_id in names:
        return names[hardware_id]
    if is_foreign(hardware_id, prefix):
        return None
    return names.get(hardware_id.rpartition('/')[2])


def is_foreign(hardware_id: str, prefix: str) -> bool:
    """Return whether ``hardware_id`` (``NAME`` or ``PREFIX/NAME``) is of another robot.

    ``prefix`` is that of this robot; if it is empty, any is accepted.
    """
    given = hardware_id.strip('/').rpartition('/')[0]
    expected = prefix.strip('/')
    return bool(given) and bool(expected) and given != expected


def report_of(
    name: str, hardware_id: str, level: int, mode: str | None, stamp: float | None,
    *, prefix: str, names: Mapping[str, str],
) -> Report | None:
    """Return the report a diagnostic status makes; None if it is none, or for another robot.

    From its ``name``, ``hardware_id`` and ``level``, the value ``mode`` of its key
    ``failure_mode`` (None where it has no such key) and its ``stamp``, see `Report`; ``prefix``
    and ``names`` as in `target_of`.
    """
    if mode is None:
        return None
    target = target_of(hardware_id, prefix, names)
    if target is None and is_foreign(hardware_id, prefix):
        return None
    if hardware_id not in names:
        hardware_id = clean(hardware_id)
    word = clean(mode.strip(), LONGEST_WORD)
    return Report((clean(name), hardware_id), target, word, level, stamp)


def interpret(
    report: Report, mechanism: Mechanism, stop_on_unknown_mode: bool
) -> tuple[Statement | None, tuple[Notice, ...]]:
    """Return what ``report`` states about ``mechanism``, None if nothing, and remarks about it.

    With ``stop_on_unknown_mode`` an unknown mode at level ERROR or above is a statement too: it
    demands a stop.
    """
    target = report.target
    if target is None:
        known = ', '.join((*mechanism.actuator_names, *mechanism.strut_names))
        text = f'failure report for {clean(report.source[1])!r}; known: {known}'
        return None, (Notice('unknown_name', text),)
    if report.level == STALE:
        return None, (Notice('stale_report', ''),)
    word = report.mode
    try:
        mode = mode_from_word(word)
    except FailureError as error:
        stops = stop_on_unknown_mode and report.level >= ERROR
        notice = Notice('unknown_mode', f'{target}: {error}', part=target)
        return Statement(target, None, word) if stops else None, (notice,)
    statement = Statement(target, mode, word)
    if mode is not FailureMode.NONE:
        try:
            actuators_hit(mechanism, mode, target)
        except FailureError as error:
            return None, (Notice('refused_mode', f'{statement.text}: {error}', part=target),)
    notices: tuple[Notice, ...] = ()
    if report.level not in (OK, WARN, ERROR):
        text = f'{statement.text} came with level {report.level}, taken as ERROR (2)'
        notices = (Notice('odd_level', text, False, target),)
    elif report.level == OK and mode is not FailureMode.NONE:
        text = (
            f'{statement.text} came with level OK and is applied; on a command line write '
            '`level: [2]`, as `level: 2` arrives as 0'
        )
        notices = (Notice('level_ok', text, False, target),)
    return statement, notices
