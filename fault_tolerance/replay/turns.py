# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""In which order a controller has taken what a recording holds.

A recorder hears every topic for itself, so its order need not be the controller's. Where the
commands say which readings they answer, the sequence of the commands is that order.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from math import isfinite, nan
from typing import NamedTuple

import numpy as np

from fault_tolerance.analysis.recorded_inputs import (
    RecordedCommand,
    RecordedInputs,
    RecordedModes,
    RecordedReading,
    Told,
)
from fault_tolerance.control.joint_states import JointStateReader
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

SAME_CLOCK = 5_000_000_000
"""Nanoseconds; stamps further from the time of receipt are of another clock."""

NEAR = 100_000_000
"""Nanoseconds from a report, or a clear, to the command that followed it, at most."""

MOST_MISSED = 100
"""Readings in a row that the controller may not have taken, on a busy machine."""


class Turn(NamedTuple):
    """One command, with the reading it answers; either may be missing."""

    command: RecordedCommand | None
    reading: RecordedReading | None

    @property
    def time(self) -> int:
        """When it was received, nanoseconds."""
        one = self.command or self.reading
        assert one is not None
        return one.time

    @property
    def now(self) -> int:
        """When it was, by the controller's clock, nanoseconds."""
        one = self.command or self.reading
        assert one is not None
        return one.stamp


class Turns(NamedTuple):
    """The turns of a controller, and what is wrong with their order, in words."""

    turns: list[Turn]
    remarks: list[str]


def turns_of(inputs: RecordedInputs, mechanism: Mechanism) -> Turns:
    """Return the turns of the controller of ``mechanism`` that ``inputs`` are of."""
    readings, remarks = _stamped(inputs)
    commands = inputs.commands
    in_parts, whole = _put_together(mechanism, readings)
    if any(command.answered for command in commands):
        turns, missed, lacking = _answered(mechanism, whole, commands, in_parts)
        if missed:
            remarks.append(f'{missed} joint states were not taken by the controller')
        if lacking:
            remarks.append(f'{lacking} joint states are not in the recording; {NOT_IDENTICAL}')
        return Turns(turns, remarks)
    if inputs.named:
        remarks.append(
            'the joint commands do not say which joint states they answer: paired by their stamps'
        )
    else:
        remarks.append(
            'no fault_tolerance/joint_commands in it: velocity_controller/commands with their '
            f'times of receipt; {NOT_IDENTICAL}'
        )
    if in_parts:
        remarks.append(f'joints in messages of their own, put together; {NOT_IDENTICAL}')
        # The last part before a command completes what it answers.
        stamps = sorted(command.stamp for command in commands)
        places = [bisect_right(stamps, one.stamp) for one in whole]
        whole = [one for one, place, following in zip(
            whole, places, [*places[1:], len(stamps) + 1], strict=True) if place < following]
    return Turns(_paired(whole, commands), remarks)


NOT_IDENTICAL = 'not identical to what the live detection has found'


def _stamped(inputs: RecordedInputs) -> tuple[list[RecordedReading], list[str]]:
    """Return the readings, by their times of receipt where they have no stamps that serve."""
    readings, remarks = inputs.readings, []
    bare = sum(not one.stamp for one in readings)
    if bare:
        remarks.append(
            f'{bare} joint states without a stamp: times of receipt are used; {NOT_IDENTICAL}'
        )
    other = not inputs.named and any(
        one.stamp and abs(one.stamp - one.time) > SAME_CLOCK for one in readings
    )
    if other:
        remarks.append('the joint states are stamped by another clock: times of receipt are used')
    return [
        one._replace(stamp=one.time) if other or not one.stamp else one for one in readings
    ], remarks


def _answered(
    mechanism: Mechanism, readings: Sequence[RecordedReading],
    commands: Sequence[RecordedCommand], in_parts: bool,
) -> tuple[list[Turn], int, int]:
    """Return turns as the commands say; how many readings were missed, and are not recorded."""
    reader = JointStateReader(mechanism)
    shown = [_shown(mechanism, reader, one) for one in readings]
    places: dict[tuple[float, ...], list[int]] = defaultdict(list)
    for place, values in enumerate(shown):
        places[() if values is None else tuple(values.tolist())].append(place)
    turns, place, missed, lacking = [], 0, 0, 0
    for command in commands:
        if not command.answered:
            turns.append(Turn(command, None))
            continue
        wanted = np.array(command.answered)
        begun = bool(place)
        last = min(place + MOST_MISSED, len(shown)) if begun else len(shown)
        anywhere = in_parts or np.isnan(wanted).any()
        possible = range(place, last) if anywhere else places[command.answered]
        found = next(
            (k for k in possible if place <= k < last and _same(shown[k], wanted)), None
        )
        if found is None:
            turns.append(Turn(command, None))
            lacking += 1
            continue
        reading = readings[found]
        if in_parts:
            # The last part that changes nothing of it is the one that completed it.
            while found + 1 < last and readings[found + 1].stamp <= command.stamp and _same(
                shown[found + 1], wanted
            ):
                found += 1
            reading = _lacking(mechanism, readings[found], wanted)
        else:
            missed += found - place if begun else 0
        turns.append(Turn(command, reading))
        place = found + 1
    return turns, missed, lacking


def _put_together(
    mechanism: Mechanism, readings: Sequence[RecordedReading]
) -> tuple[bool, Sequence[RecordedReading]]:
    """Return whether readings have some of the joints each; then each with those before it."""
    wanted = set(mechanism.joint_state_names)
    if not any(0 < len(wanted.intersection(one.names)) < len(wanted) for one in readings):
        return False, readings
    newest: dict[str, float] = {}
    whole = []
    for one in readings:
        newest |= {
            name: position for name, position in zip(one.names, one.positions, strict=False)
            if name in wanted and isfinite(position)
        }
        whole.append(one._replace(
            names=tuple(newest), positions=tuple(newest.values()),
            efforts=one.efforts if wanted <= set(one.names) else (),
        ))
    return True, whole


def _lacking(
    mechanism: Mechanism, reading: RecordedReading, wanted: FloatArray
) -> RecordedReading:
    """Return a reading without the joints that a command knows nothing of: they were too old."""
    unknown = np.array(mechanism.joint_state_names)[np.isnan(wanted)].tolist()
    return reading._replace(positions=tuple(
        nan if name in unknown else position
        for name, position in zip(reading.names, reading.positions, strict=True)
    ))


def _shown(
    mechanism: Mechanism, reader: JointStateReader, reading: RecordedReading
) -> FloatArray | None:
    """Return what a command that answers a reading says of it."""
    values, _ = reader.readings(reading.names, reading.positions, mechanism.actuator_names)
    return None if values is None else mechanism.readings_from_values(values)


def _same(shown: FloatArray | None, wanted: FloatArray) -> bool:
    """Return whether these are the readings; joints of lost struts count for nothing."""
    if shown is None or shown.shape != wanted.shape:
        return False
    return bool(((shown == wanted) | np.isnan(wanted) | np.isnan(shown)).all())


def _paired(
    readings: Sequence[RecordedReading], commands: Sequence[RecordedCommand]
) -> list[Turn]:
    """Return turns by stamps: a reading is answered by the next command."""
    turns, place = [], 0
    for reading in readings:
        while place < len(commands) and commands[place].stamp < reading.stamp:
            turns.append(Turn(commands[place], None))
            place += 1
        answer = commands[place] if place < len(commands) else None
        turns.append(Turn(answer, reading))
        place += 1
    return [*turns, *(Turn(command, None) for command in commands[place:])]


class Moments:
    """Finds the turns before which other things have happened, among ``turns``."""

    def __init__(self, turns: Sequence[Turn]) -> None:
        self._turns = turns
        self._times = np.maximum.accumulate([turn.time for turn in turns]).tolist()
        exact = any(turn.command and turn.command.answered for turn in turns)
        self._free = [
            place for place, turn in enumerate(turns)
            if exact and turn.command and not turn.command.answered
        ]

    def of_report(self, report: RecordedModes) -> int:
        """Return the place of the turn that followed a ``report``.

        What changes anything is answered by a command of its own.
        """
        near = [
            place for place in self._free
            if abs(self._turns[place].time - report.time) < NEAR
            and self._turns[place].now >= report.stamp
        ]
        if near:
            return min(near, key=lambda place: abs(self._turns[place].time - report.time))
        return self.after(report.time)

    def of_clear(self, before: Told, told: Told, used: set[int]) -> int:
        """Return the place of the turn that followed a clear.

        It was between the metrics ``before`` and ``told``; places ``used`` followed reports.
        """
        free = [
            place for place in self._free
            if before.time <= self._turns[place].time <= told.time and place not in used
        ]
        return free[-1] if free else self.after(told.time)

    def after(self, time: int) -> int:
        """Return the place of the first turn after ``time`` (ns, of receipt)."""
        return bisect_right(self._times, time)
