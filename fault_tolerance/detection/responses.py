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
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from fault_tolerance.detection.hypotheses import HEALTHY, Hypothesis, Symptom
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.subspaces import range_basis, rank_of
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.freedom import attachment_of, motions
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
        Orthonormal basis of the motions of the encoders under loads on the platform, as far as
        the joints allow them: any motion whatever would fit what they bar, too.
    """

    hypotheses: tuple[Hypothesis, ...]
    matrices: FloatArray
    drift: FloatArray
    load: FloatArray

    def __repr__(self) -> str:
        """Return how many hypotheses there are."""
        return f'Responses({len(self.hypotheses)} hypotheses)'


def responses(
    rows: StrutRows,
    failures: FailureSet,
    suspects: Sequence[Hypothesis],
    sensors: Sensors | None = None,
    found: Sequence[Hypothesis] = (),
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
    found : sequence of Hypothesis
        What has failed besides; the drives may still be commanded.

    Returns
    -------
    Responses
    """
    mechanism, sensors = rows.mechanism, sensors or Sensors()
    count = len(mechanism.actuators)
    matrices = np.zeros((len(suspects), 2 * count + 6, count))
    drift = np.zeros(matrices.shape[:2])
    yielding = cache(partial(_yielding, rows))
    known = _failures_with(mechanism, failures, HEALTHY, found)
    alike: dict[FailureSet, list[int]] = {}
    for place, suspect in enumerate(suspects):
        broken = known
        if suspect.symptom in _OTHER_BALANCE:
            broken = _failures_with(mechanism, failures, suspect, found)
        alike.setdefault(broken, []).append(place)
    for broken, places in alike.items():
        matrices[places], drift[places] = _responses(
            mechanism, broken, yielding(broken.lost), [suspects[place] for place in places], found
        )
    held = yielding(failures.lost).held
    seen = np.concatenate([held, held & sensors.efforts, np.full(6, sensors.pose)])
    matrices[:, ~seen], drift[:, ~seen] = 0.0, 0.0
    yields = np.array([one.encoder == 'load' for one in mechanism.actuators])[:, None]
    rigid = _balance(mechanism, known, yielding(known.lost, rigid=True))
    load = np.ascontiguousarray(range_basis(yields * rigid.joints))
    return Responses(tuple(suspects), frozen(matrices), frozen(drift), frozen(load))


class _Yielding(NamedTuple):
    """The motions that springs hold where some struts are lost, whatever else has failed."""

    held: BoolArray
    """(N,): the drives of struts that are not lost."""
    twists: FloatArray
    rates: FloatArray
    """(6, c) and (N, c): of the platform and the joints."""
    barred: FloatArray
    """(b, c): in directions that joints bar, by the root of their stiffness; none if rigid."""


def _yielding(rows: StrutRows, lost: tuple[str, ...], *, rigid: bool = False) -> _Yielding:
    """Return the motions without the ``lost`` struts; if ``rigid`` what joints bar holds."""
    attachment = attachment_of(rows.mechanism, lost)
    if rigid or not flexures_yield(rows):
        twists, rates = rows.motions(attachment)
        none = np.zeros((0, twists.shape[1]))
        return _Yielding(attachment.held, rows.in_space(twists), rates, none)
    twists, rates = motions(rows.constraints, attachment, np.eye(6))
    barred = rows.structure[attachment.attached[rows.structure_strut]]
    stiff = np.sqrt(rows.mechanism.flexure_stiffness) * (barred @ twists)
    return _Yielding(attachment.held, twists, rates, stiff)


class _Balance(NamedTuple):
    """Where springs put the mechanism, metres."""

    joints: FloatArray
    twist: FloatArray
    """(N, N) and (6, N): motion of joints and platform per motion of the setpoints that hold."""
    loose: FloatArray
    """(N + 6,): the motion of joints and platform that no spring holds, if there is one."""
    sprung: BoolArray
    """(N,): the drives that hold their joints: neither free nor in lost struts."""


def _balance(mechanism: Mechanism, failures: FailureSet, yielding: _Yielding) -> _Balance:
    """Return where the mechanism settles with ``failures`` (docs/detection.md, eq. 1).

    What no spring holds is held by the friction of free drives, and beyond that moves as little
    as it can.
    """
    _, twists, rates, barred = yielding
    free = _named(mechanism, failures.free)
    sprung = yielding.held & ~free
    root = np.sqrt(relative_stiffness(mechanism)) * sprung
    largest = root.max(initial=1.0)
    root, barred = root / largest, barred / largest
    left, sigma, right = decomposed(np.vstack([root[:, None] * rates, barred]))
    rank = rank_of(sigma, 1.0)
    settled = (right[:rank].T / sigma[:rank]) @ left[: len(root), :rank].T * root
    loose = right[rank:].T
    if loose.shape[1] and free.any():
        held = np.linalg.pinv(rates[free] @ loose, rcond=RANK_TOLERANCE)
        settled = settled - loose @ (held @ (rates[free] @ settled))
    unheld = np.zeros(len(rates) + len(twists))
    if loose.shape[1]:
        ways = np.vstack([rates, twists]) @ loose
        _, _, turned = decomposed(ways)
        unheld = ways @ turned[0]
    return _Balance(rates @ settled, twists @ settled, unheld, sprung)


def _responses(
    mechanism: Mechanism,
    failures: FailureSet,
    yielding: _Yielding,
    suspects: Sequence[Hypothesis],
    found: Sequence[Hypothesis],
) -> tuple[FloatArray, FloatArray]:
    """Return matrices (g, c, N) and drifts (g, c) of hypotheses that share one balance."""
    balance = _balance(mechanism, failures, yielding)
    count, sprung = len(mechanism.actuators), balance.sprung
    motor = np.array([one.encoder == 'motor' for one in mechanism.actuators])
    own = ~yielding.held | (motor & ~_named(mechanism, failures.free))
    stuck = _named(mechanism, failures.stuck)

    def channels(setpoints: FloatArray) -> FloatArray:
        """Return what all sensors show (..., c, k) where the setpoints have moved (..., N, k)."""
        joints = balance.joints @ setpoints
        return np.concatenate([
            np.where(own[:, None], setpoints, joints),
            np.where(sprung[:, None], setpoints - joints, 0.0),
            balance.twist @ setpoints,
        ], axis=-2)

    places = {name: place for place, name in enumerate(mechanism.actuator_names)}
    obeyed = np.tile(np.diag(np.where(stuck, 0.0, 1.0)), (len(suspects), 1, 1))
    for matrix, suspect in zip(obeyed, suspects, strict=True):
        for one in _present(suspect, found):
            mine = places.get(one.name, 0)
            if one.symptom in _OBEDIENCE:
                matrix[mine] *= _OBEDIENCE[one.symptom]
            elif one.symptom is Symptom.SWAPPED:
                pair = [mine, places[one.other]]
                matrix[pair] = matrix[pair[::-1]]
    matrices, alone = channels(obeyed), channels(np.eye(count))
    loose = np.concatenate([
        np.where(own, 0.0, balance.loose[:count]),
        np.where(sprung, -balance.loose[:count], 0.0),
        balance.loose[count:],
    ])
    drifts = np.zeros(matrices.shape[:2])
    for place, suspect in enumerate(suspects):
        mine = places.get(suspect.name, 0)
        if suspect.symptom is Symptom.RUNAWAY:
            drifts[place] = alone[:, mine]
        elif suspect.symptom in (Symptom.FREE, Symptom.LOST):
            drifts[place] = loose
        elif suspect.symptom is Symptom.BIASED:
            drifts[place, mine] = 1.0
        for one in _present(suspect, found):
            if one.symptom is Symptom.FROZEN:
                frozen_one = places[one.name]
                matrices[place, frozen_one] = drifts[place, frozen_one] = 0.0
    return matrices, drifts


_OBEDIENCE = {
    Symptom.STUCK: 0.0, Symptom.RUNAWAY: 0.0, Symptom.WEAK: WEAK_SHARE, Symptom.REVERSED: -1.0,
}
"""How far a drive moves of what it is told."""


def relative_stiffness(mechanism: Mechanism) -> FloatArray:
    """Return the stiffness of every drive (N,) of ``mechanism``, N/m; ones where it is not known.

    Drives that turn count at the characteristic length.
    """
    given = mechanism.drive_stiffness
    return given / mechanism.rate_scale**2 if np.isfinite(given).all() else np.ones(len(given))


def flexures_yield(rows: StrutRows) -> bool:
    """Return whether ``rows`` say how stiff everything is: drives, and what the joints bar."""
    mechanism = rows.mechanism
    known = np.isfinite([*mechanism.drive_stiffness, mechanism.flexure_stiffness]).all()
    return bool(known) and rows.given is None


_OTHER_BALANCE = (Symptom.FREE, Symptom.LOST, Symptom.HEALED)
"""Symptoms that change what holds the mechanism."""


def _present(suspect: Hypothesis, found: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return what is wrong if ``suspect`` is true, besides what has been ``found``."""
    if suspect.symptom is Symptom.HEALED:
        return tuple(one for one in found if one.name != suspect.name)
    return (*found, suspect)


def _failures_with(
    mechanism: Mechanism, failures: FailureSet, suspect: Hypothesis, found: Sequence[Hypothesis]
) -> FailureSet:
    """Return ``failures`` with the free drives and lost struts if ``suspect`` is true."""
    healed = suspect.name if suspect.symptom is Symptom.HEALED else None
    further = [
        f'{one.symptom.value}:{one.name}' for one in _present(suspect, found)
        if one.symptom in (Symptom.FREE, Symptom.LOST)
    ]
    if not further and healed is None:
        return failures
    kept = (one for one in failures.failures if one.name != healed)
    return failure_set(mechanism, [*kept, *further])


def _named(mechanism: Mechanism, names: Sequence[str]) -> BoolArray:
    return np.array([name in names for name in mechanism.actuator_names])
