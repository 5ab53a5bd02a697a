# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The engine MuJoCo: the mechanism with inertia and gravity, in an independent solver.

Needs the package ``mujoco`` (the extra of that name), which is imported when a plant is made.
"""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np

from fault_tolerance.errors import EngineError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.breakable import BreakablePlant
from fault_tolerance.simulation.mjcf import (
    CONSTRAINT_TIME,
    PLATFORM,
    RATE_SERVO,
    TIMESTEP,
    Masses,
    ball_of,
    mjcf_text,
)
from fault_tolerance.simulation.plant_settings import PlantSettings

# The setpoints move in straight lines between times at most so far apart, in time steps.
_STRIDE = 4
_RELEASE_TIME = 0.02
# Bounds of a constraint's impedance: half-way, and the highest MuJoCo knows.
_SOFTEST, _HARDEST = 0.5, 0.9999


class MujocoPlant(BreakablePlant):
    """A mechanism with mass in MuJoCo, driven by rate commands and broken on request.

    The model is that of `mjcf.mjcf_text`, with gravity; `PlantSettings.disturbance` and
    `platform_damping` act on the platform as they do in the elastic plant, `flexure_stiffness` is
    not used. A drive is a servo of `actuator_stiffness` on position and rate; between two states
    its setpoints move as `Servos` has them. The loops are closed by soft constraints of
    `structure_stiffness`, or as near to it as MuJoCo goes.

    A stuck actuator loses its servo and gets a joint constraint of the same stiffness where it
    is; a free one loses its servo and goes between the ends of its stroke; a lost strut's closure
    is switched off, and its passive joints are kept where they were: it neither falls nor swings.

    Parameters are those of `BreakablePlant`, and the `Masses` of the parts. Raises `EngineError`
    if the package mujoco is missing.

    Notes
    -----
    Modelled beyond the elastic plant: inertia and vibration of platform, struts and drives;
    gravity; end stops of actuators whose stroke is limited on both sides. Not modelled: flexures
    softer in the directions a strut bars than in those it moves in (the closures are equally
    stiff in all); contacts and collisions; friction but for `PlantSettings.breakaway`; backlash;
    elastic links; restoring forces of flexures; limits on force; what is said of sensors and
    drives for the elastic plant.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        settings: PlantSettings | None = None,
        rng: np.random.Generator | int = 0,
        masses: Masses | None = None,
    ) -> None:
        library()
        super().__init__(mechanism, settings, rng)
        text = mjcf_text(mechanism, self.settings, masses)
        self._model: Any = self._lib.MjModel.from_xml_string(text)
        self._data: Any = self._lib.MjData(self._model)
        self._ahead: Any = None
        self._index()
        self._soften()
        self._load()
        self._state = self._observed()

    @property
    def strut_points(self) -> tuple[FloatArray, ...]:
        """For each strut the points (k, 3) on its turning axes, base to platform, metres."""
        self._lib.mj_kinematics(self._model, self._data)
        found = []
        for index, strut in enumerate(self.mechanism.struts):
            ball = self._balls[index]
            chain = strut.joints[: len(strut.joints) - ball]
            turning = [joint.name for joint in chain if joint.kind == 'revolute']
            anchors = [self._data.joint(name).xanchor.copy() for name in turning]
            anchors += [self._tip(index)] * ball
            found.append(np.array(anchors).reshape(-1, 3))
        return tuple(found)

    @property
    def _lib(self) -> Any:
        # Not stored: plants are deep-copied, and modules cannot be.
        return library()

    def _index(self) -> None:
        """Find everything by its name, once."""
        model, mechanism = self._model, self.mechanism
        longest = self._linkage.real.shape[1]
        self._balls = [
            len(ball_of(strut, mechanism.characteristic_length)) for strut in mechanism.struts
        ]
        slots, places, speeds, owners = [], [], [], []
        for i, (strut, ball) in enumerate(zip(mechanism.struts, self._balls, strict=True)):
            for j, joint in enumerate(strut.joints[: len(strut.joints) - ball]):
                slots.append(i * longest + j)
                places.append(model.joint(joint.name).qposadr[0])
                speeds.append(model.joint(joint.name).dofadr[0])
                owners.append(i)
        self._slots, self._owners = np.array(slots, np.intp), np.array(owners, np.intp)
        self._places, self._speeds = np.array(places, np.intp), np.array(speeds, np.intp)
        names = mechanism.actuator_names
        self._servo_ids = np.array([model.actuator(name).id for name in names])
        self._rate_ids = np.array([model.actuator(RATE_SERVO.format(name)).id for name in names])
        self._lock_ids = np.array([model.equality(name).id for name in names])
        self._closure_ids = np.array([model.equality(name).id for name in mechanism.strut_names])
        joints = [actuator.joint for actuator in mechanism.actuators]
        self._driven_speeds = np.array([model.joint(name).dofadr[0] for name in joints])
        self._platform = model.body(PLATFORM).id
        self._platform_place = model.joint(PLATFORM).qposadr[0]
        self._gains = (model.actuator_gainprm.copy(), model.actuator_biasprm.copy())
        self._ends = model.eq_obj2id[self._closure_ids]
        self._closures = model.eq_data[self._closure_ids].copy()

    def _soften(self) -> None:
        """Give the constraints the stiffness that is wanted, N/m.

        MuJoCo's are springs on acceleration: one that takes up a displacement r holds a force
        of r / ((1 - d) A T^2), where d is its impedance, T its time constant and A the inverse of
        the inertia it sees, as estimated at home.
        """
        model = self._model
        inverse = model.dof_invweight0[self._driven_speeds]
        locks = _spring(self._stiffness, inverse)
        ends = model.eq_obj1id[self._closure_ids], model.eq_obj2id[self._closure_ids]
        inverse = sum(model.body_invweight0[end, 0] for end in ends)
        closures = _spring(self.settings.structure_stiffness, inverse)
        for ids, (time, impedance) in ((self._lock_ids, locks), (self._closure_ids, closures)):
            model.eq_solref[ids, 0], model.eq_solref[ids, 1] = time, 1.0
            model.eq_solimp[ids, :2] = impedance[:, None]

    def _load(self) -> None:
        """Put damping and load on the platform."""
        length = self._linkage.length
        start = self._model.joint(PLATFORM).dofadr[0]
        damping = self.settings.platform_damping
        self._model.dof_damping[start : start + 3] = damping
        self._model.dof_damping[start + 3 : start + 6] = damping * length**2
        load = np.asarray(self.settings.disturbance)
        self._data.xfrc_applied[self._platform] = [*load[3:], *(length * load[:3])]

    def _advance(self, dt: float) -> None:
        self._equip()
        lib, model, data = self._lib, self._model, self._data
        count = ceil(dt / TIMESTEP)
        model.opt.timestep = dt / count
        lost = ~self._attached[self._owners]
        kept = self._joint_values.reshape(-1)[self._slots][lost]
        places, speeds = self._places[lost], self._speeds[lost]
        for done in range(0, count, _STRIDE):
            steps = min(_STRIDE, count - done)
            start = self._servos.setpoints
            self._drive(steps * model.opt.timestep)
            moved = (self._servos.setpoints - start) / steps
            data.ctrl[self._rate_ids] = moved / model.opt.timestep
            rest = start + self._slack
            for step in range(steps):
                # At the beginning of a time step, where MuJoCo takes the forces from.
                data.ctrl[self._servo_ids] = rest + step * moved
                lib.mj_step(model, data)
                if len(places):
                    data.qpos[places], data.qvel[speeds] = kept, 0.0
        if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
            raise EngineError('mujoco: the simulation has become unstable')
        values = self._joint_values.copy()
        values.reshape(-1)[self._slots] = np.where(
            lost, values.reshape(-1)[self._slots], data.qpos[self._places]
        )
        self._joint_values = values
        self._pose = self._platform_pose()

    def _platform_pose(self) -> FloatArray:
        place = self._platform_place
        pose, turn = np.eye(4), np.zeros(9)
        self._lib.mju_quat2Mat(turn, self._data.qpos[place + 3 : place + 7])
        pose[:3, :3] = turn.reshape(3, 3)
        pose[:3, 3] = self._data.qpos[place : place + 3]
        return pose

    def _equip(self) -> None:
        """Let servos, locks and closures be as the faults leave them."""
        model, data = self._model, self._data
        held = self._moving[:, None]
        for ids in (self._servo_ids, self._rate_ids):
            model.actuator_gainprm[ids] = held * self._gains[0][ids]
            model.actuator_biasprm[ids] = held * self._gains[1][ids]
        data.eq_active[self._lock_ids] = [mode == 'position' for mode in self._modes]
        model.eq_data[self._lock_ids, 0] = self._rests
        data.eq_active[self._closure_ids] = self._attached
        for index in np.flatnonzero(self._offsets.any(axis=1)).tolist():
            self._shift(index)

    def _efforts(self) -> FloatArray:
        data = self._data
        efforts = data.actuator_force[self._servo_ids] + data.actuator_force[self._rate_ids]
        for index in [i for i, mode in enumerate(self._modes) if mode == 'position']:
            equality = self._lib.mjtConstraint.mjCNSTR_EQUALITY
            rows = (data.efc_type == equality) & (data.efc_id == self._lock_ids[index])
            # Not there yet when it has only just stuck.
            efforts[index] = data.efc_force[rows].sum()
        return np.asarray(efforts)

    def _released(self, index: int) -> float:
        """Return where the joint goes in a moment without its lock, and without any weight."""
        self._equip()
        model = self._model
        self._ahead = self._ahead or self._lib.MjData(model)
        ahead, gravity = self._ahead, model.opt.gravity.copy()
        self._lib.mj_copyData(ahead, model, self._data)
        model.opt.gravity[:] = 0.0
        model.opt.timestep = TIMESTEP
        ahead.xfrc_applied[:] = 0.0
        ahead.ctrl[self._servo_ids] = self._rests
        ahead.ctrl[self._rate_ids] = 0.0
        lost = self._speeds[~self._attached[self._owners]]
        for _ in range(round(_RELEASE_TIME / TIMESTEP)):
            self._lib.mj_step(model, ahead)
            ahead.qvel[lost] = 0.0
        model.opt.gravity[:] = gravity
        slot = self._linkage.slots[index]
        return float(ahead.qpos[self._places[self._slots == slot][0]])

    def _fasten(self, index: int) -> FloatArray:
        """Put the strut where its joint values have it; return what its closure is off, (6,).

        These are rotation vector and displacement of the strut's end on the platform, in its axes.
        """
        lib, data = self._lib, self._data
        mine = self._owners == index
        data.qpos[self._places[mine]] = self._joint_values.reshape(-1)[self._slots[mine]]
        data.qvel[self._speeds[mine]] = 0.0
        lib.mj_kinematics(self._model, data)
        turned, back, off = np.zeros(4), np.zeros(4), np.zeros(6)
        if self._welded(index):
            lib.mju_negQuat(back, data.xquat[self._platform])
            lib.mju_mulQuat(turned, back, data.xquat[self._ends[index]])
            lib.mju_quat2Vel(off[:3], turned, 1.0)
        at, axes = data.xpos[self._platform], data.xmat[self._platform].reshape(3, 3)
        off[3:] = axes.T @ (self._tip(index) - at) - self._closures[index, self._seat(index)]
        return off

    def _shift(self, index: int) -> None:
        """Let a closure hold as far off as `_offsets` says."""
        row = self._closures[index].copy()
        row[self._seat(index)] += self._offsets[index, 3:]
        if self._welded(index):
            angle = float(np.linalg.norm(self._offsets[index, :3]))
            axis = self._offsets[index, :3] / angle if angle > 0.0 else np.array([1.0, 0.0, 0.0])
            self._lib.mju_axisAngle2Quat(row[6:10], axis, angle)
        self._model.eq_data[self._closure_ids[index]] = row

    def _tip(self, index: int) -> FloatArray:
        """Return where the end of a strut is, by its own joints (3,), base axes."""
        end, data = self._ends[index], self._data
        place = self._closures[index, slice(0, 3) if self._welded(index) else slice(3, 6)]
        return np.asarray(data.xpos[end] + data.xmat[end].reshape(3, 3) @ place)

    def _welded(self, index: int) -> bool:
        return not self._balls[index]

    def _seat(self, index: int) -> slice:
        """Return which of a closure's numbers are the point on the platform it holds."""
        return slice(3, 6) if self._welded(index) else slice(0, 3)


def library() -> Any:
    """Return the package mujoco; raise `EngineError` if it is missing."""
    try:
        import mujoco
    except ImportError as error:
        reason = f"the engine mujoco needs: pip install 'fault_tolerance[mujoco]' ({error})"
        raise EngineError(reason) from None
    return mujoco


def _spring(
    stiffness: FloatArray | float, inverse_inertia: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return time constants, seconds, and impedances that make constraints so stiff, N/m."""
    compliance = 1.0 / (stiffness * inverse_inertia)
    time = np.sqrt(np.maximum(CONSTRAINT_TIME**2, compliance / (1.0 - _SOFTEST)))
    return time, np.clip(1.0 - compliance / time**2, _SOFTEST, _HARDEST)
