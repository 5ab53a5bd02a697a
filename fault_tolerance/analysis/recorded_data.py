# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A recording as time series: messages of one robot's controller, simulator and operator."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from fault_tolerance.analysis import topics
from fault_tolerance.analysis.series import Series, series_of

FAILURE_MODE, SUSPECTED_MODE = 'failure_mode', 'suspected_mode'
"""The keys of what detection acts on, and of what it only tells."""

# Nanoseconds; stamps further from the time of receipt are of another clock.
_SAME_CLOCK = 5_000_000_000
_MECHANISM_STATUS = 'fault_tolerance: mechanism'
DETECTION_STATUS = 'fault_tolerance: detection'


class Sample(NamedTuple):
    """A serialised message: full topic, type, time of receipt (ns), and its CDR bytes."""

    topic: str
    kind: str
    time: int
    data: bytes


class Message(NamedTuple):
    """One message: full topic, time of receipt (ns), and anything with the message's fields."""

    topic: str
    time: int
    content: Any


class Text(NamedTuple):
    """A text with its time (s)."""

    time: float
    text: str


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


class Found(NamedTuple):
    """What detection said at a time (s): ``mode`` and ``name``, and whether it was acted on.

    ``onset`` is when it thinks that it began, s.
    """

    time: float
    mode: str
    name: str
    acted: bool
    onset: float


@dataclass(frozen=True, eq=False)
class Recording:
    """The recorded data of one robot; times in seconds from the first message of all.

    ``mechanism`` is empty if there were no metrics. ``actuators`` name the columns of the
    commanded ``rates`` and of the ``efforts``; ``setpoints`` are the same rates with the stamps of
    the controller, where they were recorded. ``error`` and ``reference`` of pointing are radians
    about x and y. ``scalars`` are the controller's metrics by name, ``phases`` what the operator
    noted as JSON (empty at the end of a phase), ``found`` what detection said. ``end`` is the time
    of the last message, ``origin`` that of the first one in nanoseconds.
    """

    mechanism: str
    actuators: tuple[str, ...]
    error: Series
    reference: Series
    rates: Series
    setpoints: Series
    efforts: Series
    scalars: dict[str, Series]
    states: tuple[Text, ...]
    healths: tuple[Health, ...]
    phases: tuple[Text, ...]
    found: tuple[Found, ...]
    end: float
    origin: int


def recordings_of(messages: Iterable[Message]) -> dict[str, Recording]:
    """Return the recordings by namespace (empty for the root) of every robot with a controller.

    ``messages``, of a live run or from a bag, come in the order of their times.
    """
    by_robot: dict[str, dict[str, list[Message]]] = defaultdict(lambda: defaultdict(list))
    origin = None
    diagnostics = []
    for message in messages:
        if message.topic == topics.DIAGNOSTICS:
            diagnostics.append(message)
        place = topics.split(message.topic)
        if place is None:
            continue
        origin = message.time if origin is None else origin
        by_robot[place[0]][place[1]].append(message)
    return {
        namespace: _recording(heard, origin or 0, _found(diagnostics, namespace, origin or 0))
        for namespace, heard in sorted(by_robot.items())
        if heard[topics.STATE] or heard[topics.METRICS]
    }


def _recording(
    heard: dict[str, list[Message]], origin: int, found: tuple[Found, ...]
) -> Recording:
    last = max(messages[-1].time for messages in heard.values() if messages)

    def since(nanoseconds: int) -> float:
        return (nanoseconds - origin) * 1e-9

    def stamped(message: Message) -> float:
        return since(_stamp(message))

    def pairs(topic: str) -> Series:
        vectors = [(stamped(one), one.content.vector) for one in heard[topic]]
        return series_of([(time, (vector.x, vector.y)) for time, vector in vectors], 2)

    def scalar(name: str) -> Series:
        values = heard[f'{topics.METRICS}/{name}']
        return series_of([(since(one.time), (one.content.data,)) for one in values], 1)

    def texts(topic: str) -> tuple[Text, ...]:
        return tuple(Text(since(one.time), one.content.data) for one in heard[topic])

    overall = [
        (since(message.time), verdict_of(status))
        for message in heard[topics.METRICS] for status in message.content.status
        if status.name == _MECHANISM_STATUS
    ]
    joints = heard[topics.JOINT_STATES]
    labels = heard[f'{topics.METRICS}/{topics.ARRAYS["position"]}']
    named = tuple(topics.labels_in(labels[-1].content)) if labels else ()
    names = named or (tuple(joints[-1].content.name) if joints else ())
    return Recording(
        mechanism=overall[-1][1].mechanism if overall else '',
        actuators=names,
        error=pairs(topics.POINTING_ERROR),
        reference=pairs(topics.POINTING_REFERENCE),
        rates=series_of(
            [(since(one.time), one.content.data) for one in heard[topics.COMMANDS]], len(names)
        ),
        setpoints=series_of(
            [(stamped(one), one.content.velocity) for one in heard[topics.JOINT_COMMANDS]],
            len(names),
        ),
        efforts=series_of(
            [(stamped(one), _in_order(one.content, names)) for one in joints], len(names)
        ),
        scalars={name: scalar(name) for name in topics.SCALARS},
        states=texts(topics.STATE),
        healths=tuple(Health(time, one.state, one.failures) for time, one in overall),
        phases=texts(topics.PHASE),
        found=found,
        end=since(last),
        origin=origin,
    )


def _stamp(message: Message) -> int:
    """Return the stamp (ns) of a ``message``, or when it came if its stamp is of another clock."""
    stamp = message.content.header.stamp
    nanoseconds = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    return nanoseconds if abs(nanoseconds - message.time) < _SAME_CLOCK else message.time


def _found(diagnostics: Iterable[Message], namespace: str, origin: int) -> tuple[Found, ...]:
    """Return what detection said in all ``diagnostics`` about the robot in ``namespace``."""
    found = []
    for message in diagnostics:
        time = (_stamp(message) - origin) * 1e-9
        for status in message.content.status:
            space, _, name = status.hardware_id.rpartition('/')
            if status.name != DETECTION_STATUS or space != namespace.strip('/'):
                continue
            values = {pair.key: pair.value for pair in status.values}
            mode = values.get(FAILURE_MODE) or values.get(SUSPECTED_MODE, '')
            onset = _nanoseconds(values.get('onset', ''))
            found.append(Found(
                time, mode, name, FAILURE_MODE in values,
                time if onset is None else (onset - origin) * 1e-9,
            ))
    return tuple(found)


def _nanoseconds(text: str) -> int | None:
    """Return the seconds since the epoch in ``text``, exactly, as nanoseconds."""
    seconds, _, fraction = text.partition('.')
    try:
        return int(seconds) * 1_000_000_000 + int(fraction.ljust(9, '0')[:9])
    except ValueError:
        return None


def _in_order(joint_state: Any, names: Sequence[str]) -> Sequence[float]:
    """Return the efforts in the order of ``names``, or as they are if those are others."""
    efforts = list(joint_state.effort)
    found = list(joint_state.name)
    if len(efforts) != len(found) or not set(names) <= set(found):
        return efforts
    return [efforts[found.index(name)] for name in names]


def verdict_of(status: Any) -> Verdict:
    """Return what the ``status`` of the mechanism in the metrics says."""
    values = {pair.key: pair.value for pair in status.values}
    failures = values.get('failures', '')
    return Verdict(
        str(status.hardware_id).rpartition('/')[2], values.get('state', ''),
        tuple(failures.split(', ')) if failures else (), values.get('suspected', ''),
    )


def verdict_in(metrics: Any) -> Verdict | None:
    """Return what a message of ``metrics`` says of the mechanism; None if it does not."""
    for status in metrics.status:
        if status.name == _MECHANISM_STATUS:
            return verdict_of(status)
    return None
