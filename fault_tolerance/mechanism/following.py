# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""From one configuration to a near one by the compiled path, and what comes out made a state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fault_tolerance.compiled.activation import Kernels
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.attachment import Attachment
from fault_tolerance.mechanism.chains import Chains
from fault_tolerance.mechanism.constraints import StrutConstraints, drives_at
from fault_tolerance.mechanism.freedom import Freedom, Structure
from fault_tolerance.mechanism.regular import RegularStruts, StrutInverses
from fault_tolerance.mechanism.state import State
from fault_tolerance.mechanism.steps import Closed, Steps
from fault_tolerance.tolerances import CLOSURE_TOLERANCE


def followed(
    kernels: Kernels,
    start: State,
    steps: Steps,
    target: FloatArray,
    limits: tuple[int, float, float, float],
) -> Closed | None:
    """Return the state near ``start`` that fits ``target``, or None: then ask the definition.

    Parameters
    ----------
    kernels : Kernels
    start : State
    steps : Steps
        The way on from there.
    target : (N,) array
    limits : tuple
        How many structural constraints count at ``start``; the compliance; the shortest step
        that needs another one, and the farthest way, in metres.
    """
    regular, attachment = start.regular, steps.attachment
    if regular is None:
        return None
    chains, kept = start.chains, limits[0]
    part = constant_part(chains, attachment)
    taken, *found, outside, along = kernels.follow(
        *part.of_struts(regular), *part.of_attachment, *way_on(start, steps), target, *limits
    )
    if not (taken and outside <= CLOSURE_TOLERANCE):
        return None
    return closed_from(start, attachment, kept, taken, found, (outside, along))


def closed_from(
    start: State,
    attachment: Attachment,
    kept: int,
    taken: int,
    found: Sequence[FloatArray],
    open_: tuple[float, float],
) -> Closed:
    """Return the closed state that the compiled path has found from ``start``.

    Parameters
    ----------
    start : State
    attachment : Attachment
    kept : int
        Structural constraints that count.
    taken : int
        Steps.
    found : sequence of arrays
        As `fault_tolerance.compiled.following.follow` returns them.
    open_ : tuple of float
        See `Closed.open`.
    """
    chains, regular = start.chains, start.regular
    assert regular is not None
    (
        pose, values, reached, openings, joints, structure, rows, left, sigma, right,
        twists, rates, turned, gains, mixed, closing, fit,
    ) = found
    part = constant_part(chains, attachment)
    inverses = StrutInverses(joints, structure, rows)
    in_use = structure if attachment.complete else structure[part.in_use]
    freedom = Freedom(twists, rates, turned, gains, mixed)
    key = attachment.lost, kept
    constraints = StrutConstraints(
        structure,
        regular.structure_strut,
        rows,
        lambda: drives_at(chains, values, pose),
        inverses,
        {attachment.lost: Structure(in_use, part.owners, left, sigma, right)},
        {key: freedom},
    )
    ahead: dict[tuple[tuple[str, ...], int], Any] = {}
    if freedom.determined:
        held = rows if attachment.complete else rows[attachment.places]
        ahead[key] = Steps(
            attachment, chains, inverses, in_use, part.owners, closing if kept else None, held, fit
        )
    state = State(chains, pose, values, reached, openings, constraints, regular, ahead)
    closed = Closed(state, attachment, kept, True, taken)
    closed.__dict__['open'] = open_
    return closed


def way_on(start: State, steps: Steps) -> tuple[FloatArray, ...]:
    """Return the arguments of the compiled path that are of the configuration before."""
    closing = steps.closing
    if closing is None:
        closing = constant_part(start.chains, steps.attachment).nothing
    return (
        start.pose, start.joint_values, start.openings, steps.inverses.joints, steps.structure,
        closing, steps.inverses.actuator_rows, steps.fit,
    )


@dataclass(frozen=True, eq=False)
class ConstantPart:
    """What does not change from one configuration to the next, as the compiled path takes it.

    Attributes
    ----------
    chains : Chains
    counts : (s,) int array
        Joints of each strut.
    of_attachment : tuple
        Which struts are attached, the places of their drives, and `in_use` and `owners`.
    in_use, owners : (g,) int array
        The structural rows of attached struts, and whose each is.
    nothing : (6, g) array
        Zeros.
    """

    chains: Chains
    counts: IntArray
    of_attachment: tuple[Any, ...]
    in_use: IntArray
    owners: IntArray
    nothing: FloatArray

    def of_struts(self, regular: RegularStruts, *further: float) -> tuple[Any, ...]:
        """Return the arguments that are of the struts; ``further`` limits go with theirs."""
        chains = self.chains
        limits = np.array([*regular.limits, *further]) if further else regular.limits
        return (
            chains.screws, self.counts, regular.sizes, regular.filling, chains.home[:3, 3],
            *chains.places, chains.drive_sizes, limits, chains.length,
        )


@lru_cache(maxsize=64)
def constant_part(chains: Chains, attachment: Attachment) -> ConstantPart:
    """Return the constant part for ``attachment`` (kept: asked for every cycle)."""
    assert chains.regular is not None
    owners = chains.regular.structure_strut
    in_use = np.flatnonzero(attachment.attached[owners])
    owners = owners[in_use]
    return ConstantPart(
        chains,
        chains.real.sum(axis=1, dtype=np.intp),
        (attachment.attached, attachment.places, in_use, owners),
        in_use,
        owners,
        np.zeros((6, len(in_use))),
    )
