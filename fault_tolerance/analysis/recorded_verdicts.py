# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller's verdict over time, from whatever of it was recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from fault_tolerance.analysis import topics
from fault_tolerance.errors import FailureError
from fault_tolerance.mechanism.failure_modes import FailureMode, mode_from_word

MECHANISM_STATUS = 'fault_tolerance: mechanism'
FAILURE_MODE = 'failure_mode'
"""The key of a failure report, and of what detection acts on."""


class Health(NamedTuple):
    """The controller's verdict at a time (s)."""

    time: float
    state: str
    failures: tuple[str, ...]


class Verdict(NamedTuple):
    """What the metrics say of a mechanism; ``suspected`` is what nobody has reported."""

    mechanism: str
    state: str
    failures: tuple[str, ...]
    suspected: str


def verdict_of(status: Any) -> Verdict:
    """Return what the ``status`` of the mechanism in the metrics, or ``~/status``, says."""
    values = values_of(status)
    failures = values.get('failures', '')
    return Verdict(
        str(status.hardware_id).rpartition('/')[2], values.get('state', ''),
        tuple(failures.split(', ')) if failures else (), values.get('suspected', ''),
    )


def verdict_in(metrics: Any) -> Verdict | None:
    """Return what a message of ``metrics`` says of the mechanism; None if it does not."""
    status = mechanism_in(metrics)
    return None if status is None else verdict_of(status)


def mechanism_in(metrics: Any) -> Any:
    """Return the status of the mechanism in a message of ``metrics``; None if there is none."""
    return next((one for one in metrics.status if one.name == MECHANISM_STATUS), None)


def values_of(status: Any) -> dict[str, str]:
    """Return the values of a diagnostic ``status`` by key."""
    return {pair.key: pair.value for pair in status.values}


def healths_of(
    heard: Mapping[str, Sequence[Any]], diagnostics: Sequence[Any], prefix: str,
    since: Callable[[int], float],
) -> tuple[Health, ...]:
    """Return the verdicts in what was ``heard`` of a robot, messages by topic.

    From the metrics, else ``~/status``, else ``~/state`` with the failures that were reported on
    the ``diagnostics`` with the ``prefix``; without any of these a single one that says nothing.
    ``since`` converts nanoseconds to the seconds of the recording.
    """
    if heard[topics.METRICS]:
        found = [(since(one.time), verdict_in(one.content)) for one in heard[topics.METRICS]]
        return tuple(Health(time, one.state, one.failures) for time, one in found if one)
    if heard[topics.STATUS]:
        told = [(since(one.time), verdict_of(one.content)) for one in heard[topics.STATUS]]
        return tuple(Health(time, one.state, one.failures) for time, one in told)
    changes: list[tuple[float, str | None, tuple[str, ...] | None]] = [
        (since(one.time), one.content.data, None) for one in heard[topics.STATE]
    ]
    changes += [
        (since(time), None, failures) for time, failures in _reported(diagnostics, prefix)
    ]
    state, present = '', ()
    healths = [] if heard[topics.STATE] else [Health(0.0, '', ())]
    for time, told_state, failures in sorted(changes, key=lambda one: one[0]):
        state = state if told_state is None else told_state
        present = present if failures is None else failures  # type: ignore[assignment]
        healths.append(Health(time, state, present))
    return tuple(healths)


def _reported(diagnostics: Sequence[Any], prefix: str) -> list[tuple[int, tuple[str, ...]]]:
    """Return when (ns) the failures reported by drives changed, and to which."""
    latched: dict[tuple[str, str], str] = {}
    found: list[tuple[int, tuple[str, ...]]] = []
    for message in diagnostics:
        before = tuple(latched.values())
        for status in message.content.status:
            word = values_of(status).get(FAILURE_MODE)
            place, _, name = status.hardware_id.strip('/').rpartition('/')
            if word is None or (place and prefix and place != prefix):
                continue
            try:
                mode = mode_from_word(word.strip())
            except FailureError:
                continue
            latched.pop((status.name, name), None)
            if mode is not FailureMode.NONE:
                latched[status.name, name] = f'{mode.value}:{name}'
        if tuple(latched.values()) != before:
            found.append((message.time, tuple(sorted(set(latched.values())))))
    return found


def scalar_in(metrics: Any, name: str) -> float | None:
    """Return the scalar ``name`` of a message of ``metrics``, as its own topic would have it.

    None if the message does not tell it.
    """
    tolerance = name.removesuffix('_tolerance')
    if tolerance != name:
        measures = [_number(values_of(one).get(tolerance)) for one in metrics.status]
        known = [one for one in measures if one is not None]
        return min(known) if known else None
    status = mechanism_in(metrics)
    return None if status is None else _number(values_of(status).get(name))


def _number(text: str | None) -> float | None:
    try:
        return float(text) if text else None
    except ValueError:
        return None
