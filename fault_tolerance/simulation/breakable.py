# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Common to all simulated mechanisms: drives, faults and sensors.

An engine (`simulation.plant`, `simulation.mujoco`) adds how the parts move.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import atan2, exp, sqrt

import numpy as np
from numpy.typing import ArrayLike

from fault_tolerance.errors import ArrayError, FailureError
from fault_tolerance.mechanism.arrays import FloatArray, frozen_array
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.elastic import attached_values
from fault_tolerance.simulation.faults import FaultCommand, FaultMode
from fault_tolerance.simulation.linkage import Linkage
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.servos import BoolArray, Servos
from fault_tolerance.simulation.state import LONGEST_STEP, PlantState


class BreakablePlant(ABC):
    """A mechanism without its mechanics: drives, faults, their repair, and sensors.

    An actuator holds its joint with a stiffness at its setpoint plus its *slack*; a stuck one
    keeps both, a free one holds nothing. A repair moves nothing: the drive starts at rest where
    its joint is now (where it springs to once let go, if it was stuck), a strut is fastened where
    the platform is now. The strain this leaves is in the slack, and in how far the strut's end is
    off its place; both die away with `PlantSettings.engagement_time`.

    ``mechanism`` may have any serial chains as struts, with any number of actuators in each;
    `MechanismError` if it is given by its Jacobian only. ``rng`` is the source of the sensor
    noise, or the seed of one.
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
        place = {name: index for index, name in enumerate(mechanism.strut_names)}
        self._strut_of = np.array([place[one.strut] for one in mechanism.actuators], dtype=np.intp)
        # Newtons a metre become newton metres a radian.
        self._lever = np.where(self._linkage.turning, self._linkage.length, 1.0)
        levers = self._lever.flat[self._linkage.slots]
        self._stiffness = self.settings.actuator_stiffness * levers**2
        self._noise = np.asarray(self.settings.encoder_noise / levers)
        self._modes: list[FaultMode] = ['none'] * count
        self._attached = np.ones(len(mechanism.struts), dtype=np.bool_)
        self._slack = np.zeros(count)
        self._offsets = np.zeros((len(mechanism.struts), 6))
        self._command = np.zeros(count)
        self._command_age = 0.0
        self._pose = np.eye(4)
        self._pose[:3, 3] = mechanism.origin
        self._joint_values = np.zeros(self._linkage.real.shape)
        self._state: PlantState  # observed by the engine, once it is complete

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
        lost = ~self._present
        return tuple(
            'hard' if gone else mode for mode, gone in zip(self._modes, lost, strict=True)
        )

    @property
    def lost_struts(self) -> tuple[str, ...]:
        """Names of the struts that are off the platform, in the mechanism's order."""
        names = self.mechanism.strut_names
        return tuple(name for name, held in zip(names, self._attached, strict=True) if not held)

    def command(self, rates: ArrayLike) -> None:
        """Take ``rates`` (N,) for the drives to follow, rad/s and m/s, until the next command.

        Raises `ArrayError` if there are not N of them or one is not finite; the last one stands.
        """
        self._command = frozen_array(rates, (len(self._modes),), 'command')
        self._command_age = 0.0

    def reseed(self, rng: np.random.Generator | int) -> None:
        """Take the sensor noise from ``rng``, or from a source of that seed, from now on."""
        self._rng = np.random.default_rng(rng)

    def apply(self, command: FaultCommand) -> None:
        """Break or repair parts at once as ``command`` says; the next step shows it.

        Raises `FailureError`, and does nothing, if the mechanism has no such part.
        """
        mode, mechanism = command.mode, self.mechanism
        actuators = () if mode == 'hard' else mechanism.actuator_names
        struts = mechanism.strut_names if mode in ('hard', 'none') else ()
        for target in command.targets:
            if target not in (*actuators, *struts):
                raise FailureError(target, f'not subject to {mode}', (*actuators, *struts))
        chosen = [i for i, name in enumerate(actuators) if name in command.targets]
        # A stuck actuator is let go last, when the others hold the platform again.
        held = self._present
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

        Raises `ArrayError` if ``dt`` is not a number from 0 to `LONGEST_STEP`.
        """
        if not 0.0 <= dt <= LONGEST_STEP:
            raise ArrayError('dt', f'{dt} s is not between 0 and {LONGEST_STEP} s')
        if dt == 0.0:
            return self._state
        fading = exp(-dt / self.settings.engagement_time)
        self._slack *= fading
        self._offsets *= fading
        before, values_before = self._pose, self._values
        self._advance(dt)
        self._state = self._observed(before, values_before, dt)
        return self._state

    @abstractmethod
    def _advance(self, dt: float) -> None:
        """Let ``dt`` > 0 seconds pass: call `_drive`, and replace `_pose` and `_joint_values`.

        Joint values of lost struts stay.
        """

    @abstractmethod
    def _efforts(self) -> FloatArray:
        """Return what each actuator pushes with (N,); anything in free and lost ones."""

    @abstractmethod
    def _released(self, index: int) -> float:
        """Return where the joint of one actuator would spring to if it were let go."""

    @abstractmethod
    def _fasten(self, index: int) -> FloatArray:
        """Fasten the end of a strut, its `_joint_values` fitted; return what it is off, (6,)."""

    @property
    def _values(self) -> FloatArray:
        return self._joint_values.reshape(-1)[self._linkage.slots]

    @property
    def _free(self) -> BoolArray:
        return np.array([mode == 'torque' for mode in self._modes])

    @property
    def _present(self) -> BoolArray:
        return self._attached[self._strut_of]

    def _drive(self, dt: float) -> None:
        """Move the setpoints; commands older than the timeout count as zero."""
        healthy = np.array([mode == 'none' for mode in self._modes])
        driven = healthy & self._present
        obeyed = min(dt, max(0.0, self.settings.command_timeout - self._command_age))
        self._command_age += dt
        if obeyed > 0.0:
            self._servos.advance(self._command, driven, obeyed)
        if obeyed < dt:
            self._servos.advance(np.zeros_like(self._command), driven, dt - obeyed)

    def _observed(self, before: FloatArray, values_before: FloatArray, dt: float) -> PlantState:
        """Return what there is to see after a step from the pose and joint values before it."""
        values, pose = self._values, self._pose
        present = self._present
        twist, rates = np.zeros(6), np.zeros(len(values))
        if dt > 0.0:
            twist[:3] = _turn(before[:3, :3], pose[:3, :3]) / dt
            twist[3:] = (pose[:3, 3] - before[:3, 3]) / dt
            rates = (values - values_before) / dt
        noise = self._noise * self._rng.standard_normal(len(values))
        return PlantState(
            pose=pose.copy(),
            twist=twist,
            values=values,
            measured_values=np.where(present, values + noise, values),
            rates=rates,
            efforts=np.where(present & ~self._free, self._efforts(), 0.0),
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
            if old == 'position':
                # As if free: what a stuck actuator pushed against lets go.
                self._modes[index] = 'torque'
                value = self._released(index)
                self._modes[index] = mode
            self._slack[index] = rest - self._servos.rest_at(index, value)

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
        self._attached[index] = True
        self._offsets[index] = self._fasten(index)


def _turn(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the rotation vector (3,) from one rotation (3, 3) to another, less than pi."""
    # scipy's Rotation would take a sixth of the time of a step.
    turn = after @ before.T
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sine = 0.5 * sqrt(x * x + y * y + z * z)
    angle = atan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
    return 0.5 * (angle / sine if sine > 0.0 else 1.0) * np.array([x, y, z])
