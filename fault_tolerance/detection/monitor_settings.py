# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How detection is set: whether it acts, delays, friction of the drives, probes, relief."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Literal

Detect = Literal['off', 'advise', 'act']


@dataclass(frozen=True)
class MonitorSettings:
    """How failures that nobody reports are looked for.

    Attributes
    ----------
    detect : {'off', 'advise', 'act'}
        Not looked for; only published; or handled like reports.
    command_delay : float
        Seconds from a command to its effect in the joint states.
    breakaway : float
        Metres by which drives that stick may lag before they slip; a drive is not suspected of
        standing still before it should have gone twice as far.
    probe_period : float
        Seconds between two probes; 0: only on request.
    probe_amplitude : float
        Metres; 0: from force and stroke.
    probe_force : float
        Largest extra force of a probe on a drive, newtons, where the amplitude is not given.
    relief : bool
        Whether the strain that a failure or a repair leaves behind is led back, where the efforts
        show it.
    """

    detect: Detect = 'advise'
    command_delay: float = 0.0
    breakaway: float = 0.0
    probe_period: float = 0.0
    probe_amplitude: float = 0.0
    probe_force: float = 0.5
    relief: bool = True

    def __post_init__(self) -> None:
        """Check the values; ValueError names what is wrong."""
        if self.detect not in ('off', 'advise', 'act'):
            raise ValueError(f'detect: {self.detect!r} is not off, advise or act')
        for name in (
            'command_delay', 'breakaway', 'probe_period', 'probe_amplitude', 'probe_force',
        ):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0.0):
                raise ValueError(f'{name}: {value} is not a number from 0 on')
