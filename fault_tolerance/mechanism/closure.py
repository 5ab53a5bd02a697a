# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Loop closure by Gauss-Newton steps on the strut rows.

The unknowns are the platform pose and every joint. A step makes the struts' tips meet the
platform: their structural rows are solved first, along the directions the flexures do not
absorb; what freedom is left fits the actuator values; passive joints follow, strut by strut
(docs/theory.md, section 3).
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.attachment import attachment_of
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.mechanism.screws import displaced
from fault_tolerance.mechanism.state import State, evaluated
from fault_tolerance.mechanism.steps import Closed
from fault_tolerance.mechanism.tracking import LAST_STEP, tracked
from fault_tolerance.tolerances import RANK_TOLERANCE

_MOST_ITERATIONS = 60
# Steps longer than this many characteristic lengths are shortened: linearisation ends there.
_LONGEST_STEP = 0.3
_LAST_STEP_SOLVED = 1e-9


class Closure:
    """Closes the loops of a mechanism from which some struts may have been lost.

    Parameters
    ----------
    mechanism : Mechanism
    lost : collection of str
    compliance : float, optional
        Structural constraints up to it are absorbed; the mechanism's own by default.
    """

    def __init__(
        self, mechanism: Mechanism, lost: Collection[str], compliance: float | None = None
    ) -> None:
        self.mechanism = mechanism
        self._compliance = mechanism.compliance if compliance is None else compliance
        self._chains = chains_of(mechanism)
        self.attachment = attachment_of(mechanism, lost)

    def fitted(self, state: State, target: FloatArray) -> Closed:
        """Step from ``state`` until the loops close and ``target`` is fitted.

        Along the short way where that can be taken; elsewhere as `solved`.

        Parameters
        ----------
        state : State
        target : (N,) array
            Actuator values to be met in the least-squares sense, NaN where there is none. What
            they leave free stays where it is.
        """
        found = tracked(state, target, self.attachment, self._compliance, LAST_STEP)
        return found or self.solved(state, target, nearest_home=False)

    def solved(self, state: State, target: FloatArray, *, nearest_home: bool) -> Closed:
        """Step from ``state`` until the loops close and ``target`` is fitted.

        Parameters
        ----------
        state : State
        target : (N,) array
            Actuator values to be met in the least-squares sense, NaN where there is none.
        nearest_home : bool
            Whether what the target leaves free is spent on actuator values near home; otherwise
            it stays where it is.
        """
        scale = self.mechanism.characteristic_length
        last = (_LAST_STEP_SOLVED if nearest_home else LAST_STEP) * scale
        kept = self._kept(state)
        for iteration in range(1, _MOST_ITERATIONS + 1):
            state, length = self._stepped(state, target, nearest_home)
            before, kept = kept, self._kept(state)
            # In an overconstrained mechanism the freedom to fit shows only once the loops close.
            if length <= last and kept == before:
                found = self.certified(state, True, iteration)
                if found.closes:
                    return found
            if not np.isfinite(length):
                break
        return self.certified(state, False, iteration)

    def certified(self, state: State, converged: bool, iterations: int) -> Closed:
        """Return ``state`` with what is open in it."""
        return Closed(state, self.attachment, self._kept(state), converged, iterations)

    def _kept(self, state: State) -> int:
        """Return how many structural constraints are not absorbed."""
        structure = state.constraints.structure_of(self.attachment)
        return structure.kept(self._compliance)

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
        attached = self.attachment.attached
        if state.constraints.inverses is not None:
            joint_rates = state.constraints.inverses.joint_rates(moved)
        else:
            passive = state.constraints.drives.passive_inverse
            joint_rates += np.einsum('skj,sj->sk', passive, moved - pushed)
            for index in np.flatnonzero(~attached):
                columns = state.screws[index].T * chains.scale[:, None]
                joint_rates[index] = np.linalg.pinv(columns, rcond=1e-9) @ moved[index]
        if not (np.isfinite(twist).all() and np.isfinite(joint_rates).all()):
            return state, np.inf  # readings beyond all numbers
        drives = float(np.linalg.norm(pushed[attached]))
        length = max(float(np.linalg.norm(twist)), drives)
        longest = _LONGEST_STEP * self.mechanism.characteristic_length
        shortened = min(1.0, longest / length) if length > 0.0 else 1.0
        pose = displaced(state.pose, shortened * twist / chains.scale)
        values = state.joint_values + shortened * joint_rates
        return evaluated(chains, pose, values, state.regular), length

    def _step(
        self, state: State, target: FloatArray, nearest_home: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Return the scaled platform twist (6,) and the actuator rates (N,) of one step."""
        structure = state.constraints.structure_of(self.attachment)
        kept = structure.kept(self._compliance)
        openings = state.openings[structure.struts]
        misclosure = np.einsum('ij,ij->i', structure.rows, openings)
        bars = (structure.left[:, :kept].T @ misclosure) / structure.sigma[:kept]
        twist = -structure.right[:kept].T @ bars
        free = structure.right[kept:].T
        held = self.attachment.held

        particular, motions = self._drive_motions(state, twist, free)
        width = free.shape[1]
        values = state.actuator_values[held]
        wanted = target[held]
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
        rates[held] = solution[width:]
        return twist + free @ solution[:width], rates

    def _drive_motions(
        self, state: State, twist: FloatArray, free: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return all [y; dq] with which the drives go along with the twist ``twist + free y``.

        One solution, and a basis of the differences.
        """
        constraints, rows = state.constraints, state.constraints.actuator_rows
        held = self.attachment.held
        width = free.shape[1]
        if rows is not None:
            rows = rows[held]
            struts = self._chains.places[0][held]
            closing = np.einsum('ij,ij->i', rows, twist + state.openings[struts])
            return (
                np.concatenate([np.zeros(width), closing]),
                np.vstack([np.eye(width), rows @ free]),
            )
        drives = constraints.drives
        mine = self.attachment.attached[drives.struts]
        drive = drives.drive[mine]
        opening = np.einsum('ij,ij->i', drive, state.openings[drives.struts[mine]])
        # drive (twist + free y) - gains dq = -opening, in the unknowns [y; dq].
        gains = drives.rates[mine][:, held]
        return _solutions(np.hstack([drive @ free, -gains]), -opening - drive @ twist)


def _solutions(matrix: FloatArray, right_hand: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the shortest least-squares solution, and a basis of the null space."""
    left, sigma, right = decomposed(matrix)
    rank = int((sigma > RANK_TOLERANCE * sigma.max(initial=0.0)).sum()) if sigma.size else 0
    solution = right[:rank].T @ ((left[:, :rank].T @ right_hand) / sigma[:rank])
    return solution, right[rank:].T
