# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A recording as time series: messages of one robot's controller, simulator and operator."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from fault_tolerance.analysis import topics
from fault_tolerance.analysis.recorded_verdicts import (
    FAILURE_MODE,
    Health,
    healths_of,
    mechanism_in,
    scalar_in,
    values_of,
)
from fault_tolerance.analysis.series import Series, series_of
from fault_tolerance.mechanism.description import Mechanism

SUSPECTED_MODE = 'suspected_mode'
"""The key of what detection only tells."""

# Nanoseconds; stamps further from the time of receipt are of another clock.
_SAME_CLOCK = 5_000_000_000
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


def recordings_of(
    messages: Iterable[Message], mechanism: Mechanism | None = None
) -> dict[str, Recording]:
    """Return the recordings by namespace (empty for the root) of every robot with a controller.

    ``messages``, of a live run or from a bag, come in the order of their times. Without metrics
    the names of the actuators are those of a ``mechanism``, if it is given.
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
    signs = (topics.STATE, topics.STATUS, topics.METRICS, topics.JOINT_COMMANDS)
    found = {}
    for namespace, heard in sorted(by_robot.items()):
        if any(heard[one] for one in signs):
            # The drives of several robots may share one topic of joint states.
            heard[topics.JOINT_STATES] = heard[topics.JOINT_STATES] or by_robot['']['joint_states']
            found[namespace] = _recording(heard, diagnostics, namespace, origin or 0, mechanism)
    return found


def _recording(
    heard: dict[str, list[Message]], diagnostics: list[Message], namespace: str, origin: int,
    mechanism: Mechanism | None,
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
        if values:
            return series_of([(since(one.time), (one.content.data,)) for one in values], 1)
        told = [(since(one.time), scalar_in(one.content, name)) for one in heard[topics.METRICS]]
        return series_of([(time, (value,)) for time, value in told if value is not None], 1)

    def texts(topic: str) -> tuple[Text, ...]:
        return tuple(Text(since(one.time), one.content.data) for one in heard[topic])

    joints, told = heard[topics.JOINT_STATES], _hardware_id(heard)
    prefix, _, name = told.rpartition('/')
    names, measured = _names(heard, mechanism)
    space = prefix if told else namespace.strip('/')
    return Recording(
        mechanism=name,
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
            [(stamped(one), _in_order(one.content, measured)) for one in joints], len(names)
        ),
        scalars={name: scalar(name) for name in topics.SCALARS},
        states=texts(topics.STATE),
        healths=healths_of(heard, diagnostics, space, since),
        phases=texts(topics.PHASE),
        found=_found(diagnostics, space, origin),
        end=since(last),
        origin=origin,
    )


def _hardware_id(heard: dict[str, list[Message]]) -> str:
    """Return prefix and name of the mechanism, as far as the controller has told them."""
    statuses = [mechanism_in(one.content) for one in heard[topics.METRICS]]
    statuses += [one.content for one in heard[topics.STATUS]]
    known = [one for one in statuses if one is not None]
    return str(known[-1].hardware_id) if known else ''


def _names(
    heard: dict[str, list[Message]], mechanism: Mechanism | None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the actuators in the order of commands, and those in joint states."""
    if mechanism is not None:
        return mechanism.actuator_names, mechanism.joint_state_names
    told = heard[topics.JOINT_COMMANDS]
    joints = tuple(told[-1].content.name) if told else ()
    labels = heard[f'{topics.METRICS}/{topics.ARRAYS["position"]}']
    names = tuple(topics.labels_in(labels[-1].content)) if labels else joints
    if not names:
        rates, states = heard[topics.COMMANDS], heard[topics.JOINT_STATES]
        joints = tuple(states[-1].content.name) if states else ()
        # The order of joint states need not be that of commands: names would be a guess.
        count = len(rates[-1].content.data) if rates else 0
        names = tuple(f'drive {n + 1}' for n in range(count)) or joints
    return names, joints if len(joints) == len(names) else names


def _stamp(message: Message) -> int:
    """Return the stamp (ns) of a ``message``, or when it came if its stamp is of another clock."""
    stamp = message.content.header.stamp
    nanoseconds = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    return nanoseconds if abs(nanoseconds - message.time) < _SAME_CLOCK else message.time


def _found(diagnostics: Iterable[Message], prefix: str, origin: int) -> tuple[Found, ...]:
    """Return what detection said in all ``diagnostics`` about the robot with this ``prefix``."""
    found = []
    for message in diagnostics:
        time = (_stamp(message) - origin) * 1e-9
        for status in message.content.status:
            space, _, name = status.hardware_id.rpartition('/')
            if status.name != DETECTION_STATUS or space != prefix:
                continue
            values = values_of(status)
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
    """Return the efforts in the order of ``names``; none where one of them has none."""
    efforts = list(joint_state.effort)
    found = list(joint_state.name)
    if len(efforts) != len(found) or not set(names) <= set(found):
        return []
    return [efforts[found.index(name)] for name in names]
