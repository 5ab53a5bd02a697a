# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Struts put together to a mechanism, with a task and a length where none are given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf

import numpy as np

from fault_tolerance.analysis.scene import scene_of
from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.kinematics.subspaces import rank_of, singular_values
from fault_tolerance.machines.leg_types import Leg, strut_of
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import home_configuration
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator, Strut
from fault_tolerance.mechanism.task import COORDINATES, Task


def assembled_legs(name: str, legs: Sequence[Leg], origin: FloatArray | None = None) -> Mechanism:
    """Return the mechanism ``name`` on ``legs``, with the platform's ``origin`` (3,), metres.

    Without one: the middle of the points at the platform.
    """
    struts = tuple(strut_of(leg, number) for number, leg in enumerate(legs, start=1))
    if origin is None:
        # Half a micrometre is nothing beside how well points are known.
        origin = np.array([leg.platform for leg in legs]).mean(axis=0).round(6)
    return assembled(name, struts, origin)


def require_height(legs: Sequence[Leg], source: str) -> None:
    """Refuse ``legs`` of ``source`` that all lie in one plane with every point of theirs.

    MechanismError with the likely cause.
    """
    points = np.array([point for leg in legs for point in leg.points])
    sigma = singular_values(points - points.mean(axis=0))
    if len(legs) > 2 and len(sigma) > 2 and sigma[2] <= 1e-6 * sigma[0]:
        reason = ('all points lie in one plane: are those of the platform counted from its own '
                  'frame? (--origin X,Y,Z --relative, with the origin at home)')
        raise MechanismError(source, '', reason)


def assembled(
    name: str,
    struts: Sequence[Strut],
    origin: FloatArray,
    *,
    actuators: Sequence[Actuator] = (),
    length: float | None = None,
    compliance: float = 0.0,
) -> Mechanism:
    """Return the mechanism ``name`` of ``struts``, commanded in as much as it can do.

    Parameters
    ----------
    name : str
    struts : sequence of Strut
    origin : (3,) array
        Of the platform frame at home, metres, base axes.
    actuators : sequence of Actuator
        In their order; by default strut by strut.
    length : float, optional
        The characteristic length, metres; by default the mean distance of the points where the
        struts hold the platform from the middle of them.
    compliance : float
        See `Mechanism`.

    Returns
    -------
    Mechanism
        The task coordinates are as many as the drives control, those that are least dependent on
        each other; all of them are major.
    """
    whole = Mechanism(
        name, Task(COORDINATES), tuple(struts), tuple(actuators), origin, length or 1.0, compliance
    )
    if length is None:
        corners = scene_of(home_configuration(whole)).corners
        spread = float(np.linalg.norm(corners - corners.mean(axis=0), axis=1).mean())
        reach = float(np.linalg.norm(whole.origin)) or 1.0
        length = float(f'{spread if spread > 1e-6 * reach else reach:.3g}')
        whole = replace(whole, characteristic_length=length)
    kinematics = differential_kinematics(home_rows(whole))
    metric = np.repeat([length, 1.0], 3)[:, None]
    return replace(whole, task=Task(_independent(metric * kinematics.twist_jacobian)))


def with_task(
    mechanism: Mechanism, coordinates: Sequence[str] = (), major: Sequence[str] = ()
) -> Mechanism:
    """Return ``mechanism`` with other task ``coordinates``, and with those ``major``.

    Both stay where neither is named; all coordinates are major where only they are.
    """
    if not (coordinates or major):
        return mechanism
    task = Task(tuple(coordinates) or mechanism.task.coordinates, tuple(major))
    return replace(mechanism, task=task)


def with_limits(
    mechanism: Mechanism, stroke: tuple[float, float], rate: tuple[float, float]
) -> Mechanism:
    """Return ``mechanism`` with limits for all its drives that have none.

    ``stroke`` (both ways from home) and ``rate`` are for drives that slide, metres, and for those
    that turn, radians.
    """
    def limited(drive: Actuator) -> Actuator:
        place = int(drive.kind == 'revolute')
        both_ways, fastest = (-stroke[place], stroke[place]), min(drive.velocity, rate[place])
        unlimited = drive.position == (-inf, inf)
        return replace(
            drive, position=both_ways if unlimited else drive.position, velocity=fastest
        )

    return mechanism.with_actuators(map(limited, mechanism.actuators))


def _independent(rows: FloatArray) -> tuple[str, ...]:
    """Return the names of as many of the six ``rows`` as their rank, greedily the longest left."""
    left, chosen = rows.copy(), []
    for _ in range(max(rank_of(singular_values(rows)), 1)):
        lengths = np.linalg.norm(left, axis=1)
        # Of equal ones the first: rounding must not choose.
        best = int(np.argmax(lengths > 0.999 * lengths.max())) if lengths.any() else 0
        chosen.append(best)
        if lengths[best]:
            way = left[best] / lengths[best]
            left = left - np.outer(left @ way, way)
            left[best] = 0.0
    return tuple(COORDINATES[index] for index in sorted(chosen))
