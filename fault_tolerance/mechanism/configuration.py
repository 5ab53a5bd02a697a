# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Configurations: loops closed from actuator values, exactly or as a fit to readings."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from fault_tolerance.errors import ClosureError, MechanismError
from fault_tolerance.mechanism.arrays import FloatArray, frozen_array
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.closure import Closure
from fault_tolerance.mechanism.constraints import StrutConstraints
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.state import State, evaluated
from fault_tolerance.mechanism.steps import Closed, steps_from
from fault_tolerance.tolerances import CLOSURE_TOLERANCE, MISFIT_TOLERANCE

# Continuation from home takes strides of at most this many characteristic lengths (or radians):
# the assembly found is the one the mechanism can be driven to.
_STRIDE = 0.1
_MOST_STRIDES = 50

FARTHEST = 1e6
"""Radians or metres from home; beyond, a number is a mistake."""


@dataclass(frozen=True, eq=False)
class Configuration:
    """A configuration of a mechanism, with the certificate of how well it closes.

    Attributes
    ----------
    mechanism : Mechanism
    pose : (4, 4) array
        The platform frame in base axes.
    joint_values : (s, k) array
        All joints of all struts, zero where padded; lost struts as near to the platform as they
        reach.
    actuator_values : (N,) array
        Joint values of the actuators, consistent with `pose`.
    misfit : (N,) array
        Value given less value found; 0 where none was given.
    converged : bool
        Whether the loops are closed and the values given are fitted.
    iterations : int
    closed : Closed or None
        The working arrays, from which the next configuration starts; None without struts.
    """

    mechanism: Mechanism
    pose: FloatArray
    joint_values: FloatArray
    actuator_values: FloatArray
    misfit: FloatArray
    converged: bool
    iterations: int
    closed: Closed | None

    @property
    def state(self) -> State | None:
        """The state from which the next configuration starts; None without struts."""
        return self.closed.state if self.closed else None

    @property
    def closure_residual(self) -> float:
        """Metres left open outside the directions that the flexures absorb."""
        return self.closed.open[0] if self.closed else 0.0

    @property
    def flexure_strain(self) -> float:
        """Metres the flexures take up along the directions they absorb."""
        return self.closed.open[1] if self.closed else 0.0

    def prepare(self) -> None:
        """Work out what fitting the next configuration from this one will need."""
        if self.closed is not None and self.converged:
            steps_from(self.closed.state, self.closed.attachment, self.closed.kept)

    @property
    def constraints(self) -> StrutConstraints:
        """What the struts say here; only for a mechanism with struts."""
        if self.state is None:
            reason = 'the mechanism is given by numbers'
            raise MechanismError(self.mechanism.name, 'struts', reason)
        return self.state.constraints

    @property
    def largest_misfit(self) -> float:
        """The largest misfit, in metres (revolute actuators times the characteristic length)."""
        return _largest_misfit(self.mechanism, self.misfit)

    @property
    def strain_allowed(self) -> float:
        """The flexure strain the mechanism may have, in metres."""
        mechanism = self.mechanism
        return max(mechanism.compliance * mechanism.characteristic_length, CLOSURE_TOLERANCE)


def home_configuration(mechanism: Mechanism) -> Configuration:
    """Return ``mechanism`` at home."""
    if not mechanism.struts:
        return _working_point(mechanism)
    closure = Closure(mechanism, ())
    return configuration_from(mechanism, closure.certified(_home_state(mechanism), True, 0), None)


def solved_configuration(
    mechanism: Mechanism,
    given: Mapping[str, float],
    lost: Collection[str] = (),
) -> Configuration:
    """Return the configuration with the actuator values ``given``, continued from home.

    Parameters
    ----------
    mechanism : Mechanism
    given : mapping of str to float
        Joint values by actuator name. Actuators left out take the values nearest to home (least
        squares) that close the loops. Redundant values may be given if they agree. Values in
        lost struts are ignored.
    lost : collection of str
        Struts that no longer hold the platform.

    Raises
    ------
    MechanismError
        For a name that is no actuator or a value that is not finite.
    ClosureError
        If the loops do not close within 1e-9 m (beyond what the compliance absorbs), or values
        given contradict each other by more than 1e-6 characteristic lengths.
    """
    target = np.full(len(mechanism.actuators), np.nan)
    for name, value in given.items():
        if name not in mechanism.actuator_names:
            valid = ', '.join(mechanism.actuator_names)
            reason = f'{name!r} is not an actuator; valid: {valid}'
            raise MechanismError(mechanism.name, 'at', reason)
        if not isfinite(value):
            raise MechanismError(mechanism.name, f'at.{name}', f'{value} is not finite')
        if abs(value) > FARTHEST:
            reason = f'{value} is farther than any joint goes ({FARTHEST:g})'
            raise MechanismError(mechanism.name, f'at.{name}', reason)
        target[mechanism.actuator_index(name)] = value
    if not mechanism.struts:
        if given:
            reason = 'a mechanism given by numbers has no configuration but its working point'
            raise MechanismError(mechanism.name, 'at', reason)
        return _working_point(mechanism)
    closure = Closure(mechanism, lost)
    state = _home_state(mechanism)
    reach = float(np.nanmax(_in_metres(mechanism, np.abs(target)), initial=0.0))
    strides = int(np.ceil(reach / (_STRIDE * mechanism.characteristic_length)))
    strides = min(max(strides, 1), _MOST_STRIDES)
    iterations = 0
    for stride in range(1, strides + 1):
        goal = target * (stride / strides)
        closed = closure.solved(state, goal, nearest_home=True)
        state, iterations = closed.state, iterations + closed.iterations
    found = configuration_from(mechanism, replace(closed, iterations=iterations), target)
    _require_closed(found)
    return found


def fitted_configuration(
    mechanism: Mechanism,
    values: FloatArray,
    lost: Collection[str] = (),
    start: Configuration | None = None,
    compliance: float | None = None,
) -> Configuration:
    """Return the configuration that fits the joint values of the actuators best.

    Parameters
    ----------
    mechanism : Mechanism
    values : (N,) array
        Joint values, NaN where there is no reading. Readings of lost struts are ignored.
    lost : collection of str
        Struts that no longer hold the platform.
    start : Configuration, optional
        Where to start from (warm start); home by default.
    compliance : float, optional
        What the flexures absorb while the loops are closed; the mechanism's own by default.

    Returns
    -------
    Configuration
        The loops are closed first, the N readings fitted by least squares within that. Does not
        raise for numerical reasons: read `Configuration.converged`.
    """
    count = len(mechanism.actuators)
    if type(values) is np.ndarray and values.dtype == np.float64 and values.shape == (count,):
        target = values  # read here and not kept
    else:
        target = frozen_array(values, (count,), 'values', finite=False)
    if not mechanism.struts:
        return _working_point(mechanism)
    closure = Closure(mechanism, lost, compliance)
    state = start.state if start is not None else None
    if state is None:
        state = _home_state(mechanism)
    return configuration_from(mechanism, closure.fitted(state, target), target)


def _require_closed(found: Configuration) -> None:
    # Closed is what is closed: steps that are still longer than asked for do not matter then.
    if not found.closure_residual <= CLOSURE_TOLERANCE:
        reason = 'the loops do not close'
        raise ClosureError(reason, found.closure_residual, CLOSURE_TOLERANCE)
    if found.flexure_strain > found.strain_allowed:
        reason = 'the loops do not close within the compliance'
        raise ClosureError(reason, found.flexure_strain, found.strain_allowed)
    allowed = MISFIT_TOLERANCE * found.mechanism.characteristic_length
    if found.largest_misfit > allowed:
        reason = 'the actuator values contradict each other'
        raise ClosureError(reason, found.largest_misfit, allowed)


def _home_state(mechanism: Mechanism) -> State:
    chains = chains_of(mechanism)
    values = np.zeros(chains.real.shape)
    return evaluated(chains, np.array(chains.home), values, chains.regular)


def configuration_from(
    mechanism: Mechanism,
    closed: Closed,
    target: FloatArray | None,
    *,
    complete: bool = False,
) -> Configuration:
    """Return the configuration that a closed state is, fitted to ``target`` (N,).

    Parameters
    ----------
    mechanism : Mechanism
    closed : Closed
    target : (N,) array, optional
    complete : bool
        Whether it is known that no strut is lost and every actuator has a reading.
    """
    state, attachment = closed.state, closed.attachment
    actuators = state.actuator_values
    if target is None:
        misfit = np.zeros(actuators.shape)
    elif complete or (attachment.complete and isfinite(float(target.sum()))):
        misfit = target - actuators
    else:
        # Differences with NaN, where there is no reading, are left out.
        misfit = np.zeros(actuators.shape)
        np.subtract(target, actuators, out=misfit, where=np.isfinite(target) & attachment.held)
    for array in (state.pose, state.joint_values, actuators, misfit):
        array.setflags(write=False)
    return Configuration(
        mechanism,
        state.pose,
        state.joint_values,
        actuators,
        misfit,
        closed.converged,
        closed.iterations,
        closed,
    )


def _working_point(mechanism: Mechanism) -> Configuration:
    none = frozen_array(np.zeros((0, 0)), (0, 0), 'joint values')
    zero = frozen_array(np.zeros(len(mechanism.actuators)), (None,), 'actuator values')
    pose = np.eye(4)
    pose[:3, 3] = mechanism.origin
    pose = frozen_array(pose, (4, 4), 'pose')
    return Configuration(mechanism, pose, none, zero, zero, True, 0, None)


def _in_metres(mechanism: Mechanism, values: FloatArray) -> FloatArray:
    return values * mechanism.rate_scale


def _largest_misfit(mechanism: Mechanism, misfit: FloatArray) -> float:
    return float(np.abs(_in_metres(mechanism, misfit)).max(initial=0.0))
