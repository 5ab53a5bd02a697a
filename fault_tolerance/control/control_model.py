# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What a step computes with: the mechanism and the settings, packed for the kernel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fault_tolerance.control.estimate import Estimate, estimate
from fault_tolerance.control.settings import Settings
from fault_tolerance.kernel.array_layout import Law, estimate_of
from fault_tolerance.kernel.compilation import Kernel
from fault_tolerance.kernel.packing import PackedModel, packed_model
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import frozen
from fault_tolerance.mechanism.description import Mechanism


@dataclass(frozen=True, eq=False)
class ControlModel:
    """A mechanism, the settings and the kernel; made by `control_model`."""

    mechanism: Mechanism
    settings: Settings
    kernel: Kernel
    packed: PackedModel
    """Mechanism and settings as the kernel takes them."""

    @cached_property
    def unknown(self) -> Estimate:
        """The estimate before there is any reading: home, but not located."""
        numbers = np.zeros(self.packed.size)
        pose = estimate_of(self.packed.view, numbers).pose
        pose[:] = np.eye(4)
        pose[:3, 3] = self.mechanism.origin
        none = frozen(np.full(len(self.mechanism.actuators), np.nan))
        flags = frozen(np.zeros(len(self.mechanism.struts) + 2 * len(none)))
        return Estimate(self, FailureSet(), flags, none, frozen(numbers))


def law_of(settings: Settings) -> Law:
    """Return what the kernel needs to know of the ``settings``."""
    return Law(
        misfit_limit=settings.misfit_limit,
        threshold=settings.tolerance_threshold,
        slow_below=settings.slow_below,
        hold_below=settings.hold_below,
        stroke_gain=settings.stroke_gain,
        transition_acceleration=settings.max_acceleration,
    )


def control_model(mechanism: Mechanism, settings: Settings, kernel: Kernel) -> ControlModel:
    """Return the model of a ``mechanism`` under control, with ``settings`` and ``kernel``.

    Margins from singularities are relative to home, where the mechanism is made to work. If home
    is singular itself, as of a stretched arm, they are absolute (reference 1.0).
    """
    law = law_of(settings)
    model = ControlModel(mechanism, settings, kernel, packed_model(mechanism, law))
    home = estimate(model, model.unknown, np.zeros(len(mechanism.actuators)), FailureSet())
    jacobian, task = home.arrays.jacobian, mechanism.task
    major = jacobian[task.rows[task.major_rows]]
    sigma = np.linalg.svd(major, compute_uv=False)
    transmission = float(sigma.min()) if 0 < len(major) == len(sigma) else 0.0
    gain = float(np.linalg.norm(jacobian))
    moves, held = transmission > settings.slow_below, gain * settings.slow_below < 1.0
    law = law._replace(
        home_transmission=transmission if moves else 1.0,
        home_gain=gain if moves and held else 1.0,
    )
    return replace(model, packed=packed_model(mechanism, law))
