# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Loop closure by Gauss-Newton steps on the strut rows.

The unknowns are the platform pose and every joint. A step makes the struts' tips meet the
platform: their structural rows are solved first, along the directions the flexures do not
absorb; what freedom is left fits the actuator values; passive joints follow, strut by strut
(docs/theory.md, section 3).
"""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import dataclass

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.chains import Chains, chains_of, forward_kinematics
from fault_tolerance.mechanism.constraints import (
    StrutConstraints,
    decomposed,
    strut_constraints,
)
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.screws import difference, displaced
from fault_tolerance.mechanism.tolerances import CLOSURE_TOLERANCE, RANK_TOLERANCE

_MOST_ITERATIONS = 60
# Steps longer than this many characteristic lengths are shortened: linearisation ends there.
_LONGEST_STEP = 0.3
# A Newton step of relative length e leaves an error of about e squared.
_LAST_STEP_FITTED = 1e-4
_LAST_STEP_SOLVED = 1e-9


@dataclass(frozen=True, eq=False)
class State:
    """A pose, joint values, and everything that follows from them.

    Attributes
    ----------
    pose : (4, 4) array
    joint_values : (s, k) array
    actuator_values : (N,) array
    screws : (s, k, 6) array
        Joint twists, v at the platform's origin.
    openings : (s, 6) array
        From each strut's tip to the platform, scaled: metres.
    constraints : StrutConstraints
    """

    pose: FloatArray
    joint_values: FloatArray
    actuator_values: FloatArray
    screws: FloatArray
    openings: FloatArray
    constraints: StrutConstraints


def evaluated(chains: Chains, count: int, pose: FloatArray, joint_values: FloatArray) -> State:
    """Return the state at ``pose`` and ``joint_values`` of a mechanism with N = count drives."""
    screws, tips = forward_kinematics(chains, joint_values, pose[:3, 3])
    return State(
        pose,
        joint_values,
        joint_values[chains.places],
        screws,
        difference(pose, tips) * chains.scale,
        strut_constraints(chains, screws, count),
    )


def absorption_threshold(sigma: FloatArray, compliance: float) -> float:
    """Return the singular value up to which structural constraints are absorbed."""
    return max(compliance, RANK_TOLERANCE * float(sigma.max(initial=0.0)))


class Closure:
    """Closes the loops of a mechanism from which some struts may have been lost."""

    def __init__(self, mechanism: Mechanism, lost: AbstractSet[str]) -> None:
        self.mechanism = mechanism
        self._chains = chains_of(mechanism)
        self._attached = np.array([name not in lost for name in mechanism.strut_names])
        self._complete = bool(self._attached.all())
        self.held = np.array([actuator.strut not in lost for actuator in mechanism.actuators])

    def solved(
        self, state: State, target: FloatArray, *, nearest_home: bool
    ) -> tuple[State, bool, int]:
        """Step from ``state`` until the loops close and ``target`` is fitted.

        Parameters
        ----------
        state : State
        target : (N,) array
            Actuator values to be met in the least-squares sense, NaN where there is none.
        nearest_home : bool
            Whether what the target leaves free is spent on actuator values near home; otherwise
            it stays where it is.

        Returns
        -------
        state : State
        converged : bool
        iterations : int
        """
        scale = self.mechanism.characteristic_length
        last = (_LAST_STEP_SOLVED if nearest_home else _LAST_STEP_FITTED) * scale
        for iteration in range(1, _MOST_ITERATIONS + 1):
            before = state
            state, length = self._stepped(before, target, nearest_home)
            # In an overconstrained mechanism the freedom to fit shows only once the loops close.
            if (
                length <= last
                and self.residuals(state)[0] <= CLOSURE_TOLERANCE
                and self._freedom(state) == self._freedom(before)
            ):
                return state, True, iteration
            if not np.isfinite(length):
                break
        return state, False, iteration

    def residuals(self, state: State) -> tuple[float, float]:
        """Return what is open outside, and along, the absorbed directions, in metres."""
        rows, struts, left, sigma, _ = self._structure(state)
        open_ = np.where(self._attached[:, None], state.openings, 0.0)
        misclosure = np.einsum('ij,ij->i', rows, state.openings[struts])
        kept = int((sigma > absorption_threshold(sigma, self.mechanism.compliance)).sum())
        strain = misclosure - left[:, :kept] @ (left[:, :kept].T @ misclosure)
        rest = open_.copy()
        np.subtract.at(rest, struts, rows * strain[:, None])
        return float(np.linalg.norm(rest)), float(np.linalg.norm(strain))

    def _structure(
        self, state: State
    ) -> tuple[FloatArray, IntArray, FloatArray, FloatArray, FloatArray]:
        """Return the attached struts' structural rows, their struts and decomposition."""
        constraints = state.constraints
        if self._complete:
            rows, struts = constraints.structure, constraints.structure_strut
            return rows, struts, *constraints.decomposition
        mine = self._attached[constraints.structure_strut]
        rows = constraints.structure[mine]
        return rows, constraints.structure_strut[mine], *decomposed(rows)

    def _freedom(self, state: State) -> int:
        """Return how many twists of the platform the structure does not bar."""
        sigma = self._structure(state)[3]
        return 6 - int((sigma > absorption_threshold(sigma, self.mechanism.compliance)).sum())

    def _stepped(
        self, state: State, target: FloatArray, nearest_home: bool
    ) -> tuple[State, float]:
        """Return the state after one Gauss-Newton step, and the step's length in metres."""
        twist, rates = self._step(state, target, nearest_home)
        chains = self._chains
        moved = state.openings + twist
        joint_rates = np.zeros_like(state.joint_values)
        joint_rates[chains.places] = rates
        pushed = np.einsum('sk,skj->sj', joint_rates, state.screws) * chains.scale
        passive = np.einsum('skj,sj->sk', state.constraints.passive_inverse, moved - pushed)
        joint_rates += passive
        for index in np.flatnonzero(~self._attached):
            columns = state.screws[index].T * chains.scale[:, None]
            joint_rates[index] = np.linalg.pinv(columns, rcond=1e-9) @ moved[index]
        if not (np.isfinite(twist).all() and np.isfinite(joint_rates).all()):
            return state, np.inf  # readings beyond all numbers
        drives = float(np.linalg.norm(pushed[self._attached]))
        length = max(float(np.linalg.norm(twist)), drives)
        longest = _LONGEST_STEP * self.mechanism.characteristic_length
        shortened = min(1.0, longest / length) if length > 0.0 else 1.0
        pose = displaced(state.pose, shortened * twist / chains.scale)
        values = state.joint_values + shortened * joint_rates
        return evaluated(chains, len(target), pose, values), length

    def _step(
        self, state: State, target: FloatArray, nearest_home: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Return the scaled platform twist (6,) and the actuator rates (N,) of one step."""
        rows, struts, left, sigma, right = self._structure(state)
        kept = int((sigma > absorption_threshold(sigma, self.mechanism.compliance)).sum())
        misclosure = np.einsum('ij,ij->i', rows, state.openings[struts])
        twist = -right[:kept].T @ ((left[:, :kept].T @ misclosure) / sigma[:kept])
        free = right[kept:].T

        particular, motions = self._drive_motions(state, twist, free)
        width = free.shape[1]
        values = state.actuator_values[self.held]
        wanted = target[self.held]
        read = np.isfinite(wanted)

        solution = particular
        error = wanted[read] - values[read] - solution[width:][read]
        fitted, idle = _solutions(motions[width:][read], error)
        solution = solution + motions @ fitted
        if nearest_home and idle.shape[1]:
            spare = motions @ idle
            away = -values[~read] - solution[width:][~read]
            solution = solution + spare @ _solutions(spare[width:][~read], away)[0]
        rates = np.zeros(len(target))
        rates[self.held] = solution[width:]
        return twist + free @ solution[:width], rates


    def _drive_motions(
        self, state: State, twist: FloatArray, free: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return all [y; dq] with which the drives go along with the twist ``twist + free y``.

        One solution, and a basis of the differences.
        """
        constraints, rows = state.constraints, state.constraints.actuator_rows
        width = free.shape[1]
        if rows is not None:
            rows = rows[self.held]
            struts = self._chains.places[0][self.held]
            closing = np.einsum('ij,ij->i', rows, twist + state.openings[struts])
            return (
                np.concatenate([np.zeros(width), closing]),
                np.vstack([np.eye(width), rows @ free]),
            )
        mine = self._attached[constraints.drive_strut]
        drive = constraints.drive[mine]
        opening = np.einsum('ij,ij->i', drive, state.openings[constraints.drive_strut[mine]])
        # drive (twist + free y) - gains dq = -opening, in the unknowns [y; dq].
        gains = constraints.drive_rates[mine][:, self.held]
        return _solutions(np.hstack([drive @ free, -gains]), -opening - drive @ twist)


def _solutions(matrix: FloatArray, right_hand: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the shortest least-squares solution, and a basis of the null space."""
    left, sigma, right = np.linalg.svd(matrix)
    rank = int((sigma > RANK_TOLERANCE * sigma.max(initial=0.0)).sum()) if sigma.size else 0
    solution = right[:rank].T @ ((left[:, :rank].T @ right_hand) / sigma[:rank])
    return solution, right[rank:].T
