# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Metrics: the health of the mechanism, as plain values.

A new metric is also named in nodes/metrics_publisher.py (``_DECIMALS``: numbers in the status) or
analysis/topics.py (``SCALARS``: topics of their own), and in test/ros/test_contract.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite, isnan

import numpy as np

from fault_tolerance.control.estimate import estimate as estimated
from fault_tolerance.control.notices import clean
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.step_output import Output
from fault_tolerance.control.warning_monitor import WarningMonitor
from fault_tolerance.kinematics.common_causes import worst_group
from fault_tolerance.kinematics.failures import Failure, FailureMode
from fault_tolerance.kinematics.measures import measure_bounds, motion_quality, worst_failure
from fault_tolerance.mechanism.arrays import FloatArray


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
class GroupMetrics:
    """One group of parts with a common cause, and what its failure would lead to."""

    name: str
    failures: tuple[str, ...]
    """What would fail, as ``torque:theta_4``."""
    outlook: str
    """The state if it failed next: degraded or stopped; failed where it has already."""


@dataclass(frozen=True)
class Metrics:
    """The health of the mechanism, in plain, finite numbers."""

    state: str
    message: str
    """A sentence for a person."""
    level: int
    """As `Output.level`."""
    failures: tuple[str, ...]
    """As ``position:theta_4``."""
    mobility: int = 0
    """Degrees of freedom the drives control; 0 where nothing is known yet, as all that follows."""
    lost: tuple[str, ...] = ()
    """Task coordinates that are no longer independent, see `Verdict`."""
    gained: tuple[str, ...] = ()
    """Coordinates that have become independent, see `Verdict`."""
    retained_manipulability: float = 0.0
    """Of the major task, relative to the nominal mechanism."""
    position_measure: float = 0.0
    """p of the failures present."""
    torque_measure: float = 0.0
    """t of the failures present."""
    hard_measure: float = 0.0
    """h of the failures present."""
    smallest_singular_value: float = 0.0
    """Of J_m as it is now."""
    condition_number: float = 0.0
    """Of J_m as it is now."""
    saturation: tuple[str, ...] = ()
    """Actuators at a limit."""
    scale: float = 0.0
    """The factor by which limits or a near singularity slow everything down."""
    secondary_scale: float = 0.0
    """The factor by which the secondary motion had to give way before."""
    major_jump: float = 0.0
    """By how much the velocity of the major task jumped at the last transition, m/s."""
    rate_jump: float = 0.0
    """By how much the rates of the drives jumped at the last transition (norm), m/s."""
    out_of_range: tuple[str, ...] = ()
    """Actuators whose readings lie beyond their strokes."""
    sensorless: tuple[str, ...] = ()
    """Actuators that have failed, not with their struts, and have no usable reading."""
    flexure_strain: float = 0.0
    """Metres the flexures take up."""
    misfit: float = 0.0
    """By how much the redundant joint readings contradict each other at most, metres."""
    reconfiguration_time: float = 0.0
    """Seconds of computing, from the last report that changed anything to its command."""
    time_since_report: float | None = None
    """Seconds since a part was last reported on; None before there was a report."""
    internal_force: float | None = None
    """The largest force of the drives against each other, N; None where it is not known."""
    tracking_error: float = 0.0
    """The largest difference of rates commanded and measured, m/s."""
    worst_next: str = ''
    """The next failure with the least measure: a single one, as ``torque:theta_1``, or, if none of
    these would stop the mechanism, the first group that would, as ``group:amplifier_1`` with
    measure 0. Empty if none is left, and while it is stopped."""
    worst_next_measure: float = 0.0
    """Its measure."""
    position_tolerance: float = 0.0
    """The worst measure of a next position failure; 0 if none is left."""
    torque_tolerance: float = 0.0
    """The worst measure of a next torque failure; 0 if none is left."""
    hard_tolerance: float = 0.0
    """The worst measure of a next hard failure; 0 if none is left."""
    actuators: tuple[ActuatorMetrics, ...] = ()
    struts: tuple[StrutMetrics, ...] = ()
    groups: tuple[GroupMetrics, ...] = ()
    """Empty while it is stopped."""


def metrics_of(output: Output, monitor: WarningMonitor, since_report: float) -> Metrics:
    """Return the metrics that go with ``output``, and with what ``monitor`` has measured.

    ``since_report`` is the seconds since the last report, infinite if there was none. State and
    message only, before anything is known or where the measures fail.
    """
    state, failures = output.state.value, tuple(map(str, output.failures.failures))
    metrics = Metrics(state, state, output.level, failures)
    try:
        metrics = replace(metrics, message=f'{state}: {output.reason}')
        if output.estimate.located:
            metrics = _with_measures(metrics, output, monitor, since_report)
        return metrics
    except Exception as error:  # the state must be told even if the measures fail
        text = clean(f'{type(error).__name__}: {error}')
        return replace(metrics, message=f'{metrics.message}; no measures: {text}')


def _with_measures(
    state: Metrics, output: Output, monitor: WarningMonitor, since_report: float
) -> Metrics:
    """Return metrics with ``state``, message, level and failures as given, and all the rest."""
    estimate = output.estimate
    verdict, values = estimate.post.verdict, estimate.measures()
    retained, smallest, condition = motion_quality(estimate.post)
    groups = _groups(output, monitor)
    mechanism, command = estimate.model.mechanism, output.command
    position, torque, hard = np.split(values[3:], np.arange(1, 3) * len(mechanism.actuators))
    worst, worst_measure = '', 0.0
    if output.state is not State.STOPPED:
        worst, worst_measure = _worst(groups, *worst_failure(mechanism, position, torque, hard))
    return replace(
        state,
        mobility=verdict.mobility,
        lost=verdict.lost,
        gained=verdict.gained,
        retained_manipulability=retained,
        position_measure=float(values[0]),
        torque_measure=float(values[1]),
        hard_measure=float(values[2]),
        smallest_singular_value=smallest,
        condition_number=condition,
        saturation=output.saturation,
        scale=command.scale,
        secondary_scale=command.secondary_scale,
        major_jump=command.major_jump,
        rate_jump=command.rate_jump,
        out_of_range=monitor.strokes.out_of_range,
        sensorless=output.sensorless,
        flexure_strain=estimate.flexure_strain,
        misfit=estimate.misfit,
        reconfiguration_time=output.reconfiguration_time,
        time_since_report=since_report if isfinite(since_report) else None,
        internal_force=monitor.internal_force if isfinite(monitor.internal_force) else None,
        tracking_error=monitor.tracking.error,
        worst_next=worst,
        worst_next_measure=worst_measure,
        position_tolerance=_least(position),
        torque_tolerance=_least(torque),
        hard_tolerance=_least(hard),
        actuators=_actuators(output, position, torque),
        struts=_struts(output, hard),
        groups=groups,
    )


def _actuators(
    output: Output, position: FloatArray, torque: FloatArray
) -> tuple[ActuatorMetrics, ...]:
    mechanism, driving = output.estimate.model.mechanism, int(np.isfinite(torque).sum())
    p_bound, t_bound = measure_bounds(driving, output.estimate.mobility, len(mechanism.task.major))
    measures = zip(mechanism.actuator_names, position.tolist(), torque.tolist(), strict=True)
    return tuple(
        ActuatorMetrics(
            name, output.failures.mode_of(mechanism, name).value, _known(p), _known(t),
            _share(p, p_bound), _share(t, t_bound),
        )
        for name, p, t in measures
    )


def _struts(output: Output, hard: FloatArray) -> tuple[StrutMetrics, ...]:
    lost, names = output.failures.lost, output.estimate.model.mechanism.strut_names
    return tuple(
        StrutMetrics(
            name, (FailureMode.HARD if name in lost else FailureMode.NONE).value, _known(h)
        )
        for name, h in zip(names, hard.tolist(), strict=True)
    )


def _groups(output: Output, monitor: WarningMonitor) -> tuple[GroupMetrics, ...]:
    """Return what every group would lead to: the verdict of the next step if it failed now."""
    estimate, present = output.estimate, output.failures
    if output.state is State.STOPPED:
        return ()
    found = []
    for name, failures in monitor.groups.items():
        further, outlook = present.and_also(estimate.model.mechanism, *failures.failures), 'failed'
        if further != present:
            then = estimated(estimate.model, estimate, estimate.readings, further)
            outlook = (State.DEGRADED if then.tolerated else State.STOPPED).value
        found.append(GroupMetrics(name, tuple(map(str, failures.failures)), outlook))
    return tuple(found)


def _worst(
    groups: tuple[GroupMetrics, ...], worst: Failure | None, measure: float
) -> tuple[str, float]:
    """Return what hurts most, the ``worst`` single failure or a group, and its measure."""
    stopping = [one.name for one in groups if one.outlook == State.STOPPED.value]
    group = worst_group(stopping, measure if worst else None)
    return (f'group:{group}', 0.0) if group else (str(worst or ''), measure)


def _known(value: float) -> float | None:
    return None if isnan(value) else value


def _share(value: float, bound: float) -> float | None:
    return value / bound if bound > 0.0 and not isnan(value) else None


def _least(values: FloatArray) -> float:
    return min((value for value in values.tolist() if not isnan(value)), default=0.0)
