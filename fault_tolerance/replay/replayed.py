# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller's estimate and its detection, once more, on what a recording holds."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import log
from typing import NamedTuple

import numpy as np

from fault_tolerance.analysis.recorded_inputs import (
    RecordedCommand,
    RecordedInputs,
    RecordedReading,
)
from fault_tolerance.closed_loop import detected
from fault_tolerance.control.failure_reports import Report
from fault_tolerance.control.joint_states import JointStateReader
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.detection.detector import Detector
from fault_tolerance.detection.filter_bank import CYCLES
from fault_tolerance.detection.monitor_settings import Detect
from fault_tolerance.detection.probe import SAMPLES
from fault_tolerance.detection.self_stress import SelfStress
from fault_tolerance.detection.sighting import Sighting
from fault_tolerance.detection.suspicion import Suspicion
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.replay.told_failures import reports_in, reports_told
from fault_tolerance.replay.turns import Moments, Turn, turns_of


class Instant(NamedTuple):
    """What detection held after one set of readings."""

    stamp: int
    odds: dict[str, float]
    threshold: float
    failures: tuple[str, ...]


class Finding(NamedTuple):
    """A suspicion, and how it was found."""

    suspicion: Suspicion
    stamp: int
    """Of the readings with which it was found, nanoseconds."""
    acted: bool
    """Whether it was handled as if it had been reported."""


@dataclass(frozen=True, eq=False)
class Replayed:
    """What detection has found in a recording.

    ``forming`` is what more readings might have narrowed down, ``course`` what was held after each
    set of readings, ``probes`` how many were complete, and ``remarks`` are what makes the result
    another than the live one.
    """

    findings: tuple[Finding, ...]
    forming: Suspicion | None
    course: tuple[Instant, ...]
    probes: int
    remarks: tuple[str, ...]


def replayed(
    inputs: RecordedInputs, mechanism: Mechanism, detect: Detect = 'advise', delay: float = 0.0
) -> Replayed:
    """Return what detection finds in ``inputs`` of ``mechanism``.

    Parameters
    ----------
    inputs : RecordedInputs
    mechanism : Mechanism
    detect : {'advise', 'act'}
        Whether what is found is handled as if it had been reported.
    delay : float
        Seconds from a command to its effect: the controller's parameter ``command_delay``.

    Returns
    -------
    Replayed
    """
    turns, remarks = turns_of(inputs, mechanism)
    replay = Replay(mechanism, detect, delay)
    moments = Moments(turns)
    events: dict[int, list[Callable[[int], None]]] = defaultdict(list)
    places = set()
    for report in inputs.reports:
        reports = reports_in(report, inputs.namespace, mechanism)
        if reports:
            place = moments.of_report(report)
            places.add(place)
            events[place].append(partial(replay.reports, reports))
    first = inputs.told[0] if inputs.told else None
    if first is not None and first.failures:
        told = reports_told(first, inputs.reports, mechanism)
        events[0].insert(0, partial(replay.reports, told))
    for before, told_now in zip(inputs.told, inputs.told[1:], strict=False):
        released = set(before.failures) - set(told_now.failures)
        dropped = set(before.suspected.split('; ')) - set(told_now.suspected.split('; '))
        if released or dropped - {''}:
            clear = partial(replay.clear, told_now.suspected, bool(released))
            events[moments.of_clear(before, told_now, places)].append(clear)
    for pose in inputs.poses:
        events[moments.after(pose.time)].append(partial(replay.pose, pose.pose))
    for place, (turn, probing) in enumerate(zip(turns, _probing_next(turns), strict=True)):
        for event in events[place]:
            event(turn.now)
        replay.turn(turn.now, turn.command, turn.reading, probing)
    if replay.cleared:
        remarks.append('when failures were cleared is taken from the metrics')
    if replay.rejected:
        remarks.append(f'{replay.rejected} joint states or commands were of no use')
    return Replayed(
        tuple(replay.findings), replay.detector.forming, tuple(replay.course), replay.probes,
        tuple(dict.fromkeys(remarks)),
    )


class Replay:
    """Takes the turns of a controller of ``mechanism`` once more; `detect` and `delay` as live.

    Attributes
    ----------
    detector : Detector
    findings : list of Finding
    course : list of Instant
    probes : int
        How many probes were complete.
    rejected : int
        How many readings and commands could not be used.
    cleared : bool
        Whether anything has been cleared.
    """

    def __init__(self, mechanism: Mechanism, detect: Detect, delay: float) -> None:
        self._mechanism, self._acting = mechanism, detect == 'act'
        self._supervisor = Supervisor(mechanism)
        self.detector = Detector(mechanism, delay, self._supervisor.kernel.advance)
        self._joints = JointStateReader(mechanism, self._supervisor.settings.joint_state_timeout)
        self._places: dict[tuple[str, ...], list[int] | None] = {}
        self._failures = FailureSet()
        self._pose: FloatArray | None = None
        self._strain: FloatArray | None = None
        self._samples = 0
        self._now = 0
        self.findings: list[Finding] = []
        self.course: list[Instant] = []
        self.probes = self.rejected = 0
        self.cleared = False

    def reports(self, reports: Sequence[Report], now: int) -> None:
        """Take the failure ``reports`` of one message at ``now`` (ns)."""
        if self._supervisor.reports(reports, self._passed(now)):
            self._supervisor.step(self._passed(now))

    def clear(self, suspected: str, released: bool, now: int) -> None:
        """Let go of failures if some were ``released`` at ``now`` (ns), and of suspicions.

        Those not among what was still ``suspected``, if they have not healed already.
        """
        words = [', '.join(map(str, one.candidates)) for one in self.detector.suspicions]
        if released or not set(words) <= set(suspected.split('; ')):
            self.detector.forget(round(1e9 * self._supervisor.settings.report_timeout))
            self.cleared = True
        if released:
            self._supervisor.clear(self._passed(now))

    def pose(self, pose: FloatArray, _: int) -> None:
        """Take a ``pose`` (4, 4) of the platform."""
        self._pose = pose

    def turn(
        self, now: int, command: RecordedCommand | None, reading: RecordedReading | None,
        probing: bool | None,
    ) -> None:
        """Take ``command`` and ``reading`` at ``now`` (ns), in the order of the live controller.

        ``probing`` says whether the next command contains a probe; None: there is no further one.
        """
        taken = reading is not None and self._read(reading, self._passed(now))
        self._supervisor.step(self._passed(now))
        if command is not None:
            rates = self._rates(command)
            if rates is None:
                self.rejected += 1
            else:
                self.detector.command(command.stamp, rates)
        if reading is not None and taken:
            self._observe(reading, probing)

    def _passed(self, now: int) -> float:
        """Return ``now`` in seconds; time does not go back."""
        self._now = max(self._now, now)
        return 1e-9 * self._now

    def _read(self, reading: RecordedReading, now: float) -> bool:
        failed = self._supervisor.failures.parts
        values, _ = self._joints.readings(reading.names, reading.positions, failed, now)
        taken = values is not None and self._supervisor.joint_reading(values, now) is None
        self.rejected += not taken
        return taken

    def _rates(self, command: RecordedCommand) -> FloatArray | None:
        """Return rates in the mechanism's order and units; None if they are of something else."""
        names, rates = command.names, command.rates
        wanted = self._mechanism.joint_state_names
        if names not in self._places:
            known = not names or set(wanted) <= set(names)
            self._places[names] = [names.index(one) for one in wanted if names] if known else None
        places = self._places[names]
        if places is None or len(rates) != (len(names) or len(wanted)):
            return None
        chosen = np.array([rates[place] for place in places] if names else rates, np.float64)
        return self._mechanism.rates_from_readings(chosen) if np.isfinite(chosen).all() else None

    def _observe(self, reading: RecordedReading, probing: bool | None) -> None:
        detector, output = self.detector, self._supervisor.output
        estimate, before = output.estimate, detector.suspicions
        sighting = Sighting(
            reading.stamp, estimate.readings,
            self._joints.efforts(reading.names, reading.efforts), self._pose,
        )
        self._pose = None
        detector.observe(
            sighting, output.failures, estimate.pose, lambda: strut_rows(estimate.configuration)
        )
        changed = output.failures != self._failures or detector.suspicions != before
        self._failures = output.failures
        self._follow_probe(reading.stamp, changed, probing)
        self.course.append(Instant(
            reading.stamp, {str(one): odds for one, odds in detector.evidence.items()},
            log(max(len(detector.evidence), 1) * CYCLES),
            tuple(map(str, output.failures.failures)),
        ))
        new = [one for one in detector.suspicions if one not in before]
        for one in new:
            acts = self._acting and not one.obstacle(output.failures)
            self.findings.append(Finding(one, reading.stamp, acts))
        self._report([*new, *detector.renewed])


    def _follow_probe(self, stamp: int, changed: bool, probing: bool | None) -> None:
        """Begin and end the record of a probe where the live detection did."""
        detector = self.detector
        if self._strain is not None:
            self._samples += 1
            over = self._samples > SAMPLES
            if over and not changed:
                detector.end_probe(stamp, self._strain)
                self.probes += 1
            if over or changed or probing is False:
                self._strain = None
        if self._strain is None and probing and detector.rows is not None:
            self._strain = SelfStress(detector.rows, detector.known).probing
            self._samples = 0
            detector.begin_probe()

    def _report(self, convicted: Sequence[Suspicion]) -> None:
        """Handle what is ``convicted`` as if it had been reported, where that was done live."""
        now, failures = 1e-9 * self._now, self._failures
        reports = [detected(one, now) for one in convicted if not one.obstacle(failures)]
        if self._acting and reports and self._supervisor.reports(reports, now):
            self._supervisor.step(now)


def _probing_next(turns: Sequence[Turn]) -> list[bool | None]:
    """Return for every turn whether the next command contains a probe; None: there is none."""
    found: list[bool | None] = []
    following = None
    for turn in reversed(turns):
        found.append(following)
        following = turn.command.probe if turn.command else following
    return found[::-1]
