# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What a controller has heard and commanded, out of a recording, as plain values.

Times are of receipt by the recorder, stamps those of the messages; both in nanoseconds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from fault_tolerance.analysis import topics
from fault_tolerance.analysis.bags import read_topics, topics_in
from fault_tolerance.analysis.recorded_data import Message
from fault_tolerance.analysis.recorded_verdicts import verdict_in
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.measured_pose import pose_of

_MODE_KEY = 'failure_mode'
_POSE = 'geometry_msgs/msg/PoseStamped'


class RecordedReading(NamedTuple):
    """A joint state; ``stamp`` is 0 where it has none."""

    time: int
    stamp: int
    names: tuple[str, ...]
    positions: tuple[float, ...]
    efforts: tuple[float, ...]


class RecordedCommand(NamedTuple):
    """Rates as they were sent, in the units and signs of joint states.

    Without ``names`` they are in the mechanism's order. ``probe`` says that they contain a probe,
    ``answered`` which positions they answer; empty where they answer none, or do not say.
    """

    time: int
    stamp: int
    names: tuple[str, ...]
    rates: tuple[float, ...]
    probe: bool = False
    answered: tuple[float, ...] = ()


class RecordedModes(NamedTuple):
    """The failure modes in one message of diagnostics: name, hardware id, level, mode of each."""

    time: int
    stamp: int
    modes: tuple[tuple[str, str, int, str], ...]


class RecordedPose(NamedTuple):
    """The pose (4, 4) of the platform by a sensor."""

    time: int
    pose: FloatArray


class Told(NamedTuple):
    """What the metrics said: the failures in force, and what was suspected without a report."""

    time: int
    failures: tuple[str, ...]
    suspected: str


@dataclass
class RecordedInputs:
    """All of one robot, in the order of the recording.

    ``namespace`` is empty, or has a leading slash. ``mechanism`` is empty if there were no
    metrics. ``named`` says whether the commands are joint commands, with stamps and names.
    """

    namespace: str
    mechanism: str = ''
    named: bool = False
    readings: list[RecordedReading] = field(default_factory=list)
    commands: list[RecordedCommand] = field(default_factory=list)
    reports: list[RecordedModes] = field(default_factory=list)
    poses: list[RecordedPose] = field(default_factory=list)
    told: list[Told] = field(default_factory=list)
    states: list[tuple[int, str]] = field(default_factory=list)


def recorded_inputs(
    bag: Path, namespace: str | None = None, pose_topic: str = ''
) -> RecordedInputs:
    """Return what the controller in ``namespace`` has heard and commanded, from a ``bag``.

    Without a namespace, that of the only robot. ``pose_topic``, full or relative to the
    namespace, is that of a pose sensor. FaultToleranceError if the bag cannot be read, or has no
    joint states or commands of such a robot.
    """
    kinds = topics_in(bag)
    space = _namespace(kinds, namespace)
    pose = pose_topic if pose_topic.startswith('/') else f'{space}/{pose_topic}'
    if pose_topic and kinds.get(pose) != _POSE:
        raise FaultToleranceError(f'{bag}: no poses (PoseStamped) on {pose}')
    named = kinds.get(f'{space}/{topics.JOINT_COMMANDS}') == topics.RECORDED[topics.JOINT_COMMANDS]
    commands = topics.JOINT_COMMANDS if named else topics.COMMANDS
    wanted = {
        f'{space}/{name}': name
        for name in (topics.JOINT_STATES, commands, topics.METRICS, topics.STATE)
    }
    wanted |= {topics.DIAGNOSTICS: topics.DIAGNOSTICS}
    wanted = {
        topic: name for topic, name in wanted.items() if kinds.get(topic) == topics.RECORDED[name]
    }
    if pose_topic:
        wanted[pose] = _POSE
    inputs = _sorted_out(read_topics(bag, wanted), wanted, RecordedInputs(space, named=named))
    for found, what in ((inputs.readings, 'joint states'), (inputs.commands, 'commands')):
        if not found:
            topic = f'{space}/{topics.JOINT_STATES if found is inputs.readings else commands}'
            raise FaultToleranceError(f'{bag}: no {what} in it (on {topic})')
    return inputs


def _namespace(kinds: Mapping[str, str], namespace: str | None) -> str:
    """Return the namespace to read, of those that have joint states."""
    kind, ending = topics.RECORDED[topics.JOINT_STATES], f'/{topics.JOINT_STATES}'
    spaces = sorted(
        topic.removesuffix(ending) for topic, found in kinds.items()
        if topic.endswith(ending) and found == kind
    )
    if not spaces:
        raise FaultToleranceError('no joint states (a topic joint_states) in it')
    listed = ', '.join(space or '/' for space in spaces)
    if namespace is not None:
        wanted = namespace.strip('/')
        space = f'/{wanted}' if wanted else ''
        if space not in spaces:
            raise FaultToleranceError(f'no joint states in /{wanted}; there are some in: {listed}')
        return space
    commanded = [
        space for space in spaces
        if {f'{space}/{topics.JOINT_COMMANDS}', f'{space}/{topics.COMMANDS}'} & set(kinds)
    ]
    chosen = commanded or spaces
    if len(chosen) > 1:
        raise FaultToleranceError(f'more than one robot: choose a namespace of {listed}')
    return chosen[0]


def _sorted_out(
    messages: Iterable[Message], wanted: Mapping[str, str], inputs: RecordedInputs
) -> RecordedInputs:
    """Fill ``inputs`` with what is ``wanted``, by full topic."""
    for topic, time, content in messages:
        name = wanted[topic]
        if name == topics.JOINT_STATES:
            inputs.readings.append(RecordedReading(
                time, _stamp(content), tuple(content.name), _numbers(content.position),
                _numbers(content.effort),
            ))
        elif name == topics.JOINT_COMMANDS:
            inputs.commands.append(RecordedCommand(
                time, _stamp(content), tuple(content.name), _numbers(content.velocity),
                content.header.frame_id == topics.PROBE, _numbers(content.position),
            ))
        elif name == topics.COMMANDS:
            inputs.commands.append(RecordedCommand(time, time, (), _numbers(content.data)))
        elif name == topics.STATE:
            inputs.states.append((time, str(content.data)))
        elif name == topics.DIAGNOSTICS:
            modes = tuple(_modes(content))
            if modes:
                inputs.reports.append(RecordedModes(time, _stamp(content), modes))
        elif name == topics.METRICS:
            _take_metrics(inputs, time, content)
        else:
            _take_pose(inputs, time, content)
    return inputs


def _take_metrics(inputs: RecordedInputs, time: int, content: Any) -> None:
    found = verdict_in(content)
    if found is not None:
        inputs.mechanism = found.mechanism
        inputs.told.append(Told(time, found.failures, found.suspected))


def _take_pose(inputs: RecordedInputs, time: int, content: Any) -> None:
    place, turn = content.pose.position, content.pose.orientation
    try:
        pose = pose_of((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))
    except ValueError:
        return
    inputs.poses.append(RecordedPose(time, pose))


def _modes(content: Any) -> Iterable[tuple[str, str, int, str]]:
    for status in content.status:
        for pair in status.values:
            if pair.key == _MODE_KEY:
                yield status.name, status.hardware_id, int(status.level), pair.value


def _stamp(content: Any) -> int:
    stamp = content.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _numbers(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(map(float, values))
