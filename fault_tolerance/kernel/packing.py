# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A mechanism and its controller's settings as the flat arrays the kernel takes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fault_tolerance.kernel.array_layout import (
    N_COUNT_OFFSETS,
    N_ESTIMATE_OFFSETS,
    N_NUMBER_OFFSETS,
    N_SCALARS,
    N_SIZES,
    Law,
    Model,
    estimate_sizes,
    model_of,
)
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import CLOSING_BAND, LARGEST_RATE

MOST_COMPLIANCE = 0.99
"""While loops are closed: a constraint that one strut alone imposes has the singular value 1, and
must not count as absorbed."""


@dataclass(frozen=True, eq=False)
class PackedModel:
    """The arrays of a model, ``counts`` and ``numbers``, see `model_of`.

    ``measured`` are the same numbers with actuators and task in their own units: for the measures
    p, t and h as the paper defines them. ``work`` is the scratch memory of the functions that
    take them.
    """

    counts: IntArray
    numbers: FloatArray
    measured: FloatArray
    work: FloatArray

    @cached_property
    def view(self) -> Model:
        """The parts by name."""
        return model_of(self.counts, self.numbers, self.work)

    @cached_property
    def size(self) -> int:
        """How many numbers an estimate has."""
        return int(self.view.offsets[-1])

    @cached_property
    def pose(self) -> slice:
        """Where the pose is among them."""
        return slice(*self.view.offsets[3:5].tolist())


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
        strut, joint = chains.places
        passive = (chains.real & (actuator < 0)).sum(axis=1)
        twists, rates = np.zeros((0, 6)), np.zeros((0, n))
    else:
        joints = passive = np.zeros(0, np.intp)
        actuator, screws = np.zeros((0, 0), np.intp), np.zeros((0, 0, 6))
        strut = joint = np.full(n, -1)
        twists = np.zeros((point.mapping.shape[1], 6))
        twists[:, task.rows] = scale[task.rows] * point.jacobian.T
        rates = mechanism.rate_scale * point.mapping.T
    # Where all actuators have the same unit, the measures are quotients in which it cancels.
    measure_scale = scale[task.rows] if np.ptp(mechanism.rate_scale) else np.ones(len(task.rows))
    counted = (
        joints, passive, actuator, strut, joint, task.rows,
        np.concatenate([task.major_rows, task.secondary_rows]),
    )
    compliance = mechanism.compliance
    closing = max(min(CLOSING_BAND * compliance, MOST_COMPLIANCE), compliance)
    law = law._replace(
        compliance=compliance, closing_compliance=closing, misfit_limit=length * law.misfit_limit
    )
    scalars = (length, *law)
    low, high = mechanism.position_limits.T
    speed = np.minimum(mechanism.velocity_limits, LARGEST_RATE)

    def parts(rate_scale: FloatArray, measured: FloatArray) -> list[FloatArray]:
        motions = np.hstack([twists, rates / (mechanism.rate_scale / rate_scale)])
        return [screws, mechanism.origin, rate_scale, scale, measured, speed, -low, high, motions]

    scaled = parts(mechanism.rate_scale, measure_scale)
    s, k = actuator.shape
    sizes = [s, k, n, len(task.rows), len(task.major_rows), len(rates)]
    first = N_SIZES + N_COUNT_OFFSETS + N_NUMBER_OFFSETS + N_ESTIMATE_OFFSETS
    offsets = np.concatenate([
        sizes, _offsets(first, [np.size(one) for one in counted]),
        _offsets(N_SCALARS, [np.size(one) for one in scaled]),
        _offsets(0, estimate_sizes(s, k, n)),
    ])
    true = parts(np.ones(n), np.ones(len(task.rows)))
    return PackedModel(
        np.concatenate([offsets, *map(np.ravel, counted)]).astype(np.int64),
        np.concatenate([scalars, *map(np.ravel, scaled)]),
        np.concatenate([scalars, *map(np.ravel, true)]),
        np.empty(workspace_size(s, k, n, len(task.rows))),
    )


def _offsets(begin: int, sizes: list[int]) -> IntArray:
    """Return where parts of these sizes begin, one after the other, and where the last ends."""
    return np.cumsum([begin, *sizes])


def workspace_size(s: int, k: int, n: int, task: int) -> int:
    """Return how much scratch memory is enough: ``s`` struts of ``k`` joints, ``n`` actuators.

    Of estimates, structures of at most six rows a strut, and kinematics of at most ``6 + n``
    motions several are in use at the same time, and all joints once; ``task`` coordinates.
    """
    estimate = 64 + (60 + 8 * k) * s + (20 + 2 * n) * n
    structure = 200 + 160 * s
    kinematics = (6 + n) * (42 + 9 * n + 2 * task)
    return 2 * estimate + 7 * s * k + 3 * structure + 8 * kinematics
