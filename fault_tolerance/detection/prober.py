# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Probes one after the other: when one may begin, how it goes on, and what it has found."""

from __future__ import annotations

from collections import deque
from math import inf

import numpy as np

from fault_tolerance.detection.detector import Detector
from fault_tolerance.detection.isolability import Isolability, isolability
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.probe import CLEARANCE, SAMPLES, Probe, probe_amplitude
from fault_tolerance.detection.self_stress import SelfStress
from fault_tolerance.detection.sighting import LONGEST_GAP
from fault_tolerance.kernel import evidence
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

RETEST = 5_000_000_000
"""Nanoseconds after a release in which a probe looks for what was there before."""

AT_REST = 'the controller does not move the mechanism'
"""Why nothing can be probed."""

LEAST_BREAKAWAYS = 5.0
"""Amplitude of a probe over how far drives stick: what sticks shows as a drive that is stuck."""


class Prober:
    """Probes a mechanism beside its task.

    Parameters
    ----------
    mechanism : Mechanism
    settings : MonitorSettings
    detector : Detector
        Judges what the probes show.

    Attributes
    ----------
    settings : MonitorSettings
    rates : (N,) array or None
        What the drives are to do beside the task until the next readings, in the mechanism's
        units; None: nothing.
    finding : str
        What the last probe found; empty before there was one.
    """

    def __init__(
        self, mechanism: Mechanism, settings: MonitorSettings, detector: Detector
    ) -> None:
        self._mechanism, self.settings, self._detector = mechanism, settings, detector
        self._stress: tuple[StrutRows | None, FailureSet, SelfStress] | None = None
        self._probe: Probe | None = None
        self._wanted = self._moving = False
        self._periods: deque[float] = deque(maxlen=SAMPLES)
        self._stamp = self._probed = self._retest_until = 0
        self._values = np.full(len(mechanism.actuators), np.nan)
        self._isolability: dict[tuple[bool, bool], tuple[object, Isolability]] = {}
        self.rates: FloatArray | None = None
        self.finding = ''

    @property
    def probing(self) -> bool:
        """Whether a probe is under way, or about to begin."""
        return self.straining or self._wanted

    @property
    def straining(self) -> bool:
        """Whether the next command contains a probe."""
        return self._probe is not None

    @property
    def latent_since_probe(self) -> float:
        """Seconds for which latent failures may have been there unseen."""
        return 1e-9 * (self._stamp - self._probed) if self._probed else inf

    @property
    def stress(self) -> SelfStress:
        """The self-stress of the mechanism where it is, with what is known to have failed."""
        rows, known = self._detector.rows, self._detector.known
        assert rows is not None
        if self._stress is None or self._stress[0] is not rows or self._stress[1] != known:
            self._stress = rows, known, SelfStress(rows, known)
        return self._stress[2]

    def listen(self, stamp: int, values: FloatArray, moving: bool) -> None:
        """Take ``values`` (N,), from home in the mechanism's units, read at ``stamp`` (ns).

        ``moving`` says whether the controller may move.
        """
        gap = self._gap = 1e-9 * (stamp - self._stamp)
        if 0.0 < gap < 1.0:
            self._periods.append(gap)
        if not self._probed or stamp < self._probed:
            self._probed = stamp
        self._stamp, self._values, self._moving = stamp, values, moving

    def go_on(self, changed: bool) -> None:
        """Go on with a probe, end it if the state has ``changed``, or begin one that is due."""
        if self._probe is not None:
            # Nobody knows how far the drives went meanwhile: they may have been told to rest.
            lost = not 0.0 <= self._gap <= 1e-9 * LONGEST_GAP
            self._continue(changed or lost or not self._moving, self._gap)
        elif self._is_due():
            self._start()

    def interrupt(self) -> None:
        """End a probe, begun or not, between two readings: nothing moves any more."""
        if self._probe is not None:
            self._continue(True, 0.0)
        elif self._wanted:
            self._wanted, self.finding = False, AT_REST

    def request(self) -> str:
        """Let a probe begin with the next readings; return why not, empty if it will."""
        refusal = self._refusal()
        self._wanted = not refusal
        return refusal

    def _refusal(self) -> str:
        """Return why nothing can be probed now; empty if it can."""
        detector, mechanism = self._detector, self._mechanism
        if self.settings.detect == 'off':
            return 'detection is off'
        if self._probe is not None:
            return 'a probe is under way'
        if not self._moving:
            return AT_REST
        if detector.is_blind:
            return f'already found: {detector.suspicions[-1]}'
        if not detector.ready:
            return 'the encoders have not been heard for long enough yet'
        stress = self.stress
        if not stress.probing.shape[1]:
            return 'no redundancy is left (r = 0): every motion of the drives moves the platform'
        if not (stress.stiffness_known or self.settings.probe_amplitude):
            return 'the stiffness of the drives is not in the mechanism file, nor probe_amplitude'
        amplitude = self._amplitude(stress)
        if not amplitude:
            return 'probe_force is 0: no drive would be pushed'
        if amplitude < LEAST_BREAKAWAYS * self.settings.breakaway:
            return 'the drives stick farther than a probe may go: see probe_force and breakaway'
        low, high = mechanism.position_limits.T
        room = CLEARANCE * amplitude / mechanism.rate_scale
        near = (self._values - low < room) | (high - self._values < room)
        if near.any():
            names = [mechanism.actuator_names[i] for i in np.flatnonzero(near)]
            return f'too near the end of the stroke: {", ".join(names)}'
        return ''

    def isolability(self, probe: bool, at_rest: bool = False) -> Isolability | None:
        """Return what can be told apart now; None before it is known.

        By a ``probe``, too; ``at_rest`` by it alone, as the task does not move the mechanism.
        """
        detector, way = self._detector, (probe, at_rest)
        if detector.rows is None:
            return None
        # Classes change with failures and sensors, not with the place.
        key = detector.known, detector.sensors
        if way not in self._isolability or self._isolability[way][0] != key:
            found = isolability(
                detector.rows, detector.known, sensors=detector.sensors, probe=probe,
                at_rest=at_rest, least=evidence.CROSS_SHARE,
            )
            self._isolability[way] = key, found
        return self._isolability[way][1]

    def look_again(self) -> None:
        """Let a probe look for what has been released: who acts must know whether it is mended."""
        if self.settings.detect == 'act':
            self._retest_until = self._stamp + RETEST

    def _is_due(self) -> bool:
        period = self.settings.probe_period
        due = self._wanted or self._stamp < self._retest_until
        if not due and not 0.0 < 1e9 * period < self._stamp - self._probed:
            return False
        refusal = self._refusal()
        if not refusal:
            self._retest_until = 0
        if refusal and self._wanted:
            self.finding = refusal
        self._wanted = False
        return not refusal

    def _start(self) -> None:
        stress = self.stress
        period = float(np.median(self._periods))
        self._probe = Probe(stress.probing, self._amplitude(stress), period)
        self._detector.begin_probe()
        self._continue(False, 0.0)

    def _amplitude(self, stress: SelfStress) -> float:
        if self.settings.probe_amplitude:
            return self.settings.probe_amplitude
        mechanism = self._mechanism
        strokes = mechanism.rate_scale * np.diff(mechanism.position_limits).ravel()
        return probe_amplitude(stress.stiffest, self.settings.probe_force, float(strokes.min()))

    def _continue(self, disturbed: bool, gap: float) -> None:
        """Go on with the probe, ``gap`` seconds after the last readings, or end it."""
        assert self._probe is not None
        if disturbed or self._probe.over:
            directions = None if disturbed else self._probe.directions
            self._probe, self.rates, self._probed = None, None, self._stamp
            self._detector.end_probe(self._stamp, directions)
            self.finding = self._outcome(disturbed)
            return
        scale = self._mechanism.rate_scale
        last = np.zeros(len(scale)) if self.rates is None else scale * self.rates
        moved = gap * last
        self.rates = self._probe.rates(moved) / scale

    def _outcome(self, disturbed: bool) -> str:
        """Return what a probe has found, as a sentence."""
        suspicions, forming = self._detector.suspicions, self._detector.forming
        if suspicions or forming:
            return str(forming or suspicions[-1])
        if disturbed:
            return 'ended early: the state has changed'
        at_rest = self._detector.probed_at_rest
        found = self.isolability(True, at_rest)
        assert found is not None
        return f'no latent failure{found.limits(" at rest" if at_rest else "")}'
