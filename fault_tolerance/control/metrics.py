# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Everything worth publishing about the mechanism's health, as plain values."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import isnan

from fault_tolerance.control.assessment import Assessment
from fault_tolerance.control.notices import clean
from fault_tolerance.control.output import Output
from fault_tolerance.control.recovery import State
from fault_tolerance.control.reports import ERROR, OK, STALE, WARN
from fault_tolerance.kinematics.failures import FailureMode
from fault_tolerance.kinematics.measures import NextFailure
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism


@dataclass(frozen=True)
class ActuatorMetrics:
    """One actuator: its failure, and its measures if it failed next (None: it has already)."""

    name: str
    failure: str
    position: float | None
    torque: float | None
    position_optimality: float | None
    torque_optimality: float | None


@dataclass(frozen=True)
class StrutMetrics:
    """One strut: its failure, and its measure if it were lost next (None: it has been)."""

    name: str
    failure: str
    hard: float | None


@dataclass(frozen=True)
class Metrics:
    """The health of the mechanism, in plain, finite numbers.

    Attributes
    ----------
    state : str
    message : str
        A sentence for a person.
    level : int
        Diagnostic level: OK nominal, WARN tolerated, ERROR not tolerated, STALE an input is lost.
    failures : tuple of str
        As ``position:theta_4``.
    mobility : int
        Degrees of freedom the drives control; 0 where nothing is known yet, as all that follows.
    lost, gained : tuple of str
        Task coordinates.
    retained_manipulability, position_measure, torque_measure, hard_measure : float
        Of the failures present.
    smallest_singular_value, condition_number : float
        Of J_m as it is now.
    saturation : tuple of str
        Actuators at a limit.
    scale, secondary_scale : float
        The factor that limits or a near singularity put on everything, and before that on the
        secondary motion.
    major_jump, rate_jump : float
        By how much the velocity of the major task and the rates of the drives jumped at the last
        failure, clearing or resumption, m/s.
    out_of_range, inconsistent : tuple of str
        Actuators whose readings lie beyond their strokes, or contradict reports and commands.
    flexure_strain : float
        Metres.
    misfit : float
        By how much the redundant joint readings contradict each other at most, metres.
    recovery_time : float
        Seconds.
    worst_next : str
        The next single failure that hurts most, as ``torque:theta_1``; empty if none is left.
    worst_next_measure : float
    position_tolerance, torque_tolerance, hard_tolerance : float
        The worst measure of a next single failure, by mode; 0 if none is left.
    actuators : tuple of ActuatorMetrics
    struts : tuple of StrutMetrics
    """

    state: str
    message: str
    level: int
    failures: tuple[str, ...]
    mobility: int = 0
    lost: tuple[str, ...] = ()
    gained: tuple[str, ...] = ()
    retained_manipulability: float = 0.0
    position_measure: float = 0.0
    torque_measure: float = 0.0
    hard_measure: float = 0.0
    smallest_singular_value: float = 0.0
    condition_number: float = 0.0
    saturation: tuple[str, ...] = ()
    scale: float = 0.0
    secondary_scale: float = 0.0
    major_jump: float = 0.0
    rate_jump: float = 0.0
    out_of_range: tuple[str, ...] = ()
    inconsistent: tuple[str, ...] = ()
    flexure_strain: float = 0.0
    misfit: float = 0.0
    recovery_time: float = 0.0
    worst_next: str = ''
    worst_next_measure: float = 0.0
    position_tolerance: float = 0.0
    torque_tolerance: float = 0.0
    hard_tolerance: float = 0.0
    actuators: tuple[ActuatorMetrics, ...] = ()
    struts: tuple[StrutMetrics, ...] = ()


def metrics_of(mechanism: Mechanism, output: Output, assessment: Assessment | None) -> Metrics:
    """Return the metrics that go with ``output``.

    Parameters
    ----------
    mechanism : Mechanism
    output : Output
    assessment : Assessment or None
        The one the output follows from; None before there is one.
    """
    state = output.state.value
    message = f'{state}: {output.reason}'
    failures = tuple(str(failure) for failure in output.failures.failures)
    if output.post is None or assessment is None:
        return Metrics(state, message, _level(output), failures)
    try:
        present, following = assessment.measures, assessment.following
    except Exception as error:  # the state must be told even if the measures fail
        message = f'{message}; no measures: {clean(f"{type(error).__name__}: {error}")}'
        return Metrics(state, message, _level(output), failures)
    return Metrics(
        state=state,
        message=message,
        level=_level(output),
        failures=failures,
        mobility=output.post.verdict.mobility,
        lost=output.post.verdict.lost,
        gained=output.post.verdict.gained,
        retained_manipulability=present.retained_manipulability,
        position_measure=present.position,
        torque_measure=present.torque,
        hard_measure=present.hard,
        smallest_singular_value=present.smallest_singular_value,
        condition_number=present.condition_number,
        saturation=output.saturation,
        scale=output.scale,
        secondary_scale=output.secondary_scale,
        major_jump=output.jump.major,
        rate_jump=output.jump.rates,
        out_of_range=output.out_of_range,
        inconsistent=output.inconsistent,
        flexure_strain=output.configuration.flexure_strain if output.configuration else 0.0,
        misfit=output.configuration.largest_misfit if output.configuration else 0.0,
        recovery_time=output.recovery_time,
        worst_next=str(following.worst) if following.worst else '',
        worst_next_measure=following.worst_measure,
        position_tolerance=_least(following.position),
        torque_tolerance=_least(following.torque),
        hard_tolerance=_least(following.hard),
        actuators=_actuators(mechanism, output, following),
        struts=_struts(mechanism, output, following),
    )


def _actuators(
    mechanism: Mechanism, output: Output, following: NextFailure
) -> tuple[ActuatorMetrics, ...]:
    return tuple(
        ActuatorMetrics(
            name,
            output.failures.mode_of(mechanism, name).value,
            _known(p),
            _known(t),
            _share(p, following.position_bound),
            _share(t, following.torque_bound),
        )
        for name, p, t in zip(
            mechanism.actuator_names,
            following.position.tolist(),
            following.torque.tolist(),
            strict=True,
        )
    )


def _struts(
    mechanism: Mechanism, output: Output, following: NextFailure
) -> tuple[StrutMetrics, ...]:
    lost = output.failures.lost
    return tuple(
        StrutMetrics(
            name, (FailureMode.HARD if name in lost else FailureMode.NONE).value, _known(h)
        )
        for name, h in zip(mechanism.strut_names, following.hard.tolist(), strict=True)
    )


def _level(output: Output) -> int:
    if output.state is State.STOPPED:
        return ERROR
    if output.input_lost:
        return STALE
    if output.failures or output.state is State.HOLD or output.notices:
        return WARN
    return OK


def _known(value: float) -> float | None:
    return None if isnan(value) else value


def _share(value: float, bound: float) -> float | None:
    return value / bound if bound > 0.0 and not isnan(value) else None


def _least(values: FloatArray) -> float:
    known: Iterable[float] = (value for value in values.tolist() if not isnan(value))
    return min(known, default=0.0)
