# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Detection beside a running controller: it listens, probes, relieves strain, and tells.

Like the controller it has no clock of its own. What it wants the drives to do beside the task are
rates in directions that do not move a healthy platform.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import inf

import numpy as np

from fault_tolerance.detection.detector import Detector
from fault_tolerance.detection.isolability import Isolability, isolability
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.probe import CLEARANCE, SAMPLES, Probe, probe_amplitude
from fault_tolerance.detection.relief import Relief
from fault_tolerance.detection.self_stress import SelfStress
from fault_tolerance.detection.sighting import Sighting
from fault_tolerance.kernel import evidence
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

RELIEF_EVERY = 10
"""Readings from one look at the strain to the next."""

RETEST = 5_000_000_000
"""Nanoseconds after a clear in which a probe looks for what was found before."""

LEAST_BREAKAWAYS = 5.0
"""Amplitude of a probe over how far drives stick: what sticks shows as a drive that is stuck."""


class Monitor:
    """Looks for failures that nobody reports.

    Parameters
    ----------
    mechanism : Mechanism
    settings : MonitorSettings, optional
    advance : callable
        `fault_tolerance.kernel.evidence.advance`, or its compiled form.

    Attributes
    ----------
    detector : Detector
    settings : MonitorSettings
    rates : (N,) array or None
        What the drives are to do beside the task until the next readings, in the mechanism's
        units; None: nothing.
    finding : str
        What the last probe found; empty before there was one.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        settings: MonitorSettings | None = None,
        advance: Callable[..., float] = evidence.advance,
    ) -> None:
        self.settings = settings or MonitorSettings()
        given = self.settings
        self.detector = Detector(mechanism, given.command_delay, advance, given.breakaway)
        self._mechanism = mechanism
        self._stress: tuple[StrutRows | None, FailureSet, SelfStress] | None = None
        self._failures = FailureSet()
        self._probe: Probe | None = None
        self._wanted = self._moving = False
        self._relief = Relief(mechanism, self.settings.relief)
        self._periods: deque[float] = deque(maxlen=SAMPLES)
        self._stamp = self._readings = self._probed = self._retest_until = 0
        self._values = np.full(len(mechanism.actuators), np.nan)
        self._isolability: dict[bool, tuple[object, Isolability]] = {}
        self.rates: FloatArray | None = None
        self.finding = ''

    @property
    def internal_force(self) -> float:
        """The largest force of the drives against each other, N; NaN where no efforts show it."""
        return self._relief.internal_force

    @property
    def probing(self) -> bool:
        """Whether a probe is under way, or about to begin."""
        return self.straining or self._wanted

    @property
    def straining(self) -> bool:
        """Whether the next command contains a probe."""
        return self._probe is not None

    @property
    def acts(self) -> bool:
        """Whether what was found last is to be handled as if it had been reported."""
        if self.settings.detect != 'act' or not self.detector.suspicions:
            return False
        return self.detector.suspicions[-1].asks_to_act(self._failures)

    def forget(self) -> None:
        """Drop what has been found: the failures have been cleared. Who acts looks again."""
        if self.settings.detect == 'act' and self.detector.suspicions:
            self._retest_until = self._stamp + RETEST
        self.detector.forget()

    def observe(
        self,
        sighting: Sighting,
        failures: FailureSet,
        pose: FloatArray,
        rows: Callable[[], StrutRows],
        moving: bool,
    ) -> bool:
        """Take one set of readings, after the command that answers them.

        Parameters
        ----------
        sighting : Sighting
        failures : FailureSet
            Those in force.
        pose : (4, 4) array
            Where the platform is believed to be.
        rows : callable
            Returns the rows there.
        moving : bool
            Whether the controller may move.

        Returns
        -------
        bool
            Whether something new has been found.
        """
        if self.detector.is_stale(sighting.stamp):
            return False
        before = len(self.detector.suspicions)
        self._take_time(sighting.stamp)
        self._moving, self._values = moving, sighting.values
        self.detector.observe(sighting, failures, pose, rows)
        changed = failures != self._failures or len(self.detector.suspicions) > before
        if self._probe is not None:
            self._go_on(changed or not moving)
        elif self._is_due(sighting.stamp):
            self._start()
        found = len(self.detector.suspicions) > before
        self._relief.disturbed |= failures != self._failures
        self._failures = failures
        self._readings += 1
        if not moving:
            self.rates = None
        if self._probe is None and (self._readings % RELIEF_EVERY == 0 or changed or found):
            relieved = moving and not (changed or found)
            self.rates = self._relieving(sighting) if relieved else None
        return found

    def request_probe(self) -> str:
        """Let a probe begin with the next readings; return why not, empty if it will."""
        refusal = self.refusal()
        self._wanted = not refusal
        return refusal

    def refusal(self) -> str:
        """Return why nothing can be probed now; empty if it can."""
        detector, mechanism = self.detector, self._mechanism
        if self.settings.detect == 'off':
            return 'detection is off'
        if self._probe is not None:
            return 'a probe is under way'
        if not self._moving:
            return 'the controller does not move the mechanism'
        if detector.is_blind:
            return f'already found: {detector.suspicions[-1]}'
        if not detector.ready:
            return 'the encoders have not been heard for long enough yet'
        stress = self._self_stress()
        if not stress.probing.shape[1]:
            return 'no redundancy is left (r = 0): every motion of the drives moves the platform'
        if not (stress.stiffness_known or self.settings.probe_amplitude):
            return 'the stiffness of the drives is not in the mechanism file, nor probe_amplitude'
        if self._amplitude(stress) < LEAST_BREAKAWAYS * self.settings.breakaway:
            return 'the drives stick farther than a probe may go: see probe_force and breakaway'
        low, high = mechanism.position_limits.T
        room = CLEARANCE * self._amplitude(stress) / mechanism.rate_scale
        near = (self._values - low < room) | (high - self._values < room)
        if near.any():
            names = [mechanism.actuator_names[i] for i in np.flatnonzero(near)]
            return f'too near the end of the stroke: {", ".join(names)}'
        return ''

    def isolability(self, probe: bool) -> Isolability | None:
        """Return what can be told apart now, with a ``probe`` or without; None before it is known.

        Parameters
        ----------
        probe : bool

        Returns
        -------
        Isolability or None
        """
        detector = self.detector
        if detector.rows is None:
            return None
        # Classes change with failures and sensors, not with the place.
        key = detector.known, detector.sensors
        if probe not in self._isolability or self._isolability[probe][0] != key:
            found = isolability(
                detector.rows, detector.known, sensors=detector.sensors, probe=probe,
                least=evidence.CROSS_SHARE,
            )
            self._isolability[probe] = key, found
        return self._isolability[probe][1]

    @property
    def latent_since_probe(self) -> float:
        """Seconds for which latent failures may have been there unseen."""
        return 1e-9 * (self._stamp - self._probed) if self._probed else inf

    def _take_time(self, stamp: int) -> None:
        """Learn how long it is from one reading to the next."""
        gap = 1e-9 * (stamp - self._stamp)
        self._gap = gap
        if 0.0 < gap < 1.0:
            self._periods.append(gap)
        if not self._probed or stamp < self._probed:
            self._probed = stamp
        self._stamp = stamp

    def _is_due(self, stamp: int) -> bool:
        period = self.settings.probe_period
        due = self._wanted or stamp < self._retest_until
        if not due and not 0.0 < 1e9 * period < stamp - self._probed:
            return False
        refusal = self.refusal()
        if not refusal:
            self._retest_until = 0
        if refusal and self._wanted:
            self.finding = refusal
        self._wanted = False
        return not refusal

    def _start(self) -> None:
        stress = self._self_stress()
        period = float(np.median(self._periods))
        self._probe = Probe(stress.probing, self._amplitude(stress), period)
        self.detector.begin_probe()
        self._go_on(False, 0.0)

    def _amplitude(self, stress: SelfStress) -> float:
        if self.settings.probe_amplitude:
            return self.settings.probe_amplitude
        mechanism = self._mechanism
        strokes = mechanism.rate_scale * np.diff(mechanism.position_limits).ravel()
        return probe_amplitude(stress.stiffest, self.settings.probe_force, float(strokes.min()))

    def _go_on(self, disturbed: bool, gap: float | None = None) -> None:
        """Go on with the probe, or end it."""
        assert self._probe is not None
        if disturbed or self._probe.over:
            self._probed = self._stamp
            self.detector.end_probe(self._stamp, None if disturbed else self._probe.directions)
            self.finding = self._outcome(disturbed)
            self._probe, self.rates = None, None
            return
        scale = self._mechanism.rate_scale
        last = np.zeros(len(scale)) if self.rates is None else scale * self.rates
        moved = (self._gap if gap is None else gap) * last
        self.rates = self._probe.rates(moved) / scale

    def _outcome(self, disturbed: bool) -> str:
        """Return what a probe has found, as a sentence."""
        suspicions, forming = self.detector.suspicions, self.detector.forming
        if suspicions or forming:
            return str(forming or suspicions[-1])
        if disturbed:
            return 'ended early: the state has changed'
        found = self.isolability(True)
        assert found is not None
        return f'no latent failure{found.limits}'

    def _relieving(self, sighting: Sighting) -> FloatArray | None:
        """Return rates that lead strain back, if a change has left any."""
        if sighting.efforts is None or not self.detector.sensors.efforts:
            self._relief.internal_force = np.nan
            return None
        noise = float(self.detector.noise[: len(self._values)].max())
        return self._relief.rates(self._self_stress(), sighting.efforts, noise)

    def _self_stress(self) -> SelfStress:
        rows, known = self.detector.rows, self.detector.known
        assert rows is not None
        if self._stress is None or self._stress[0] is not rows or self._stress[1] != known:
            self._stress = rows, known, SelfStress(rows, known)
        return self._stress[2]
