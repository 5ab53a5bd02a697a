# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The built-in engine: elastic, quasi-static, independent of the controller's kinematics."""

from __future__ import annotations

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.breakable import BreakablePlant
from fault_tolerance.simulation.elastic import Structure, settled, strut_stiffnesses
from fault_tolerance.simulation.plant_settings import PlantSettings

_RELEASE_STEPS = 4
_RELEASE_STEP = 0.01


class ElasticPlant(BreakablePlant):
    """A mechanism with elastic struts, driven by rate commands and broken on request.

    Actuators are springs about the position their drive holds, and springs hold every strut's
    end to the platform in all six directions: much stiffer ones, except where the strut's joints
    bar the motion and flexures give way. The platform rests where the energy is least, so a
    drive that contradicts the others strains the structure instead of being impossible, and the
    strain appears as `PlantState.efforts`. The mechanism is known by its joint axes and points
    only; no Jacobian of the controller's is used.

    A stuck actuator keeps its setpoint; a free one has no spring and is carried along, between
    the ends of its stroke; a lost strut's passive joints stay where they were. Parameters are
    those of `BreakablePlant`.

    Notes
    -----
    Not modelled: inertia and vibration; gravity; friction but for `PlantSettings.breakaway`;
    backlash; creep and hysteresis of piezo stacks; restoring forces, fatigue and travel of
    flexures; limits on force; temperature; quantisation and dropouts of sensors; dead time of
    drives; end stops of the platform and of passive joints; collisions; links that bend anywhere
    but at their ends. Speeds are mean values over a step.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        settings: PlantSettings | None = None,
        rng: np.random.Generator | int = 0,
    ) -> None:
        super().__init__(mechanism, settings, rng)
        self._strut_stiffness = strut_stiffnesses(
            self._linkage, self.settings.structure_stiffness, self.settings.flexure_stiffness
        )
        self._state = self._observed()

    @property
    def strut_points(self) -> tuple[FloatArray, ...]:
        """For each strut the points (k, 3) on its turning axes, base to platform, metres."""
        points = self._linkage.placement(self._joint_values).points
        turning = self._linkage.turning
        return tuple(points[i, turning[i]] for i in range(len(points)))

    def _advance(self, dt: float) -> None:
        self._drive(dt)
        self._pose, self._joint_values = settled(
            self._linkage, self._structure(), self._pose, self._joint_values, dt
        )

    def _structure(self) -> Structure:
        """Return the springs and dampers as the faults leave them."""
        settings, linkage = self.settings, self._linkage
        stiffness, rest = self._stiffness, self._rests
        free = self._free
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

    def _efforts(self) -> FloatArray:
        return self._stiffness * (self._rests - self._values)

    def _released(self, index: int) -> float:
        pose, joint_values = self._pose, self._joint_values
        # Long enough for the strain to go, too short for a drift to matter.
        for _ in range(_RELEASE_STEPS):
            pose, joint_values = settled(
                self._linkage, self._structure(), pose, joint_values, _RELEASE_STEP
            )
        return float(joint_values.flat[self._linkage.slots[index]])

    def _fasten(self, index: int) -> FloatArray:
        placement = self._linkage.placement(self._joint_values)
        return np.asarray(self._linkage.gaps(placement, self._pose)[index])
