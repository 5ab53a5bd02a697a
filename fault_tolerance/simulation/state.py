# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The interface of every simulated mechanism, and its state."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import atan2, sqrt
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.faults import FaultCommand, FaultMode
from fault_tolerance.simulation.plant_settings import PlantSettings

LONGEST_STEP = 1.0
"""Seconds; `Plant.step` takes no more at a time."""


@dataclass(frozen=True, eq=False)
class PlantState:
    """The simulated mechanism at one time: what is true, and what its drives read.

    Attributes
    ----------
    pose : (4, 4) array
        The platform frame in base axes: the truth.
    twist : (6,) array
        Angular velocity, then velocity of the platform origin, base axes: the truth, mean
        over the last step.
    values : (N,) array
        True joint values of the actuators, radians or metres from home.
    measured_values : (N,) array
        What the encoders read of them, or of the drives, with noise and faults; constant in a
        strut whose loss is reported.
    rates : (N,) array
        True joint rates, mean over the last step; 0 in a strut whose loss is reported.
    measured_rates : (N,) array
        The same by the encoders, free of noise and jumps; 0 where one is frozen.
    efforts : (N,) array
        What each actuator pushes or turns with, N or N m, positive along the joint; 0 where
        it is free or its strut lost.
    """

    pose: FloatArray
    twist: FloatArray
    values: FloatArray
    measured_values: FloatArray
    rates: FloatArray
    measured_rates: FloatArray
    efforts: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for entry in fields(self):
            getattr(self, entry.name).setflags(write=False)


class Plant(Protocol):
    """A simulated ``mechanism`` with its ``settings``, driven by rates and broken on request."""

    mechanism: Mechanism
    settings: PlantSettings

    @property
    def state(self) -> PlantState:
        """The state after the last step; at home, unloaded, before the first."""
        ...

    @property
    def setpoints(self) -> FloatArray:
        """Joint values (N,) the drives hold; means nothing for a free one."""
        ...

    @property
    def actuator_faults(self) -> tuple[FaultMode, ...]:
        """What is wrong with each drive, as in `FAULT_WORDS`; 'hard' where its strut is lost."""
        ...

    @property
    def encoder_faults(self) -> tuple[FaultMode, ...]:
        """What is wrong with each encoder: 'frozen', 'biased' or 'none'."""
        ...

    @property
    def lost_struts(self) -> tuple[str, ...]:
        """Names of the struts that are off the platform, in the mechanism's order."""
        ...

    @property
    def strut_points(self) -> tuple[FloatArray, ...]:
        """For each strut the points (k, 3) on its turning axes, base to platform, metres."""
        ...

    def command(self, rates: ArrayLike) -> None:
        """Take ``rates`` (N,) for the drives to follow, rad/s and m/s, until the next command."""
        ...

    def reseed(self, rng: np.random.Generator | int) -> None:
        """Take the sensor noise from ``rng``, or from a source of that seed, from now on."""
        ...

    def apply(self, command: FaultCommand) -> None:
        """Break or repair parts at once as ``command`` says; the next step shows it."""
        ...

    def step(self, dt: float) -> PlantState:
        """Let ``dt`` seconds pass, at most `LONGEST_STEP`; return the new state."""
        ...


def present_faults(plant: Plant) -> dict[str, tuple[FaultMode, ...]]:
    """Return what is wrong with each actuator of ``plant``, by name: of drive, then of encoder."""
    faults = zip(plant.actuator_faults, plant.encoder_faults, strict=True)
    return {
        name: tuple(one for one in both if one != 'none')
        for name, both in zip(plant.mechanism.actuator_names, faults, strict=True)
    }


def mean_twist(before: FloatArray, after: FloatArray, dt: float) -> FloatArray:
    """Return the mean twist (6,), as in `PlantState`, of the platform in ``dt`` > 0 seconds.

    Its pose was ``before`` (4, 4), and is ``after``, less than half a turn away.
    """
    # scipy's Rotation would take a sixth of the time of a step.
    turn = after[:3, :3] @ before[:3, :3].T
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine = 0.5 * sqrt(x * x + y * y + z * z)
    angle = atan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
    twist = np.empty(6)
    twist[:3] = 0.5 * (angle / sine if sine > 0.0 else 1.0) * np.array([x, y, z])
    twist[3:] = after[:3, 3] - before[:3, 3]
    return twist / dt
