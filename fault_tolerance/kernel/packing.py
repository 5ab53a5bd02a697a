# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism and its controller's settings as the flat arrays the kernel takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fault_tolerance.kernel.model import Law, Model, model_of
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import CLOSING_BAND, LARGEST_RATE

MOST_COMPLIANCE = 0.99
"""Singular values of constraints do not reach 1 where they matter."""


@dataclass(frozen=True, eq=False)
class PackedModel:
    """The arrays of a model, ``counts`` and ``numbers``, see `model_of`.

    ``measured`` are the same numbers with drives and task in their own units: for the measures p,
    t and h as the paper defines them.
    """

    counts: IntArray
    numbers: FloatArray
    measured: FloatArray

    @property
    def view(self) -> Model:
        """The parts by name."""
        return model_of(self.counts, self.numbers)


def packed_model(mechanism: Mechanism, law: Law) -> PackedModel:
    """Return the model of ``mechanism``; of ``law`` all but the compliances is used.

    ``law.misfit_limit`` is in characteristic lengths here.
    """
    task, n = mechanism.task, len(mechanism.actuators)
    length, point = mechanism.characteristic_length, mechanism.working_point
    scale = np.repeat([length, 1.0], 3)
    if point is None:
        chains = chains_of(mechanism)
        joints, actuator, screws = chains.real.sum(axis=1), chains.actuator, chains.screws
        places, passive = chains.places, (chains.real & (actuator < 0)).sum(axis=1)
        twists, rates = np.zeros((6, 0)), np.zeros((n, 0))
    else:
        joints = passive = np.zeros(0, np.intp)
        actuator, screws = np.zeros((0, 0), np.intp), np.zeros((0, 0, 6))
        places = np.full(n, -1), np.full(n, -1)
        twists = np.zeros((6, point.mapping.shape[1]))
        twists[task.rows] = scale[task.rows, None] * point.jacobian
        rates = mechanism.rate_scale[:, None] * point.mapping
    # Where all drives count alike, the measures depend on their units no more than on a factor.
    measure_scale = scale[task.rows] if np.ptp(mechanism.rate_scale) else np.ones(len(task.rows))
    counts = np.concatenate([
        [*actuator.shape, n, len(task.rows), len(task.major_rows), rates.shape[1]],
        joints, passive, actuator.ravel(), *places,
        task.rows, task.major_rows, task.secondary_rows,
    ]).astype(np.int64)
    compliance = mechanism.compliance
    closing = max(min(CLOSING_BAND * compliance, MOST_COMPLIANCE), compliance)
    law = law._replace(
        compliance=compliance, closing_compliance=closing, misfit_limit=length * law.misfit_limit
    )
    scalars = (length, *law)
    low, high = mechanism.position_limits.T
    speed = np.minimum(mechanism.velocity_limits, LARGEST_RATE)

    def numbers(rate_scale: FloatArray, measured: FloatArray, rates: FloatArray) -> FloatArray:
        parts = (
            scalars, screws, mechanism.origin, rate_scale, scale, measured, speed, -low, high,
            twists, rates,
        )
        return np.concatenate([np.ravel(part) for part in parts]).astype(np.float64)

    true = rates / mechanism.rate_scale[:, None]
    return PackedModel(
        counts,
        numbers(mechanism.rate_scale, measure_scale, rates),
        numbers(np.ones(n), np.ones(len(task.rows)), true),
    )
