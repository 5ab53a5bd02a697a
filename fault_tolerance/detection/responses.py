# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the sensors show of a small motion of the setpoints, under each hypothesis.

Drives are springs between their setpoints and their joints; the mechanism settles where the
springs are in balance (docs/detection.md, eq. 1). So every sensor moves by a constant matrix times
the setpoints, one for each hypothesis, at one configuration. Everything is in metres: drives that
turn count at the characteristic length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fault_tolerance.detection.hypotheses import Hypothesis, Symptom
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.subspaces import range_basis, rank_of
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.freedom import attachment_of
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.tolerances import RANK_TOLERANCE

WEAK_SHARE = 0.5
"""How far a weak drive moves of what it is told."""


class Sensors(NamedTuple):
    """Which sensors are believed, besides the encoders."""

    efforts: bool = False
    pose: bool = False


@dataclass(frozen=True, eq=False)
class Responses:
    """Responses of h hypotheses at one configuration; made by `responses`.

    Attributes
    ----------
    hypotheses : tuple of Hypothesis
    matrices : (h, c, N) array
        Motion of every sensor channel per motion of every setpoint, metres: the N encoders, then
        the N efforts over their stiffness, then the six components of the platform's twist.
    drift : (h, c) array
        How the channels move by what is not known: a drive that runs away, a reading that jumps,
        a platform that nothing holds any more. Zero where there is nothing unknown.
    load : (N, n) array
        Orthonormal basis of the motions of the encoders under loads on the platform.
    seen : (c,) array of bool
        The channels there are: no encoders of lost struts, efforts and pose only if believed.
    """

    hypotheses: tuple[Hypothesis, ...]
    matrices: FloatArray
    drift: FloatArray
    load: FloatArray
    seen: BoolArray

    def __repr__(self) -> str:
        """Return how many hypotheses and channels there are."""
        return f'Responses({len(self.hypotheses)} hypotheses, {int(self.seen.sum())} channels)'


def responses(
    rows: StrutRows,
    failures: FailureSet,
    suspects: Sequence[Hypothesis],
    sensors: Sensors | None = None,
) -> Responses:
    """Return what the sensors show under each of the hypotheses ``suspects``.

    Parameters
    ----------
    rows : StrutRows
        Of the configuration.
    failures : FailureSet
        What is known to have failed.
    suspects : sequence of Hypothesis
    sensors : Sensors, optional
        The encoders alone by default.

    Returns
    -------
    Responses
    """
    mechanism, sensors = rows.mechanism, sensors or Sensors()
    count = len(mechanism.actuators)
    present = ~np.isin(mechanism.actuator_names, _actuators_of(mechanism, failures.lost))
    matrices = np.zeros((len(suspects), 2 * count + 6, count))
    drift = np.zeros(matrices.shape[:2])
    balances: dict[FailureSet, _Balance] = {}
    for place, suspect in enumerate(suspects):
        broken = _failures_with(failures, suspect)
        if broken not in balances:
            balances[broken] = _balance(rows, broken)
        matrices[place], drift[place] = _response(mechanism, broken, balances[broken], suspect)
    seen = np.concatenate([
        present, present & sensors.efforts, np.full(6, sensors.pose)
    ])
    matrices[:, ~seen], drift[:, ~seen] = 0.0, 0.0
    yields = np.array([one.encoder == 'load' for one in mechanism.actuators])[:, None]
    healthy = balances.setdefault(failures, _balance(rows, failures))
    load = np.ascontiguousarray(range_basis(yields * healthy.joints))
    return Responses(
        tuple(suspects), frozen(matrices), frozen(drift), frozen(load), frozen(seen)
    )


class _Balance(NamedTuple):
    """Where springs put the mechanism, metres."""

    joints: FloatArray
    twist: FloatArray
    """(N, N) and (6, N): motion of joints and platform per motion of the setpoints that hold."""
    loose: FloatArray
    """(N + 6,): the motion of joints and platform that no spring holds, if there is one."""


def _balance(rows: StrutRows, failures: FailureSet) -> _Balance:
    """Return where the mechanism settles with ``failures`` (docs/detection.md, eq. 1).

    What no spring holds is held by the friction of free drives, and beyond that moves as little
    as it can.
    """
    mechanism = rows.mechanism
    twists, rates = rows.motions(attachment_of(mechanism, failures.lost))
    sprung, free = _sprung(mechanism, failures), _named(mechanism, failures.free)
    root = np.sqrt(relative_stiffness(mechanism)) * sprung
    weighted = root[:, None] * rates
    left, sigma, right = decomposed(weighted)
    rank = rank_of(sigma, 1.0)
    settled = (right[:rank].T / sigma[:rank]) @ left[:, :rank].T * root
    loose = right[rank:].T
    if loose.shape[1] and free.any():
        held = np.linalg.pinv(rates[free] @ loose, rcond=RANK_TOLERANCE)
        settled = settled - loose @ (held @ (rates[free] @ settled))
    motions = np.vstack([rates, twists])
    unheld = np.zeros(len(motions))
    if loose.shape[1]:
        _, _, turned = decomposed(motions @ loose)
        unheld = motions @ loose @ turned[0]
    return _Balance(rates @ settled, twists @ settled, unheld)


def _response(
    mechanism: Mechanism, failures: FailureSet, balance: _Balance, suspect: Hypothesis
) -> tuple[FloatArray, FloatArray]:
    """Return matrix (c, N) and drift (c,) of all channels under one hypothesis."""
    count, symptom = len(mechanism.actuators), suspect.symptom
    motor = np.array([one.encoder == 'motor' for one in mechanism.actuators])
    free, sprung = _named(mechanism, failures.free), _sprung(mechanism, failures)
    lost = _named(mechanism, _actuators_of(mechanism, failures.lost))
    stuck = _named(mechanism, failures.stuck)
    mine = _named(mechanism, (suspect.name,))
    obeyed = np.diag(np.where(stuck, 0.0, 1.0))
    if symptom in _OBEDIENCE:
        obeyed[mine] *= _OBEDIENCE[symptom]
    elif symptom is Symptom.SWAPPED:
        pair = [mechanism.actuator_index(name) for name in (suspect.name, suspect.other)]
        obeyed[pair] = obeyed[pair[::-1]]
    own = lost | (motor & ~free)

    def channels(setpoints: FloatArray, loose: FloatArray) -> FloatArray:
        """Return what all sensors show where the setpoints have moved."""
        joints = balance.joints @ setpoints + loose[:count]
        return np.concatenate([
            np.where(_like(own, joints), setpoints, joints),
            np.where(_like(sprung, joints), setpoints - joints, 0.0),
            balance.twist @ setpoints + loose[count:],
        ])

    matrix = channels(obeyed, np.zeros((count + 6, count)))
    drift = np.zeros(len(matrix))
    if symptom is Symptom.RUNAWAY:
        drift = channels(mine.astype(np.float64), np.zeros(count + 6))
    elif symptom in (Symptom.FREE, Symptom.LOST):
        drift = channels(np.zeros(count), balance.loose)
    elif symptom is Symptom.FROZEN:
        matrix[:count][mine] = 0.0
    elif symptom is Symptom.BIASED:
        drift[:count][mine] = 1.0
    return matrix, drift


_OBEDIENCE = {
    Symptom.STUCK: 0.0, Symptom.RUNAWAY: 0.0, Symptom.WEAK: WEAK_SHARE, Symptom.REVERSED: -1.0,
}
"""How far a drive moves of what it is told."""


def relative_stiffness(mechanism: Mechanism) -> FloatArray:
    """Return the stiffness of every drive in N/m, or ones where the file says nothing of it.

    Parameters
    ----------
    mechanism : Mechanism

    Returns
    -------
    (N,) array
        Drives that turn at the characteristic length.
    """
    given = mechanism.drive_stiffness
    return given / mechanism.rate_scale**2 if np.isfinite(given).all() else np.ones(len(given))


def _sprung(mechanism: Mechanism, failures: FailureSet) -> BoolArray:
    """Return which drives hold their joints: those neither free nor in lost struts."""
    gone = (*failures.free, *_actuators_of(mechanism, failures.lost))
    return np.asarray(~_named(mechanism, gone))


def _failures_with(failures: FailureSet, suspect: Hypothesis) -> FailureSet:
    """Return ``failures`` with the free drive or the lost strut of ``suspect``."""
    stuck, free, lost = failures.stuck, failures.free, failures.lost
    if suspect.symptom is Symptom.FREE:
        free = (*free, suspect.name)
    elif suspect.symptom is Symptom.LOST:
        lost = (*lost, suspect.name)
    return FailureSet(stuck, free, lost)


def _actuators_of(mechanism: Mechanism, struts: Sequence[str]) -> tuple[str, ...]:
    return tuple(one.name for one in mechanism.actuators if one.strut in struts)


def _named(mechanism: Mechanism, names: Sequence[str]) -> BoolArray:
    return np.array([name in names for name in mechanism.actuator_names])


def _like(chosen: BoolArray, array: FloatArray) -> BoolArray:
    return chosen[:, None] if array.ndim > 1 else chosen
