# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The simulated mechanism: elastic, breakable, and ignorant of the controller's kinematics."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import atan2, exp, sqrt

import numpy as np
from numpy.typing import ArrayLike

from fault_tolerance.errors import ArrayError, FailureError
from fault_tolerance.mechanism.arrays import FloatArray, frozen_array
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.elastic import (
    Structure,
    attached_values,
    settled,
    strut_stiffnesses,
)
from fault_tolerance.simulation.faults import FaultCommand, FaultMode
from fault_tolerance.simulation.linkage import Linkage
from fault_tolerance.simulation.servos import Servos
from fault_tolerance.simulation.settings import PlantSettings

LONGEST_STEP = 1.0
"""Seconds; `ElasticPlant.step` takes no more at a time."""

_RELEASE_STEPS = 4
_RELEASE_STEP = 0.01


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


class ElasticPlant:
    """A mechanism with elastic struts, driven by rate commands and broken on request.

    Actuators are springs about the position their drive holds, and springs hold every strut's
    end to the platform in all six directions: much stiffer ones, except where the strut's joints
    bar the motion and flexures give way. The platform rests where the energy is least, so a
    drive that contradicts the others strains the structure instead of being impossible, and the
    strain appears as `PlantState.efforts`. The mechanism is known by its joint axes and points
    only; no Jacobian of the controller's is used.

    A stuck actuator keeps its setpoint; a free one has no spring and is carried along, between
    the ends of its stroke; a lost strut's joints stay where they were. Mending moves nothing:
    the drive starts at rest where its joint is now, a strut is fastened where the platform is
    now, and the strain this leaves dies away with `PlantSettings.engagement_time`.

    Parameters
    ----------
    mechanism : Mechanism
        With struts; any serial chains, any number of actuators in each.
    settings : PlantSettings
    rng : numpy.random.Generator or int
        Source of the sensor noise, or the seed of one.

    Raises
    ------
    MechanismError
        If the mechanism is given by numbers only.

    Notes
    -----
    Not modelled: inertia and vibration; gravity; friction and backlash; creep and hysteresis of
    piezo stacks; restoring forces, fatigue and travel of flexures; limits on force; temperature;
    bias, quantisation and dropouts of sensors; dead time of drives; end stops of the platform
    and of passive joints; collisions; links that bend anywhere but at their ends. Speeds are
    mean values over a step.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        settings: PlantSettings | None = None,
        rng: np.random.Generator | int = 0,
    ) -> None:
        self.mechanism = mechanism
        self.settings = settings or PlantSettings()
        self._rng = np.random.default_rng(rng)
        self._linkage = Linkage(mechanism)
        self._servos = Servos(
            mechanism, self.settings.servo_time_constant, self.settings.unlimited_rate
        )
        count = len(mechanism.actuators)
        strut_count, longest = self._linkage.real.shape
        place = {name: index for index, name in enumerate(mechanism.strut_names)}
        self._strut_of = np.array([place[one.strut] for one in mechanism.actuators], dtype=np.intp)
        # Newtons a metre become newton metres a radian.
        self._lever = np.where(self._linkage.turning, self._linkage.length, 1.0)
        self._stiffness = (
            self.settings.actuator_stiffness * self._lever.flat[self._linkage.slots] ** 2
        )
        noise = self.settings.encoder_noise / self._lever.flat[self._linkage.slots]
        self._noise = np.asarray(noise)
        self._strut_stiffness = strut_stiffnesses(
            self._linkage, self.settings.structure_stiffness, self.settings.flexure_stiffness
        )
        self._modes: list[FaultMode] = ['none'] * count
        self._attached = np.ones(strut_count, dtype=np.bool_)
        self._slack = np.zeros(count)
        self._offsets = np.zeros((strut_count, 6))
        self._command = np.zeros(count)
        self._command_age = 0.0
        self._pose = np.eye(4)
        self._pose[:3, 3] = mechanism.origin
        self._joint_values = np.zeros((strut_count, longest))
        self._state = self._observed(self._pose, self._values, 0.0)

    @property
    def state(self) -> PlantState:
        """The state after the last step; at home, unloaded, before the first."""
        return self._state

    @property
    def setpoints(self) -> FloatArray:
        """Joint values (N,) the drives hold; means nothing for a free one."""
        return self._servos.setpoints.copy()

    @property
    def actuator_faults(self) -> tuple[FaultMode, ...]:
        """What is wrong with each actuator: 'position', 'torque', 'hard' (strut lost), 'none'."""
        lost = ~self._attached[self._strut_of]
        return tuple(
            'hard' if gone else mode for mode, gone in zip(self._modes, lost, strict=True)
        )

    @property
    def lost_struts(self) -> tuple[str, ...]:
        """Names of the struts that are off the platform, in the mechanism's order."""
        names = self.mechanism.strut_names
        return tuple(name for name, held in zip(names, self._attached, strict=True) if not held)

    @property
    def strut_points(self) -> tuple[FloatArray, ...]:
        """For each strut the points (k, 3) on its turning axes, base to platform, metres."""
        points = self._linkage.placement(self._joint_values).points
        turning = self._linkage.turning
        return tuple(points[i, turning[i]] for i in range(len(points)))

    def command(self, rates: ArrayLike) -> None:
        """Take rates (N,) for the drives to follow, rad/s and m/s, until the next command.

        Raises
        ------
        ArrayError
            If there are not N of them or one is not finite; the last command then stands.
        """
        self._command = frozen_array(rates, (len(self._modes),), 'command')
        self._command_age = 0.0

    def apply(self, command: FaultCommand) -> None:
        """Break or mend parts at once; the next step shows it.

        Raises
        ------
        FailureError
            If the mechanism has no such part; nothing is done then.
        """
        mode, mechanism = command.mode, self.mechanism
        actuators = () if mode == 'hard' else mechanism.actuator_names
        struts = mechanism.strut_names if mode in ('hard', 'none') else ()
        for target in command.targets:
            if target not in (*actuators, *struts):
                raise FailureError(target, f'not subject to {mode}', (*actuators, *struts))
        chosen = [i for i, name in enumerate(actuators) if name in command.targets]
        # A stuck actuator is let go last, when the others hold the platform again.
        held = self._attached[self._strut_of]
        last = [i for i in chosen if mode == 'none' and self._modes[i] == 'position' and held[i]]
        for index in (i for i in chosen if i not in last):
            self._set_mode(index, mode)
        for index, name in enumerate(struts):
            if name in command.targets and mode == 'hard':
                self._attached[index] = False
            elif name in command.targets:
                self._attach(index)
        for index in last:
            self._set_mode(index, mode)

    def step(self, dt: float) -> PlantState:
        """Let ``dt`` seconds pass and return the new state; 0 changes nothing.

        Raises
        ------
        ArrayError
            If ``dt`` is not a number from 0 to `LONGEST_STEP`.
        """
        if not 0.0 <= dt <= LONGEST_STEP:
            raise ArrayError('dt', f'{dt} s is not between 0 and {LONGEST_STEP} s')
        if dt == 0.0:
            return self._state
        self._drive(dt)
        fading = exp(-dt / self.settings.engagement_time)
        self._slack *= fading
        self._offsets *= fading
        before, values_before = self._pose, self._values
        self._pose, self._joint_values = settled(
            self._linkage, self._structure(), self._pose, self._joint_values, dt
        )
        self._state = self._observed(before, values_before, dt)
        return self._state

    @property
    def _values(self) -> FloatArray:
        return self._joint_values.reshape(-1)[self._linkage.slots]

    def _drive(self, dt: float) -> None:
        """Move the setpoints; commands older than the timeout count as zero."""
        healthy = np.array([mode == 'none' for mode in self._modes])
        driven = healthy & self._attached[self._strut_of]
        obeyed = min(dt, max(0.0, self.settings.command_timeout - self._command_age))
        self._command_age += dt
        if obeyed > 0.0:
            self._servos.advance(self._command, driven, obeyed)
        if obeyed < dt:
            self._servos.advance(np.zeros_like(self._command), driven, dt - obeyed)

    def _structure(self) -> Structure:
        """Return the springs and dampers as the faults leave them."""
        settings, linkage = self.settings, self._linkage
        stiffness, rest = self._stiffness, self._servos.setpoints + self._slack
        free = np.array([mode == 'torque' for mode in self._modes])
        if free.any():
            # A free actuator meets a spring only at the ends of its stroke.
            values = self._values
            stop = np.clip(values, self._servos.lowest, self._servos.highest)
            stiffness = np.where(free & (stop == values), 0.0, stiffness)
            rest = np.where(free, stop, rest)
        joint_stiffness = np.zeros(linkage.real.shape)
        joint_rest = np.zeros(linkage.real.shape)
        joint_stiffness.reshape(-1)[linkage.slots] = stiffness
        joint_rest.reshape(-1)[linkage.slots] = rest
        unheld = (joint_stiffness == 0.0) * settings.joint_damping
        return Structure(
            joint_stiffness=joint_stiffness,
            joint_rest=joint_rest,
            joint_damping=unheld * self._lever**2,
            strut_stiffness=self._attached[:, None, None] * self._strut_stiffness,
            strut_offsets=self._offsets,
            platform_damping=settings.platform_damping,
            load=np.asarray(settings.disturbance),
        )

    def _observed(self, before: FloatArray, values_before: FloatArray, dt: float) -> PlantState:
        """Return what there is to see after a step from the pose and joint values before it."""
        values, pose = self._values, self._pose
        present = self._attached[self._strut_of]
        twist, rates = np.zeros(6), np.zeros(len(values))
        if dt > 0.0:
            twist[:3] = _turn(before[:3, :3], pose[:3, :3]) / dt
            twist[3:] = (pose[:3, 3] - before[:3, 3]) / dt
            rates = (values - values_before) / dt
        free = np.array([mode == 'torque' for mode in self._modes])
        spring = self._stiffness * (self._servos.setpoints + self._slack - values)
        noise = self._noise * self._rng.standard_normal(len(values))
        return PlantState(
            pose=pose.copy(),
            twist=twist,
            values=values,
            measured_values=np.where(present, values + noise, values),
            rates=rates,
            efforts=np.where(present & ~free, spring, 0.0),
        )

    def _set_mode(self, index: int, mode: FaultMode) -> None:
        """Break one actuator, or mend it where it is now."""
        old = self._modes[index]
        if mode == old:
            return
        # The spring of a free actuator has no rest of its own: it takes up where the joint is.
        value = float(self._values[index])
        rest = self._servos.setpoints[index] + self._slack[index]
        rest = value if old == 'torque' else rest
        self._modes[index] = mode
        self._slack[index] = 0.0
        if mode == 'position':
            self._servos.setpoints[index] = rest
            self._servos.rates[index] = 0.0
        elif mode == 'none':
            value = self._released(index) if old == 'position' else value
            self._slack[index] = rest - self._servos.rest_at(index, value)

    def _released(self, index: int) -> float:
        """Return where the joint of one actuator springs to when it is let go."""
        mode, self._modes[index] = self._modes[index], 'torque'
        pose, joint_values = self._pose, self._joint_values
        # Long enough for the strain to go, too short for a drift to matter.
        for _ in range(_RELEASE_STEPS):
            pose, joint_values = settled(
                self._linkage, self._structure(), pose, joint_values, _RELEASE_STEP
            )
        self._modes[index] = mode
        return float(joint_values.flat[self._linkage.slots[index]])

    def _attach(self, index: int) -> None:
        """Fasten a lost strut to the platform where it is now."""
        if self._attached[index]:
            return
        linkage = self._linkage
        movable = linkage.real[index].astype(np.float64)
        members = np.flatnonzero(self._strut_of == index).tolist()
        longest = linkage.real.shape[1]
        for member in members:
            if self._modes[member] == 'position':
                movable[linkage.slots[member] % longest] = 0.0
        self._joint_values = attached_values(
            linkage, index, movable, self._pose, self._joint_values
        )
        for member in members:
            if self._modes[member] == 'none':
                value = float(self._values[member])
                self._slack[member] = value - self._servos.rest_at(member, value)
        placement = linkage.placement(self._joint_values)
        self._offsets[index] = linkage.gaps(placement, self._pose)[index]
        self._attached[index] = True


def _turn(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the rotation vector (3,) from one rotation (3, 3) to another, less than pi."""
    turn = after @ before.T
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine = 0.5 * sqrt(x * x + y * y + z * z)
    angle = atan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
    return 0.5 * (angle / sine if sine > 0.0 else 1.0) * np.array([x, y, z])
