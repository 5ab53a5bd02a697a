# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The interface of every simulated mechanism, and its state."""

from __future__ import annotations

from dataclasses import dataclass, fields
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
        The same as measured, with noise; without, and constant, for a lost strut.
    rates : (N,) array
        Joint rates, mean over the last step, free of noise; 0 in a lost strut.
    efforts : (N,) array
        What each actuator pushes or turns with, N or N m, positive along the joint; 0 where
        it is free or its strut lost.
    """

    pose: FloatArray
    twist: FloatArray
    values: FloatArray
    measured_values: FloatArray
    rates: FloatArray
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
        """What is wrong with each actuator: 'position', 'torque', 'hard' (strut lost), 'none'."""
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
