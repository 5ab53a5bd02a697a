# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Finds failures that nobody reports, from readings and the commands between them.

What it finds follows from stamps, readings, commands and configurations alone, to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from math import log

import numpy as np

from fault_tolerance.detection.excursions import Excursions
from fault_tolerance.detection.hypotheses import Hypothesis, Symptom, hypotheses
from fault_tolerance.detection.noise import SMALLEST, SensorNoise
from fault_tolerance.detection.probe import ProbeRecord
from fault_tolerance.detection.responses import Sensors, responses
from fault_tolerance.detection.separation import separated, separators
from fault_tolerance.detection.setpoints import Setpoints
from fault_tolerance.detection.sighting import LONGEST_GAP, REACH, Channels, Sighting, distance
from fault_tolerance.detection.suspicion import Suspicion, failures_assumed, parts_of, with_limp
from fault_tolerance.kernel import evidence
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism

CYCLES = 3e9
"""Readings without a false alarm, on average: a year at 100 a second."""

LEAD = 7.0
"""Logarithm of the odds by which a hypothesis must lead over all that it can be told from."""

PATIENCE = 1_000_000_000
"""Nanoseconds that a suspicion may take to narrow down."""

LATEST = 50_000_000
"""Nanoseconds by which a command may be slower than the fastest: then nobody knows its effect."""

REFRESH = 50
"""Readings between two looks at whether the mechanism has moved away."""


class Detector:
    """Compares what the sensors show with what each hypothesis would have them show.

    Parameters
    ----------
    mechanism : Mechanism
    delay : float
        Seconds from a command to its effect in the readings.
    advance : callable
        `fault_tolerance.kernel.evidence.advance`, or its compiled form.
    breakaway : float
        Metres by which healthy drives may lag before they slip (stick-slip).

    Attributes
    ----------
    advance : callable
        What advances the filters; may be exchanged for another form at any time.
    suspicions : tuple of Suspicion
        What has failed without a report, as it was found; until `forget`.
    forming : Suspicion or None
        What more readings may yet narrow down.
    rows : StrutRows or None
        Of the configuration that counts; None before there was any.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        delay: float = 0.0,
        advance: Callable[..., float] = evidence.advance,
        breakaway: float = 0.0,
    ) -> None:
        self._mechanism, self.advance, self._breakaway = mechanism, advance, breakaway
        self._scale = mechanism.rate_scale
        self._setpoints = Setpoints(len(self._scale), round(1e9 * delay))
        self._channels = Channels(mechanism)
        count = self._channels.count
        self._noise = SensorNoise(count, SMALLEST * mechanism.characteristic_length)
        self._explained = np.zeros(count)
        self._before, self._last = np.zeros(len(self._scale)), np.zeros(count)
        self._stamp: int | None = None
        self._sent, self._least_age = 0, LONGEST_GAP
        self._known = FailureSet()
        self._place = np.eye(4)
        self._since_refresh = 0
        self._crossed: int | None = None
        self._record: ProbeRecord | None = None
        self._apart: BoolArray | None = None
        self._scores = np.zeros(0)
        self._start_filters((), np.zeros(count))
        self.suspicions: tuple[Suspicion, ...] = ()
        self.forming: Suspicion | None = None
        self.rows: StrutRows | None = None

    @property
    def ready(self) -> bool:
        """Whether failures would be noticed now: the encoders have proved themselves."""
        return self._noise.ready and self.rows is not None

    @property
    def sensors(self) -> Sensors:
        """Which sensors beside the encoders have proved themselves."""
        return self._channels.proved(self._noise.deviation)

    @property
    def noise(self) -> FloatArray:
        """Standard deviations (c,) of the channels, metres; 0 where one has not proved itself."""
        return self._noise.deviation

    @property
    def known(self) -> FailureSet:
        """The failures in force, and those found."""
        return self._known

    @property
    def evidence(self) -> dict[Hypothesis, float]:
        """Logarithm of the odds of every hypothesis against a healthy machine."""
        return dict(zip(self._suspects, self._scores.tolist(), strict=True))

    def command(self, stamp: int, rates: FloatArray) -> None:
        """Take the rates sent at ``stamp``, ns: ``rates`` (N,) in the mechanism's units."""
        self._setpoints.command(stamp, self._scale * rates)
        self._sent = stamp

    def forget(self) -> None:
        """Drop what has been found: the failures have been cleared."""
        self.suspicions, self.forming, self.rows = (), None, None

    def observe(
        self,
        sighting: Sighting,
        failures: FailureSet,
        pose: FloatArray,
        rows: Callable[[], StrutRows],
    ) -> None:
        """Take one set of readings; those that come again, or too late, count for nothing.

        Parameters
        ----------
        sighting : Sighting
        failures : FailureSet
            Those in force.
        pose : (4, 4) array
            Where the platform is believed to be.
        rows : callable
            Returns the rows there; called when the responses have to be derived anew.
        """
        stamp = sighting.stamp
        if self.is_stale(stamp):
            return
        readings = self._channels.readings(sighting)
        age = self._sent - stamp if self._sent else self._least_age
        self._least_age = min(self._least_age, age)
        last = stamp if self._stamp is None else self._stamp
        if not 0 <= stamp - last <= LONGEST_GAP or age - self._least_age > LATEST:
            self._restart(readings)
            last = stamp
        self._since_refresh += 1
        known = failures_assumed(self._mechanism, failures, self.suspicions)
        if self.rows is None or (known is not self._known and known != self._known):
            self._refresh(rows(), known, pose)
            self._restart(readings)
        elif self._since_refresh >= REFRESH:
            self._since_refresh = 0
            if distance(self._place, pose, self._mechanism.characteristic_length) > REACH:
                self._refresh(rows(), known, pose)
        moved = self._setpoints.moved(last, stamp)
        expected = self._healthy @ moved
        self._explained += expected
        if self._record is not None:
            self._record.add(readings, moved, expected)
        heard = self._noise.ready
        if self._noise.take(readings, self._explained):
            self._explained[:] = 0.0
            self._apart = None
        if not heard:
            self._start_filters(self._suspects, readings)
        elif not self.is_blind:
            if self._breakaway > 0.0:
                strange = (readings - self._last - expected)[: len(moved)]
                self._excursions.slip(strange, self._breakaway)
            self._weigh(readings, moved, stamp)
        self._stamp, self._before, self._last = stamp, moved, readings

    def is_stale(self, stamp: int) -> bool:
        """Return whether readings of ``stamp`` (ns) come again, or after later ones."""
        return self._stamp is not None and 0 <= self._stamp - stamp <= LONGEST_GAP

    @property
    def is_blind(self) -> bool:
        """Whether something has been found that leaves no model to go on with."""
        return any(
            one.verdict.symptom.mode is None or not one.located for one in self.suspicions
        )

    def begin_probe(self) -> None:
        """Record from the next readings on, until `end_probe`."""
        self._record = ProbeRecord()

    def end_probe(self, stamp: int, strain: FloatArray | None) -> None:
        """Take what a probe along ``strain`` (N, r; None: it ended early) shows, ``stamp`` ns."""
        record, self._record = self._record, None
        if record is not None and strain is not None and not self.is_blind:
            odds = record.odds(self._responses, strain, self._noise.deviation)
            self._scores = np.maximum(self._scores + odds - odds[0], 0.0)
            # A probe goes farther than drives may stick.
            self._decide(stamp, 0.0)

    def _weigh(self, readings: FloatArray, moved: FloatArray, stamp: int) -> None:
        """Take the readings into the filters, and decide."""
        self.advance(
            self._responses.matrices, self._responses.drift, self._jumps, self._responses.load,
            self._noise.deviation, moved, self._before, readings,
            self._levels, self._variance, self._paces, self._scores,
        )
        self._excursions.take(self._scores, stamp, moved)
        self._decide(stamp, self._breakaway)

    def _decide(self, stamp: int, breakaway: float) -> None:
        """Suspect what the evidence has convicted."""
        scores = self._scores
        if breakaway > 0.0:
            scores = np.where(self._excursions.beyond(breakaway), scores, 0.0)
        best = int(scores.argmax())
        if scores[best] <= self._threshold:
            self._crossed, self.forming = None, None
            return
        self._crossed = stamp if self._crossed is None else self._crossed
        rivals = scores > scores[best] - LEAD
        # What stands still is stuck, and no drive that runs away at no speed.
        plain = rivals & ~self._runs_away
        if plain.any():
            best, rivals = int(np.where(plain, scores, -1.0).argmax()), plain
        apart = self._separated()[best]
        settled = not apart[rivals].any()
        suspicion = self._suspicion(best, rivals, apart)
        if not (settled or suspicion.agreed or stamp - self._crossed > PATIENCE):
            self.forming = suspicion
            return
        self.suspicions, self.forming = (*self.suspicions, suspicion), None

    def _suspicion(self, best: int, rivals: BoolArray, apart: BoolArray) -> Suspicion:
        """Return what the evidence amounts to, with all that would look the same."""
        chosen = rivals | (~apart if not self._responses.drift[best].any() else False)
        order = [best, *(i for i in np.flatnonzero(chosen).tolist() if i not in (best, 0))]
        candidates = with_limp([self._suspects[i] for i in order], self._suspects)
        assert self.rows is not None
        return Suspicion(
            candidates, float(self._scores[best]), int(self._excursions.onset[best]),
            float(self._excursions.travel[best]), parts_of(self._mechanism, candidates),
            separators(self.rows, self._known, candidates, self.sensors, evidence.CROSS_SHARE),
        )

    def _refresh(self, rows: StrutRows, known: FailureSet, pose: FloatArray) -> None:
        """Derive the responses anew."""
        self.rows, self._place, self._since_refresh = rows, pose.copy(), 0
        suspects = hypotheses(self._mechanism, known, tuple(Symptom))
        self._known = known
        self._responses = responses(rows, known, suspects, Sensors(True, True))
        if suspects != self._suspects:
            self._start_filters(suspects, np.zeros(self._channels.count))
        self._healthy = self._responses.matrices[0]
        self._jumps = self._channels.jumps(self._responses)
        self._apart = None

    def _separated(self) -> BoolArray:
        """Return which hypotheses differ by more than the model may be wrong by."""
        if self._apart is None:
            heard = self._noise.deviation > 0.0
            self._apart = separated(self._responses, heard, evidence.CROSS_SHARE)
        return self._apart

    def _start_filters(self, suspects: tuple[Hypothesis, ...], readings: FloatArray) -> None:
        """Make filters for ``suspects`` that begin at ``readings``."""
        count = len(suspects)
        self._suspects = suspects
        self._runs_away = np.array([one.symptom is Symptom.RUNAWAY for one in suspects], bool)
        self._levels = np.tile(readings, (count, 1))
        self._variance = self._noise.deviation**2
        self._paces, self._scores = np.zeros((2, count))
        self._excursions = Excursions(self._mechanism, suspects)
        self._threshold = log(max(count, 1) * CYCLES)
        self._crossed = None

    def _restart(self, readings: FloatArray) -> None:
        """Begin at these readings, with no evidence for anything."""
        self._start_filters(self._suspects, readings)
        self._explained[:], self._before, self._last = 0.0, 0.0 * self._before, readings
        self._noise.restart()
        self.forming = None
