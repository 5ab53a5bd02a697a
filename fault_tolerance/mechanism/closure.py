# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Loop closure by Gauss-Newton steps on the strut rows.

The unknowns are the platform pose and every joint. A step makes the struts' tips meet the
platform: their structural rows are solved first, along the directions that the flexures do not
absorb; the freedom left fits the actuator values; the other joints follow, strut by strut
(docs/theory.md, section 3).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.evaluation import State, evaluated
from fault_tolerance.mechanism.freedom import Structure, attachment_of, motions, structure_of
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.mechanism.screws import displaced
from fault_tolerance.mechanism.targets import Level, Step, Target
from fault_tolerance.tolerances import CLOSURE_TOLERANCE, LAST_STEP, LONGEST_STEP, RANK_TOLERANCE

_MOST_ITERATIONS = 60


@dataclass(frozen=True, eq=False)
class Closed:
    """A state after loop closure, with its certificate."""

    state: State
    converged: bool
    iterations: int
    residual: float
    """Metres left open outside the directions that the flexures absorb."""
    strain: float
    """Metres open along the directions they absorb."""

    def __repr__(self) -> str:
        words = 'converged' if self.converged else 'not converged'
        return f'Closed({words}, {self.iterations} iterations, open {self.residual:.1e} m)'


class Closure:
    """Closes the loops of ``mechanism`` without its struts ``lost``.

    Structural constraints up to ``compliance`` are absorbed; the mechanism's own by default.
    """

    def __init__(
        self, mechanism: Mechanism, lost: Collection[str] = (), compliance: float | None = None
    ) -> None:
        self.mechanism = mechanism
        self.attachment = attachment_of(mechanism, lost)
        self._compliance = mechanism.compliance if compliance is None else compliance
        self._chains = chains_of(mechanism)

    def __repr__(self) -> str:
        return f'Closure({self.mechanism.name!r}, {self.attachment})'

    def solved(self, start: State, target: Target) -> Closed:
        """Return the closed state reached from ``start`` in which ``target`` is fitted best."""
        state, structure = start, self._structure(start)
        for iteration in range(1, _MOST_ITERATIONS + 1):
            state, length = self._stepped(state, structure, target)
            before, structure = structure, self._structure(state)
            # In an overconstrained mechanism the freedom to fit shows only once the loops close.
            arrived = length <= LAST_STEP * self.mechanism.characteristic_length
            if arrived and structure.kept == before.kept:
                found = self.certified(state, True, iteration)
                if found.residual <= CLOSURE_TOLERANCE:
                    return found
            if not np.isfinite(length):
                break
        return self.certified(state, False, iteration)

    def certified(self, state: State, converged: bool, iterations: int) -> Closed:
        """Return ``state`` and what is open in it; ``converged`` and ``iterations`` as given."""
        residuals = state.residuals(self._structure(state), self.attachment)
        return Closed(state, converged, iterations, *residuals)

    def _structure(self, state: State) -> Structure:
        return structure_of(state.constraints, self.attachment, self._compliance)

    def _stepped(
        self, state: State, structure: Structure, target: Target
    ) -> tuple[State, float]:
        """Return the state after one Gauss-Newton step, and the step's length in metres."""
        twist, rates = self._step(state, structure, target)
        joint_rates = self._joint_rates(state, state.openings + twist, rates)
        if not (np.isfinite(twist).all() and np.isfinite(joint_rates).all()):
            return state, np.inf  # readings near the largest floating-point number
        length = max(_length(twist), _length(rates * self.mechanism.rate_scale))
        longest = LONGEST_STEP * self.mechanism.characteristic_length
        shortened = min(1.0, longest / length) if length > 0.0 else 1.0
        pose = displaced(state.pose, shortened * twist / self._chains.scale)
        values = state.joint_values + shortened * joint_rates
        return evaluated(self.mechanism, pose, values), length

    def _joint_rates(self, state: State, twists: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the rates (s, k) with which the joints of each strut follow its twist.

        The scaled ``twists`` (s, 6) make the struts meet the platform; ``rates`` (N,) are those of
        the actuators. Actuators in lost struts follow like passive joints.
        """
        places, held = self._chains.places, self.attachment.held
        result = np.zeros_like(state.joint_values)
        follows = self._chains.real.copy()
        driven = places[0][held], places[1][held]
        result[driven], follows[driven] = rates[held], False
        columns = np.swapaxes(state.screws, 1, 2) * self._chains.scale[:, None]
        rest = twists - np.einsum('sik,sk->si', columns, result)
        inverse = np.linalg.pinv(columns * follows[:, None, :], rcond=RANK_TOLERANCE)
        return np.asarray(result + np.einsum('ski,si->sk', inverse, rest))

    def _step(
        self, state: State, structure: Structure, target: Target
    ) -> tuple[FloatArray, FloatArray]:
        """Return the scaled platform twist (6,) and the actuator rates (N,) of one step."""
        kept, constraints = structure.kept, state.constraints
        misclosure = np.einsum('ij,ij->i', structure.rows, state.openings[structure.struts])
        strains = structure.left[:, :kept].T @ misclosure / structure.sigma[:kept]
        twist = -structure.right[:kept].T @ strains
        moved = state.openings[self._chains.places[0]] + twist
        rates = np.einsum('ij,ij->i', constraints.actuator_rows, moved)

        twists, along = motions(constraints, self.attachment, structure.allowed)
        along = along / constraints.rate_scale[:, None]
        held = self.attachment.held
        step = Step(state, held, twist, rates, twists, along)
        fitted = _solution(target.levels(step), along.shape[1])
        rates = np.where(held, rates + along @ fitted, 0.0)
        return twist + twists @ fitted, rates


def _solution(levels: Sequence[Level], count: int) -> FloatArray:
    """Return the shortest (count,) that meets each of ``levels`` as far as earlier ones allow."""
    solution, idle = np.zeros(count), np.eye(count)
    for matrix, wanted, size in levels:
        left, sigma, right = decomposed(matrix @ idle)
        rank = int((sigma > RANK_TOLERANCE * size).sum())
        error = left[:, :rank].T @ (wanted - matrix @ solution)
        solution = solution + idle @ (right[:rank].T @ (error / sigma[:rank]))
        idle = idle @ right[rank:].T
    return solution


def _length(vector: FloatArray) -> float:
    """Return the Euclidean length of ``vector``; infinite only where no number can say it."""
    largest = float(np.abs(vector).max(initial=0.0))
    return largest * float(np.linalg.norm(vector / largest)) if largest > 0.0 else 0.0
