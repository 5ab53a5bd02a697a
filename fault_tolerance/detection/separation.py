# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""By how much hypotheses differ in what the sensors show, and what would tell them apart."""

from __future__ import annotations

import numpy as np

from fault_tolerance.detection.hypotheses import HEALTHY, Hypothesis, Symptom
from fault_tolerance.detection.responses import (
    Responses,
    Sensors,
    flexures_yield,
    relative_stiffness,
    responses,
)
from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    differential_kinematics,
)
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.subspaces import null_space, range_basis
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen
from fault_tolerance.mechanism.freedom import attachment_of


def task_motions(rows: StrutRows, kinematics: DifferentialKinematics) -> FloatArray:
    """Return an orthonormal basis (N, n) of the commands that move the platform, in metres.

    ``kinematics`` are of these ``rows``, failures included.
    """
    scaled = rows.rate_scale[:, None] * kinematics.mapping
    return frozen(np.linalg.qr(scaled)[0]) if scaled.shape[1] else scaled


def self_stress(rows: StrutRows, kinematics: DifferentialKinematics) -> FloatArray:
    """Return an orthonormal basis (N, r) of the commands that only strain the mechanism.

    In metres, with zero rows for the drives that have failed: W^T of docs/detection.md.
    ``kinematics`` are of these ``rows``, failures included.
    """
    motions, active = task_motions(rows, kinematics), kinematics.active
    result = np.zeros((len(active), int(active.sum()) - motions.shape[1]))
    result[active] = null_space(motions[active].T, 1.0)
    return frozen(result)


def still_strains(rows: StrutRows, failures: FailureSet) -> FloatArray:
    """Return an orthonormal basis (N, k) of the commands that strain the mechanism at rest.

    The forces K m of the drives must be in balance, docs/detection.md, eq. 7. Drives that are
    stuck hold as springs do, and yield: their redundancy strains nothing. In metres at the
    ``rows``, with zero rows for the drives that have failed by the ``failures`` in force.
    """
    holding = differential_kinematics(rows, FailureSet((), failures.free, failures.lost))
    active = differential_kinematics(rows, failures).active
    stiffness = relative_stiffness(rows.mechanism)
    pushed = (stiffness / stiffness.max())[:, None] * task_motions(rows, holding)
    if flexures_yield(rows):
        # What the joints bar moves a little, what they allow not at all.
        allowed, _ = rows.motions(attachment_of(rows.mechanism, failures.lost))
        found = responses(rows, failures, (HEALTHY,), Sensors(pose=True))
        pushed = found.matrices[0, -6:].T @ range_basis(allowed)
    basis = null_space(pushed[active].T, 1.0)
    result = np.zeros((len(active), basis.shape[1]))
    result[active] = basis
    return frozen(result)


def separations(found: Responses, commanded: FloatArray) -> FloatArray:
    """Return the largest difference of what the sensors show, per pair of hypotheses, (h, h).

    That is the spectral norm, m/m, of the responses ``found`` to ``commanded`` (N, u),
    orthonormal motions of the setpoints, metres.
    """
    return _largest_differences(found.matrices @ commanded)


def _largest_differences(shown: FloatArray) -> FloatArray:
    """Return the spectral norm of the difference of every two of the matrices (h, c, u)."""
    size = len(shown)
    result = np.zeros((size, size))
    for first in range(size - 1):
        sigma = np.linalg.svd(shown[first + 1 :] - shown[first], compute_uv=False)
        # None where nothing can be commanded; older numpy has no norm of that.
        norms = sigma.max(axis=1, initial=0.0)
        result[first, first + 1 :] = result[first + 1 :, first] = norms
    return frozen(result)


def separated(found: Responses, heard: BoolArray, least: float) -> BoolArray:
    """Return which hypotheses (h, h) can be told apart by some motion of the setpoints.

    Of the responses ``found`` the channels that are ``heard`` (c,) count, and separations above
    ``least``, m/m. A direction that nothing holds can imitate other hypotheses; a runaway or a
    jump cannot.
    """
    matrices = found.matrices[:, heard]
    apart = _largest_differences(matrices) > least
    for place, suspect in enumerate(found.hypotheses):
        drift = found.drift[place, heard]
        if suspect.symptom in (Symptom.RUNAWAY, Symptom.BIASED):
            apart[place] = apart[:, place] = True
            apart[place, place] = False
        elif drift.any():
            direction = drift / np.linalg.norm(drift)
            differences = matrices - matrices[place]
            along = np.einsum('c,hcj->hj', direction, differences)
            across = differences - direction[:, None] * along[:, None]
            like = np.linalg.norm(across, axis=(1, 2)) <= least
            apart[place, like] = apart[like, place] = False
    return apart


def separators(
    rows: StrutRows,
    failures: FailureSet,
    suspects: tuple[Hypothesis, ...],
    sensors: Sensors,
    least: float,
) -> tuple[str, ...]:
    """Return what would tell some of the ``suspects`` apart that the ``sensors`` do not.

    That is of probe, efforts, pose and load. ``rows`` and ``failures`` are of the configuration
    and of what is known to have failed; separations above ``least``, m/m, count.
    """
    if len(suspects) < 2:
        return ()
    motions = task_motions(rows, reconfigured(rows, failures).present)
    everything = np.eye(len(motions))

    def apart(with_sensors: Sensors, commanded: FloatArray) -> int:
        found = responses(rows, failures, suspects, with_sensors)
        return int((separations(found, commanded) > least).sum())

    found, probed = apart(sensors, motions), apart(sensors, everything)
    options = {
        'probe': probed > found,
        'efforts': apart(sensors._replace(efforts=True), everything) > probed,
        'pose': apart(sensors._replace(pose=True), everything) > probed,
        'load': any(one.symptom in (Symptom.FREE, Symptom.LOST) for one in suspects),
    }
    return tuple(name for name, helps in options.items() if helps)
