# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Common to all simulated mechanisms: drives, faults and sensors.

An engine (`simulation.plant`, `simulation.mujoco`) adds how the parts move.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import exp
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fault_tolerance.errors import ArrayError, FailureError
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen_array
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.elastic import attached_values
from fault_tolerance.simulation.faults import ENCODER_FAULTS, FaultCommand, FaultMode
from fault_tolerance.simulation.linkage import Linkage
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.sensors import Encoders
from fault_tolerance.simulation.servos import Servos
from fault_tolerance.simulation.state import LONGEST_STEP, PlantState, mean_twist

_AT_REST: tuple[FaultMode, ...] = ('position', 'torque')


class _Glance(NamedTuple):
    """What changes in a step: pose (4, 4), joint values (N,), and what encoders have to read."""

    pose: FloatArray
    values: FloatArray
    sensed: FloatArray


class BreakablePlant(ABC):
    """A mechanism without its mechanics: drives, faults, their repair, and sensors.

    An actuator holds its joint with a stiffness at its setpoint plus its *slack*; a stuck one
    keeps both, a free one holds nothing, and one that misbehaves moves its setpoint in its own
    way. A repair moves nothing: the drive starts at rest where its joint is now (where it springs
    to once let go, if it held it), a strut is fastened where the platform is now. The strain this
    leaves is in the slack, and in how far the strut's end is off its place; both die away with
    `PlantSettings.engagement_time`.

    The drives of a strut whose loss is reported stand still. Where nobody knows of it they go on,
    and take their joints with them.

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
        self._linkage = Linkage(mechanism)
        count = len(mechanism.actuators)
        place = {name: index for index, name in enumerate(mechanism.strut_names)}
        self._strut_of = np.array([place[one.strut] for one in mechanism.actuators], dtype=np.intp)
        # Newtons a metre become newton metres a radian.
        self._lever = np.where(self._linkage.turning, self._linkage.length, 1.0)
        levers = self._lever.flat[self._linkage.slots]
        self._stiffness = self.settings.actuator_stiffness * levers**2
        self._encoders = Encoders(mechanism, self.settings, levers, np.random.default_rng(rng))
        self._servos = Servos(
            mechanism, self.settings.servo_time_constant, self.settings.unlimited_rate,
            self.settings.breakaway / levers,
        )
        self._runaway_rates = self.settings.runaway_rate / levers
        self._modes: list[FaultMode] = ['none'] * count
        self._attached = np.ones(len(mechanism.struts), dtype=np.bool_)
        self._known_lost = np.zeros(len(mechanism.struts), dtype=np.bool_)
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
        """What is wrong with each drive, as in `FAULT_WORDS`; 'hard' where its strut is lost."""
        lost = ~self._present
        return tuple(
            'hard' if gone else mode for mode, gone in zip(self._modes, lost, strict=True)
        )

    @property
    def encoder_faults(self) -> tuple[FaultMode, ...]:
        """What is wrong with each encoder: 'frozen', 'biased' or 'none'."""
        return tuple(self._encoders.faults)

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
        self._encoders.rng = np.random.default_rng(rng)

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
        for index in chosen if mode in (*ENCODER_FAULTS, 'none') else ():
            self._encoders.faults[index] = mode
        if mode in ENCODER_FAULTS:
            return
        # An actuator that holds its joint is let go last, when the others hold the platform again.
        held = self._present & ~self._free
        last = [i for i in chosen if mode == 'none' and held[i]]
        for index in (i for i in chosen if i not in last):
            self._set_mode(index, mode)
        for index, name in enumerate(struts):
            if name in command.targets and mode == 'hard':
                self._attached[index] = False
                self._known_lost[index] |= not command.silent
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
        before = self._glance()
        fading = exp(-dt / self.settings.engagement_time)
        self._slack *= fading
        self._offsets *= fading
        self._advance(dt)
        alone = ~self._present & self._powered & ~self._free
        self._joint_values.flat[self._linkage.slots[alone]] = self._rests[alone]
        self._state = self._observed(before, dt)
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
    def _rests(self) -> FloatArray:
        """Where the drives hold their joints."""
        return self._servos.setpoints + self._slack

    @property
    def _free(self) -> BoolArray:
        return np.array([mode == 'torque' for mode in self._modes])

    @property
    def _moving(self) -> BoolArray:
        """Which drives move their setpoints, as they are told or not."""
        return np.array([mode not in _AT_REST for mode in self._modes])

    @property
    def _present(self) -> BoolArray:
        return self._attached[self._strut_of]

    @property
    def _powered(self) -> BoolArray:
        return ~self._known_lost[self._strut_of]

    def _drive(self, dt: float) -> None:
        """Move the setpoints; commands older than the timeout count as zero."""
        driven = self._moving & self._powered
        obeyed = min(dt, max(0.0, self.settings.command_timeout - self._command_age))
        self._command_age += dt
        if obeyed > 0.0:
            self._servos.advance(self._command, driven, obeyed)
        if obeyed < dt:
            self._servos.advance(np.zeros_like(self._command), driven, dt - obeyed)

    def _glance(self) -> _Glance:
        values = self._values
        return _Glance(self._pose, values, self._encoders.sensed(values, self._rests, self._free))

    def _observed(self, before: _Glance | None = None, dt: float = 1.0) -> PlantState:
        """Return what there is to see ``dt`` > 0 seconds after ``before``, or at the start."""
        now = self._glance()
        before = before or now
        encoders = self._encoders
        return PlantState(
            pose=now.pose.copy(),
            twist=mean_twist(before.pose, now.pose, dt),
            values=now.values,
            measured_values=encoders.readings(now.sensed, self._powered),
            rates=(now.values - before.values) / dt,
            measured_rates=encoders.speeds(before.sensed, now.sensed, dt),
            efforts=np.where(self._present & ~self._free, self._efforts(), 0.0),
        )

    def _set_mode(self, index: int, mode: FaultMode) -> None:
        """Break one drive, or mend it where it is now."""
        old, servos, settings = self._modes[index], self._servos, self.settings
        if mode == old:
            return
        # The spring of a free actuator has no rest of its own: it takes up where the joint is.
        value = float(self._values[index])
        rest = value if old == 'torque' else float(self._rests[index])
        if mode == 'none' and old != 'torque':
            # As if free: what the actuator pushed against lets go.
            self._modes[index] = 'torque'
            value = self._released(index)
        self._modes[index] = mode
        if mode == 'position':
            servos.halt_at(index, rest)
            self._slack[index] = 0.0
        elif mode == 'none' or old == 'torque':
            self._slack[index] = rest - servos.rest_at(index, value)
        obedience = {'weak': settings.weak_share, 'reversed': -1.0, 'runaway': 0.0}
        servos.obedience[index] = obedience.get(mode, 1.0)
        servos.own_rates[index] = self._runaway_rates[index] if mode == 'runaway' else 0.0

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
        for member in np.flatnonzero(self._moving & (self._strut_of == index)).tolist():
            value = float(self._values[member])
            self._slack[member] = value - self._servos.rest_at(member, value)
        self._attached[index] = True
        self._known_lost[index] = False
        self._offsets[index] = self._fasten(index)
