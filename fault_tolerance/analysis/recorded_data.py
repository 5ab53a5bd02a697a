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

# Nanoseconds; stamps further from the time of receipt are of another clock.
_SAME_CLOCK = 5_000_000_000
_MECHANISM_STATUS = 'fault_tolerance: mechanism'


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


@dataclass(frozen=True, eq=False)
class Recording:
    """The recorded data of one robot; times in seconds from the first message of all.

    ``mechanism`` is empty if there were no metrics. ``actuators`` name the columns of the
    commanded ``rates`` and of the ``efforts``. ``error`` and ``reference`` of pointing are radians
    about x and y. ``scalars`` are the controller's metrics by name, ``phases`` what the operator
    noted as JSON (empty at the end of a phase), ``end`` is the time of the last message.
    """

    mechanism: str
    actuators: tuple[str, ...]
    error: Series
    reference: Series
    rates: Series
    efforts: Series
    scalars: dict[str, Series]
    states: tuple[Text, ...]
    healths: tuple[Health, ...]
    phases: tuple[Text, ...]
    end: float


def recordings_of(messages: Iterable[Message]) -> dict[str, Recording]:
    """Return the recordings by namespace (empty for the root) of every robot with a controller.

    ``messages``, of a live run or from a bag, come in the order of their times.
    """
    by_robot: dict[str, dict[str, list[Message]]] = defaultdict(lambda: defaultdict(list))
    origin = None
    for message in messages:
        place = topics.split(message.topic)
        if place is None:
            continue
        origin = message.time if origin is None else origin
        by_robot[place[0]][place[1]].append(message)
    return {
        namespace: _recording(heard, origin or 0)
        for namespace, heard in sorted(by_robot.items())
        if heard[topics.STATE] or heard[topics.METRICS]
    }


def _recording(heard: dict[str, list[Message]], origin: int) -> Recording:
    last = max(messages[-1].time for messages in heard.values() if messages)

    def since(nanoseconds: int) -> float:
        return (nanoseconds - origin) * 1e-9

    def stamped(message: Message) -> float:
        stamp = message.content.header.stamp
        nanoseconds = stamp.sec * 1_000_000_000 + stamp.nanosec
        near = abs(nanoseconds - message.time) < _SAME_CLOCK
        return since(nanoseconds if near else message.time)

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
    labels = heard[f'{topics.METRICS}/position']
    named = tuple(one.label for one in labels[-1].content.layout.dim) if labels else ()
    names = named or (tuple(joints[-1].content.name) if joints else ())
    return Recording(
        mechanism=overall[-1][1].mechanism if overall else '',
        actuators=names,
        error=pairs(topics.POINTING_ERROR),
        reference=pairs(topics.POINTING_REFERENCE),
        rates=series_of(
            [(since(one.time), one.content.data) for one in heard[topics.COMMANDS]], len(names)
        ),
        efforts=series_of(
            [(stamped(one), _in_order(one.content, names)) for one in joints], len(names)
        ),
        scalars={name: scalar(name) for name in topics.SCALARS},
        states=texts(topics.STATE),
        healths=tuple(Health(time, one.state, one.failures) for time, one in overall),
        phases=texts(topics.PHASE),
        end=since(last),
    )


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
