# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Finds failures that nobody reports, from readings and the commands between them.

What it finds follows from stamps, readings, commands and configurations alone, to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fault_tolerance.detection.conviction import conviction, suspicion_of
from fault_tolerance.detection.filter_bank import FilterBank
from fault_tolerance.detection.hypotheses import Hypothesis, Symptom, hypotheses
from fault_tolerance.detection.noise import SMALLEST, SensorNoise
from fault_tolerance.detection.probe import ProbeRecord
from fault_tolerance.detection.renewal import Renewal
from fault_tolerance.detection.responses import Sensors, responses
from fault_tolerance.detection.setpoints import Setpoints
from fault_tolerance.detection.sighting import LONGEST_GAP, REACH, Channels, Sighting, distance
from fault_tolerance.detection.suspicion import Suspicion, failures_assumed, found_in
from fault_tolerance.kernel import evidence
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

PATIENCE = 1_000_000_000
"""Nanoseconds that a suspicion may take to narrow down."""

LATEST, RELEARNT = 50_000_000, 100
"""Nanoseconds by which a command may be slower than the fastest: then nobody knows its effect; and
late ones after which most of what was taken for the fastest is forgotten."""

RESTED = 3_000_000_000
"""Nanoseconds after which a drive that is not seen to move by itself any more is at rest."""

MOTION = 20.0
"""How far a setpoint goes at least, over the noise, for its encoder to show whether it reads."""

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
    renewed : tuple of Suspicion
        The `suspicions` that the last readings would have convicted again.
    known : FailureSet
        The failures in force, and those found.
    probed_at_rest : bool
        Whether the task did not move the mechanism during the last probe.
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
        self._explained = np.zeros(self._channels.count)
        self._noise = SensorNoise(len(self._explained), SMALLEST * mechanism.characteristic_length)
        self._stamp: int | None = None
        self._sent, self._since_refresh, self._least_age = 0, 0, LONGEST_GAP
        self._modelled: tuple[FailureSet, tuple[Suspicion, ...]] = FailureSet(), ()
        self.known, self._place = FailureSet(), np.eye(4)
        self._crossed: int | None = None
        self._record: ProbeRecord | None = None
        self._bank: FilterBank | None = None
        self._renewals: dict[Suspicion, Renewal] = {}
        self.renewed: tuple[Suspicion, ...] = ()
        self.probed_at_rest = False
        self.forming: Suspicion | None = None
        self.rows: StrutRows | None = None

    @property
    def suspicions(self) -> tuple[Suspicion, ...]:
        """What has failed without a report, as it was found; until it has healed, or `forget`."""
        return tuple(self._renewals)

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
    def evidence(self) -> dict[Hypothesis, float]:
        """Logarithm of the odds of every hypothesis against a healthy machine."""
        if self._bank is None:
            return {}
        return dict(zip(self._bank.found.hypotheses, self._bank.scores.tolist(), strict=True))

    def command(self, stamp: int, rates: FloatArray) -> None:
        """Take the rates sent at ``stamp``, ns: ``rates`` (N,) in the mechanism's units."""
        self._setpoints.command(stamp, self._scale * rates)
        self._sent = stamp

    def forget(self, fresh: int = 0) -> tuple[Suspicion, ...]:
        """Drop what has been found, but for what was seen in the last ``fresh`` ns.

        That a drive moves which was reported stuck is dropped with that report.

        Returns
        -------
        tuple of Suspicion
            What stays.
        """
        now, failures = self._stamp or 0, self._modelled[0]
        kept = {
            one: found for one, found in self._renewals.items()
            if now - found.seen < fresh and not one.moves_though_stuck(failures)
        }
        if len(kept) < len(self._renewals):
            self._renewals, self.forming, self.rows = kept, None, None
        return self.suspicions

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
        self.renewed = ()
        readings = self._channels.readings(sighting)
        age = self._sent - stamp if self._sent else self._least_age
        late = age - self._least_age > LATEST
        # A stamp ahead of its time makes all that follow late: that must not last.
        self._least_age = min(self._least_age + late * (age - self._least_age) // RELEARNT, age)
        last = stamp if self._stamp is None else self._stamp
        if late or not 0 <= stamp - last <= LONGEST_GAP:
            self._restart(readings)
            for renewal in self._renewals.values():
                renewal.start(readings, self._noise.deviation)
            last = stamp
        self._since_refresh += 1
        if self.rows is None or (failures, self.suspicions) != self._modelled:
            self._refresh(rows(), failures, pose)
            self._restart(readings)
        elif self._since_refresh >= REFRESH:
            self._since_refresh = 0
            if distance(self._place, pose, self._mechanism.characteristic_length) > REACH:
                self._refresh(rows(), failures, pose)
        moved = self._setpoints.moved(last, stamp)
        assert self._bank is not None
        expected = self._bank.found.matrices[0] @ moved
        self._explained += expected
        if self._record is not None:
            self._record.add(readings, moved, expected)
        heard = self._noise.ready
        if self._noise.take(readings, self._explained):
            self._explained[:] = 0.0
        self._stamp = stamp
        if heard:
            self._weigh(readings, moved, stamp)
        else:
            self._start(readings)

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
        bank = self._bank
        if record is not None and bank is not None and strain is not None and not self.is_blind:
            odds = record.odds(bank.found, strain, self._noise.deviation)
            self.probed_at_rest = record.reach(strain) < MOTION * self._noise.deviation.max()
            bank.scores[:] = np.maximum(bank.scores + odds - odds[0], 0.0)
            # A probe goes farther than drives may stick.
            self._decide(bank, stamp, 0.0)

    def _weigh(self, readings: FloatArray, moved: FloatArray, stamp: int) -> None:
        """Take the readings into the filters, and decide."""
        taken = self.advance, self._noise.deviation, moved, readings, stamp
        self.renewed = tuple(
            one for one, renewal in self._renewals.items() if renewal.take(*taken)
        )
        for one, renewal in list(self._renewals.items()):
            if one.verdict.symptom is Symptom.RUNAWAY and stamp - renewal.seen > RESTED:
                del self._renewals[one]
        if not self.is_blind:
            assert self._bank is not None
            self._bank.take(*taken)
            self._decide(self._bank, stamp, self._breakaway)

    def _decide(self, bank: FilterBank, stamp: int, breakaway: float) -> None:
        """Suspect what the evidence has convicted; suspect no more what has healed."""
        found = conviction(bank, bank.convincing(breakaway), self._noise.deviation)
        if found is None:
            self._crossed, self.forming = None, None
            return
        self._crossed = stamp if self._crossed is None else self._crossed
        settled = found.settled or stamp - self._crossed > PATIENCE
        best = bank.found.hypotheses[found.place]
        if best.symptom is Symptom.HEALED:
            if settled:
                # Named as `found_in` does it: the verdict may be about another name.
                self._renewals = {one: renewal for one, renewal in self._renewals.items()
                                  if one.candidates[0].name != best.name}
            return
        assert self.rows is not None
        suspicion = suspicion_of(bank, found, self.rows, self.known, self.sensors)
        if not (settled or suspicion.agreed):
            self.forming = suspicion
            return
        self._renewals[suspicion] = Renewal(suspicion, bank, stamp, self._breakaway)
        self.forming = None

    def _refresh(self, rows: StrutRows, failures: FailureSet, pose: FloatArray) -> None:
        """Derive the responses anew."""
        self.rows, self._place, self._since_refresh = rows, pose.copy(), 0
        self._modelled = failures, self.suspicions
        self.known = failures_assumed(self._mechanism, failures, self.suspicions)
        present = found_in(self.suspicions)
        commanded = [one for one in present if one.name not in failures.parts]
        suspects = hypotheses(self._mechanism, self.known, tuple(Symptom), commanded)
        found = responses(rows, failures, suspects, Sensors(True, True), present)
        if self._bank is None or suspects != self._bank.found.hypotheses:
            self._bank = FilterBank(self._mechanism, found, self._breakaway)
        self._bank.go_on_with(found)
        for renewal in self._renewals.values():
            renewal.refresh(rows, failures, self.suspicions)

    def _restart(self, readings: FloatArray) -> None:
        """Begin at these readings: what was before does not count."""
        self._start(readings)
        self._explained[:] = 0.0
        self._noise.restart()
        self.forming = None

    def _start(self, readings: FloatArray) -> None:
        """Let the filters begin at these readings, with no evidence for anything."""
        if self._bank is not None:
            self._bank.start(readings, self._noise.deviation)
        self._crossed = None
