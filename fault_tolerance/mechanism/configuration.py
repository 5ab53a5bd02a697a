# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Configurations: loops closed from actuator values, exactly or as a fit to readings."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from fault_tolerance.errors import ClosureError, MechanismError
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray, frozen, frozen_array
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.closure import Closed, Closure
from fault_tolerance.mechanism.constraints import StrutConstraints
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.evaluation import State, evaluated, home_state
from fault_tolerance.mechanism.targets import ActuatorTarget, Target, actuator_target, pose_target
from fault_tolerance.tolerances import CLOSURE_TOLERANCE, MISFIT_TOLERANCE, STRIDE

_MOST_STRIDES = 50


@dataclass(frozen=True, eq=False)
class Configuration:
    """A configuration of a mechanism, with the certificate of how well it closes.

    Attributes
    ----------
    mechanism : Mechanism
    pose : (4, 4) array
        The platform frame in base axes.
    joint_values : (s, k) array
        All joints of all struts, radians and metres from home, zero where padded; lost struts as
        near to the platform as they reach.
    actuator_values : (N,) array
        Joint values of the actuators, consistent with `pose`.
    misfit : (N,) array
        Value given less value found; 0 where none was given.
    converged : bool
        Whether the loops are closed and the values given are fitted.
    iterations : int
        Gauss-Newton steps taken.
    closure_residual : float
        Metres left open outside the directions that the flexures absorb.
    flexure_strain : float
        Metres the flexures take up along the directions they absorb.
    state : State or None
        The warm start of the next configuration; None without struts.
    """

    mechanism: Mechanism
    pose: FloatArray
    joint_values: FloatArray
    actuator_values: FloatArray
    misfit: FloatArray
    converged: bool
    iterations: int
    closure_residual: float = 0.0
    flexure_strain: float = 0.0
    state: State | None = None

    def __repr__(self) -> str:
        words = 'closed' if self.converged else 'not converged'
        return f'Configuration({self.mechanism.name!r}, {words}, {self.iterations} iterations)'

    @property
    def constraints(self) -> StrutConstraints:
        """What the struts say here; only for a mechanism with struts.

        Raises
        ------
        MechanismError
            If the mechanism is given by its Jacobian.
        """
        if self.state is None:
            reason = 'the mechanism is given by its Jacobian'
            raise MechanismError(self.mechanism.name, 'struts', reason)
        return self.state.constraints

    @property
    def largest_misfit(self) -> float:
        """The largest misfit, in metres (revolute actuators times the characteristic length)."""
        return float(np.abs(self.misfit * self.mechanism.rate_scale).max(initial=0.0))

    @property
    def strain_allowed(self) -> float:
        """The flexure strain the mechanism may have, in metres."""
        absorbed = self.mechanism.compliance * self.mechanism.characteristic_length
        return max(absorbed, CLOSURE_TOLERANCE)


def home_configuration(mechanism: Mechanism) -> Configuration:
    """Return ``mechanism`` at home."""
    if not mechanism.struts:
        return _working_point(mechanism)
    closure = Closure(mechanism)
    closed = closure.certified(home_state(mechanism), True, 0)
    return _configuration(mechanism, closed, closure.attachment.held)


def placed_configuration(
    mechanism: Mechanism,
    pose: FloatArray,
    joint_values: FloatArray,
    target: FloatArray | None = None,
    lost: Collection[str] = (),
) -> Configuration:
    """Return the configuration of ``mechanism`` without its struts ``lost`` at a known place.

    No loop is closed: ``converged`` says whether they are, at ``pose`` (4, 4) and all
    ``joint_values`` (s, k), radians and metres from home. The actuator values read, ``target``
    (N,) with NaN where there is none, give the misfit.
    """
    pose = frozen_array(pose, (4, 4), 'pose')
    if not mechanism.struts:
        return _working_point(mechanism)
    shape = chains_of(mechanism).real.shape
    joint_values = frozen_array(joint_values, shape, 'joint values')
    closure = Closure(mechanism, lost)
    closed = closure.certified(evaluated(mechanism, pose, joint_values), True, 0)
    closed = replace(closed, converged=closed.residual <= CLOSURE_TOLERANCE)
    return _configuration(mechanism, closed, closure.attachment.held, target)


def solved_configuration(
    mechanism: Mechanism, given: Mapping[str, float], lost: Collection[str] = ()
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

    Returns
    -------
    Configuration

    Raises
    ------
    MechanismError
        For a name that is no actuator or a value that is not finite.
    ClosureError
        If the loops do not close within 1e-9 m (beyond what the compliance absorbs), or values
        given contradict each other by more than 1e-6 characteristic lengths.
    """
    target = actuator_target(mechanism, given)
    if not mechanism.struts:
        return _working_point(mechanism, 'at', given)
    closure = Closure(mechanism, lost)
    reach = float(np.nanmax(np.abs(target.values * mechanism.rate_scale), initial=0.0))
    closed = _continued(closure, target, reach)
    found = _configuration(mechanism, closed, closure.attachment.held, target.values)
    _require_closed(found)
    return found


def posed_configuration(
    mechanism: Mechanism, given: Mapping[str, float], lost: Collection[str] = ()
) -> Configuration:
    """Return the configuration with the task coordinates ``given``, continued from home.

    The coordinates are those of the platform's displacement from home: wx, wy and wz of its
    rotation vector (radians, base axes), vx, vy and vz of its origin (metres, base axes).

    Parameters
    ----------
    mechanism : Mechanism
    given : mapping of str to float
        Displacements by task coordinate. Task coordinates left out are as near to home as the
        loops allow (least squares, rotations times the characteristic length), then the actuator
        values.
    lost : collection of str
        Struts that no longer hold the platform.

    Returns
    -------
    Configuration

    Raises
    ------
    MechanismError
        For a name that is no task coordinate, or a value that is not finite or too large.
    ClosureError
        If the loops do not close within 1e-9 m (beyond what the compliance absorbs), or the
        platform does not reach what is given within 1e-6 characteristic lengths.
    """
    target = pose_target(mechanism, given)
    if not mechanism.struts:
        return _working_point(mechanism, 'pose', given)
    closure = Closure(mechanism, lost)
    closed = _continued(closure, target, float(np.abs(target.values * target.scale).max()))
    found = _configuration(mechanism, closed, closure.attachment.held)
    _require_closed(found, 'the pose is out of reach: ')
    allowed = MISFIT_TOLERANCE * mechanism.characteristic_length
    missed = target.misfit(found.pose)
    if missed > allowed:
        raise ClosureError('the pose is out of reach: the platform misses it', missed, allowed)
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
    target = frozen_array(values, (len(mechanism.actuators),), 'values', finite=False)
    if not mechanism.struts:
        return _working_point(mechanism)
    closure = Closure(mechanism, lost, compliance)
    state = (start.state if start else None) or home_state(mechanism)
    closed = closure.solved(state, ActuatorTarget(target, nearest_home=False))
    return _configuration(mechanism, closed, closure.attachment.held, target)


def _continued(closure: Closure, target: Target, reach: float) -> Closed:
    """Return the state at ``target``, ``reach`` metres from home, by strides from there."""
    strides = int(np.ceil(reach / (STRIDE * closure.mechanism.characteristic_length)))
    strides = min(max(strides, 1), _MOST_STRIDES)
    state, iterations = home_state(closure.mechanism), 0
    for stride in range(1, strides + 1):
        closed = closure.solved(state, target.at(stride / strides))
        state, iterations = closed.state, iterations + closed.iterations
    return replace(closed, iterations=iterations)


def _require_closed(found: Configuration, cause: str = '') -> None:
    # Loops that are closed will do, even if the last step was longer than it should be.
    if not found.closure_residual <= CLOSURE_TOLERANCE:
        reason = f'{cause}the loops do not close'
        raise ClosureError(reason, found.closure_residual, CLOSURE_TOLERANCE)
    if found.flexure_strain > found.strain_allowed:
        reason = f'{cause}the loops do not close within the compliance'
        raise ClosureError(reason, found.flexure_strain, found.strain_allowed)
    allowed = MISFIT_TOLERANCE * found.mechanism.characteristic_length
    if found.largest_misfit > allowed:
        reason = 'the actuator values contradict each other'
        raise ClosureError(reason, found.largest_misfit, allowed)


def _configuration(
    mechanism: Mechanism, closed: Closed, held: BoolArray, target: FloatArray | None = None
) -> Configuration:
    """Return the configuration that ``closed`` is, with its misfit to ``target`` (N,).

    The target is NaN where no value was given; only the actuators ``held`` (N,) count.
    """
    state = closed.state
    target = np.full(len(held), np.nan) if target is None else target
    target = frozen_array(target, (len(held),), 'target', finite=False)
    misfit = np.where(np.isfinite(target) & held, target - state.actuator_values, 0.0)
    return Configuration(
        mechanism, state.pose, state.joint_values, state.actuator_values, frozen(misfit),
        closed.converged, closed.iterations, closed.residual, closed.strain, state,
    )


def _working_point(
    mechanism: Mechanism, key: str = '', given: Collection[str] = ()
) -> Configuration:
    """Return the only configuration of a mechanism given by its Jacobian.

    If another one was asked for by what was ``given``, MechanismError names it by ``key``.
    """
    if given:
        reason = 'a mechanism given by its Jacobian has no configuration but its working point'
        raise MechanismError(mechanism.name, key, reason)
    chains, zero = chains_of(mechanism), frozen(np.zeros(len(mechanism.actuators)))
    joint_values = frozen(np.zeros(chains.real.shape))
    return Configuration(mechanism, chains.home, joint_values, zero, zero, True, 0)
