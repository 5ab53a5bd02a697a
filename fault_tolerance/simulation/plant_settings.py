# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How stiff, slow and noisy the simulated mechanism is, and how it misbehaves."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import isfinite

from fault_tolerance.errors import ArrayError
from fault_tolerance.mechanism.arrays import frozen_array

ENCODER_CHOICES = ('file', 'load', 'motor')
"""The words for `PlantSettings.encoders`."""

_MAY_BE_ZERO = ('servo_time_constant', 'breakaway', 'encoder_noise', 'encoder_bias', 'weak_share')


@dataclass(frozen=True)
class PlantSettings:
    """Properties of the simulated mechanism.

    Rotations count as displacements of the characteristic length Lc: a stiffness k or damping c
    in the units below is k Lc^2 or c Lc^2 about an axis, and a displacement or speed of a drive
    that turns is 1/Lc of it, in radians. The defaults suit a fast steering mirror of a few
    centimetres on piezo or voice-coil struts.

    Attributes
    ----------
    actuator_stiffness : float
        Of every actuator about its setpoint, N/m.
    structure_stiffness : float
        Of each strut's hold on the platform in the directions its joints move, N/m.
    flexure_stiffness : float
        The same in the directions its joints bar, N/m. Struts that bar more than the platform
        leaves them, as four do on a tilted mirror, strain these.
    platform_damping : float
        N s/m.
    joint_damping : float
        Of every joint that no drive holds, N s/m.
    disturbance : tuple of float
        Constant load on the platform at its origin, base axes: moments divided by Lc, then
        forces, newtons. An unactuated direction drifts at load / damping.
    servo_time_constant : float
        First-order lag of the drives, seconds.
    unlimited_rate : float
        Largest rate of actuators whose description has none: rad/s, or Lc a second.
    breakaway : float
        A drive stands still until it has been told to go farther than this, and then slips all
        the way, metres.
    encoders : str
        What all encoders read: ``load`` the joint, ``motor`` the drive; ``file`` as the mechanism
        file says of each.
    encoder_noise : float
        Standard deviation of the measured positions, metres. 2 nm at a radius of 20 mm are
        0.1 urad, below the 0.5 urad that the manual of the Newport FSM-300 mirror gives as its
        position sensors' resolution.
    encoder_bias : float
        By how much the reading of a biased encoder jumps, metres.
    weak_share : float
        How far a weak drive moves of what it is told, 0 to 1.
    runaway_rate : float
        Speed of a drive that moves by itself, towards the upper end of its stroke, m/s.
    command_timeout : float
        The drives stop when commands cease for so long, seconds.
    engagement_time : float
        Time constant with which a mended part takes up its share of the load, seconds.
    """

    actuator_stiffness: float = 1e6
    structure_stiffness: float = 1e8
    flexure_stiffness: float = 1e6
    platform_damping: float = 100.0
    joint_damping: float = 1.0
    disturbance: tuple[float, float, float, float, float, float] = (
        *(0.004, 0.003, 0.001),
        *(0.001, 0.002, 0.003),
    )
    servo_time_constant: float = 1e-3
    unlimited_rate: float = 10.0
    breakaway: float = 0.0
    encoders: str = ENCODER_CHOICES[0]
    encoder_noise: float = 2e-9
    encoder_bias: float = 2e-6
    weak_share: float = 0.5
    runaway_rate: float = 1e-4
    command_timeout: float = 0.1
    engagement_time: float = 0.05

    def __post_init__(self) -> None:
        """Check the numbers."""
        load = frozen_array(self.disturbance, (6,), 'disturbance')
        object.__setattr__(self, 'disturbance', tuple(load.tolist()))
        if self.encoders not in ENCODER_CHOICES:
            reason = f'{self.encoders!r} is not one of {", ".join(ENCODER_CHOICES)}'
            raise ArrayError('encoders', reason)
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.name in ('disturbance', 'encoders'):
                continue
            if not isfinite(value) or value < 0.0:
                raise ArrayError(entry.name, f'{value} is not a finite, positive number')
            if value == 0.0 and entry.name not in _MAY_BE_ZERO:
                raise ArrayError(entry.name, 'must not be zero')
        if self.weak_share > 1.0:
            raise ArrayError('weak_share', f'{self.weak_share} is more than 1')
