# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Detection beside a running controller: it listens, probes, relieves strain, and tells.

Like the controller it has no clock of its own. What it wants the drives to do beside the task are
rates in directions that do not move a healthy platform.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

import numpy as np

from fault_tolerance.detection.detector import Detector
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.prober import Prober
from fault_tolerance.detection.relief import Relief
from fault_tolerance.detection.sighting import Sighting
from fault_tolerance.detection.suspicion import Suspicion
from fault_tolerance.kernel import evidence
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.arrays import FloatArray, decimal
from fault_tolerance.mechanism.description import Mechanism

RELIEF_EVERY = 100_000_000
"""Nanoseconds from one look at the strain to the next: not too long for the gain of the relief."""


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
    prober : Prober
    rates : (N,) array or None
        What the drives are to do beside the task until the next readings, in the mechanism's
        units; None: nothing.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        settings: MonitorSettings | None = None,
        advance: Callable[..., float] = evidence.advance,
    ) -> None:
        given = settings or MonitorSettings()
        self.detector = Detector(mechanism, given.command_delay, advance, given.breakaway)
        self.prober = Prober(mechanism, given, self.detector)
        self._relief = Relief(mechanism, given.relief)
        self._failures = FailureSet()
        self._convicted: tuple[Suspicion, ...] = ()
        self._looked = 0
        self.rates: FloatArray | None = None

    @property
    def settings(self) -> MonitorSettings:
        """How failures are looked for."""
        return self.prober.settings

    @settings.setter
    def settings(self, settings: MonitorSettings) -> None:
        """Go on with other ``settings``."""
        self.prober.settings = settings

    @property
    def internal_force(self) -> float:
        """The largest force of the drives against each other, N; NaN where it is not known.

        That is without efforts, and while the mechanism is probed or does not move.
        """
        return self._relief.internal_force

    @property
    def to_report(self) -> tuple[Suspicion, ...]:
        """What the last readings have convicted, and is to be handled as if it were reported."""
        if self.settings.detect != 'act':
            return ()
        return tuple(one for one in self._convicted if not one.obstacle(self._failures))

    def forget(self, fresh: float = 0.0) -> tuple[str, ...]:
        """Drop what has been found, but for what was seen in the last ``fresh`` seconds.

        Returns what stays, in the words of the ledger.
        """
        before = self.detector.suspicions
        kept = self.detector.forget(round(1e9 * fresh))
        if kept != before:
            self.prober.look_again()
        return tuple(one.text for one in kept)

    @property
    def suspected(self) -> str:
        """The candidates of every suspicion, as text."""
        return '; '.join(
            ', '.join(map(str, one.candidates)) for one in self.detector.suspicions
        )

    def values(self) -> dict[str, str]:
        """Return what belongs into the metrics, texts by key; after a change it takes longer."""
        suspicions, since = self.detector.suspicions, self.prober.latent_since_probe
        passive = self.prober.isolability(False)
        alike = [group for group in passive.classes if len(group) > 1] if passive else []
        moving = [one.name for one in suspicions if one.moves_though_stuck(self._failures)]
        ahead = sorted((one.outlook.measure, one.worst_next) for one in suspicions if one.outlook)
        force = self.internal_force
        return {
            'inconsistent': ', '.join(moving),
            'suspected': self.suspected,
            'worst_next_suspected': ahead[0][1] if ahead else '',
            'not_told_apart': '; '.join(', '.join(map(str, group)) for group in alike),
            'undetectable': ', '.join(map(str, passive.undetectable)) if passive else '',
            'latent_since_probe': decimal(since) if isfinite(since) else '',
            'internal_force': decimal(force) if isfinite(force) else '',
        }

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
        self._convicted = ()
        if self.detector.is_stale(sighting.stamp):
            return False
        before = self.detector.suspicions
        self.prober.listen(sighting.stamp, sighting.values, moving)
        self.detector.observe(sighting, failures, pose, rows)
        changed = failures != self._failures or self.detector.suspicions != before
        strained = self.prober.straining
        self.prober.go_on(changed)
        new = tuple(one for one in self.detector.suspicions if one not in before)
        self._convicted = (*new, *self.detector.renewed)
        changed |= bool(new)
        self._relief.disturbed |= failures != self._failures
        if set(failures.parts) < set(self._failures.parts):
            self.prober.look_again()
        self._failures = failures
        if strained or self.prober.straining or not moving:
            self.rates, self._relief.internal_force = self.prober.rates, np.nan
        elif changed:
            self.rates = None
        elif not 0 <= sighting.stamp - self._looked < RELIEF_EVERY:
            self._looked, self.rates = sighting.stamp, self._relieving(sighting)
        return bool(new)

    def _relieving(self, sighting: Sighting) -> FloatArray | None:
        """Return rates that lead strain back, if a change has left any."""
        if sighting.efforts is None or not self.detector.sensors.efforts:
            self._relief.internal_force = np.nan
            return None
        noise = float(self.detector.noise[: len(sighting.values)].max())
        return self._relief.rates(self.prober.stress, sighting.efforts, noise)
