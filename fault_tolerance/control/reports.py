# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Failure reports: what a diagnostic status says about a part of this mechanism.

A status is a failure report when it carries a failure mode and its hardware id is the name of an
actuator or a strut, alone or behind a prefix: ``strut_4``, ``mirror/strut_4``. The prefix keeps
robots apart that share one diagnostics topic.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.failures import FailureMode, failure_set, mode_from_word
from fault_tolerance.mechanism.description import Mechanism

OK, WARN, ERROR, STALE = 0, 1, 2, 3
"""The levels of a diagnostic status."""

LONGEST_WORD = 40
"""Characters of a failure mode that are looked at."""


class Report(NamedTuple):
    """What one source says about one actuator or strut.

    Attributes
    ----------
    source : tuple of str
        Who says it: the status' name and hardware id.
    target : str or None
        The actuator or strut; None where the hardware id names nothing of this mechanism.
    mode : str
        The failure mode as it was written.
    level : int
        The diagnostic level.
    stamp : float or None
        When it was written, seconds on the time line of ``now``; None: when it is received.
    """

    source: tuple[str, str]
    target: str | None
    mode: str
    level: int
    stamp: float | None = None


class Statement(NamedTuple):
    """A report understood.

    Attributes
    ----------
    target : str
        Actuator or strut.
    mode : FailureMode or None
        None: a mode nobody understands, at a level that cannot be passed over.
    word : str
        The mode as it was written.
    """

    target: str
    mode: FailureMode | None
    word: str

    @property
    def severity(self) -> int:
        """How bad it is, for comparison: none, torque, position, hard, unknown."""
        return _SEVERITY.index(self.mode)

    @property
    def text(self) -> str:
        """It in words, as in ``theta_4 (position)``."""
        return f'{self.target} ({self.mode.value if self.mode else self.word})'


_WORDS = {mode.value: mode for mode in FailureMode}
_SEVERITY = (FailureMode.NONE, FailureMode.TORQUE, FailureMode.POSITION, FailureMode.HARD, None)


def target_of(hardware_id: str, prefix: str, names: Collection[str]) -> str | None:
    """Return the actuator or strut a hardware id stands for.

    Parameters
    ----------
    hardware_id : str
        ``NAME`` or ``PREFIX/NAME``.
    prefix : str
        The prefix of this robot; empty: any prefix is accepted.
    names : collection of str
        Names of the mechanism's actuators and struts.

    Returns
    -------
    str or None
        None where it is another robot's, or no part of this mechanism.
    """
    if hardware_id in names:
        return hardware_id
    if is_foreign(hardware_id, prefix):
        return None
    name = hardware_id.rpartition('/')[2]
    return name if name in names else None


def is_foreign(hardware_id: str, prefix: str) -> bool:
    """Return whether a hardware id carries the prefix of another robot."""
    given = hardware_id.strip('/').rpartition('/')[0]
    expected = prefix.strip('/')
    return bool(given) and bool(expected) and given != expected


def report_of(
    name: str,
    hardware_id: str,
    level: int,
    mode: str | None,
    stamp: float | None,
    *,
    prefix: str,
    names: Collection[str],
) -> Report | None:
    """Return the report a diagnostic status makes.

    Parameters
    ----------
    name, hardware_id : str
        The status' own.
    level : int
        The status' level.
    mode : str or None
        The value of its key ``failure_mode``; None where it has no such key.
    stamp : float or None
        See `Report`.
    prefix, names
        See `target_of`.

    Returns
    -------
    Report or None
        None where the status is no failure report, or is meant for another robot.
    """
    if mode is None:
        return None
    target: str | None = hardware_id
    if hardware_id not in names:
        if is_foreign(hardware_id, prefix):
            return None
        target = target_of(hardware_id, prefix, names)
        hardware_id = clean(hardware_id)
    word = clean(mode.strip(), LONGEST_WORD)
    return Report((clean(name), hardware_id), target, word, level, stamp)


def taken_at_its_word(report: Report, parts: Collection[str]) -> Statement | None:
    """Return what a report states if there is nothing to be said about it; else ask `understood`.

    That is what a report comes to which is written as it should be.

    Parameters
    ----------
    report : Report
    parts : collection of str
        Actuators and struts that may fail in every mode, see `of_every_mode`.
    """
    mode = _WORDS.get(report.mode)
    target = report.target
    if mode is None or target is None or target not in parts:
        return None
    if report.level == (OK if mode is FailureMode.NONE else ERROR):
        return Statement(target, mode, report.mode)
    return None


def of_every_mode(mechanism: Mechanism) -> frozenset[str]:
    """Return the names of the actuators and struts that may fail in every mode."""
    if not mechanism.struts:
        return frozenset()
    driven = (actuator.strut for actuator in mechanism.actuators)
    return frozenset((*mechanism.actuator_names, *driven))


def understood(
    report: Report, mechanism: Mechanism, *, stop_on_unknown_mode: bool
) -> tuple[Statement | None, tuple[Notice, ...]]:
    """Return what a report states, and what is to be said about it.

    Parameters
    ----------
    report : Report
    mechanism : Mechanism
    stop_on_unknown_mode : bool
        Whether a mode nobody understands, at level ERROR or above, is a statement (that demands
        a stop) rather than nothing.

    Returns
    -------
    Statement or None
        None where the report is left aside.
    tuple of Notice
    """
    if report.target is None:
        known = ', '.join((*mechanism.actuator_names, *mechanism.strut_names))
        text = f'failure report for {clean(report.source[1])!r}; known: {known}'
        return None, (Notice('unknown_name', text),)
    if report.level == STALE:
        return None, (Notice('stale_report', ''),)
    word = clean(report.mode.strip(), LONGEST_WORD)
    try:
        mode = mode_from_word(word)
    except FailureError as error:
        notice = Notice('unknown_mode', f'{report.target}: {error}')
        if stop_on_unknown_mode and report.level >= ERROR:
            return Statement(report.target, None, word), (notice,)
        return None, (notice,)
    statement = Statement(report.target, mode, word)
    try:
        failure_set(mechanism, [(mode, report.target)])
    except FailureError as error:
        return None, (Notice('refused_mode', f'{statement.text}: {error}'),)
    return statement, _level_notices(report, statement)


def _level_notices(report: Report, statement: Statement) -> tuple[Notice, ...]:
    if report.level not in (OK, WARN, ERROR):
        text = f'{statement.text} came with level {report.level}, taken as ERROR (2)'
        return (Notice('odd_level', text, rejected=False),)
    if report.level == OK and statement.mode is not FailureMode.NONE:
        text = (
            f'{statement.text} came with level OK and is applied; on a command line write '
            '`level: [2]`, as `level: 2` arrives as 0'
        )
        return (Notice('level_ok', text, rejected=False),)
    return ()
