# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The metrics of the mechanism as messages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from std_msgs.msg import Float64, Float64MultiArray

from fault_tolerance.analysis import topics
from fault_tolerance.control.failure_reports import ERROR, OK, WARN
from fault_tolerance.control.metrics import ActuatorMetrics, Metrics, StrutMetrics
from fault_tolerance.mechanism.arrays import decimal
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.messages import (
    diagnostics_to_msg,
    labelled_array_to_msg,
    status_to_msg,
)

_DECIMALS = (
    'retained_manipulability', 'position_measure', 'torque_measure', 'hard_measure',
    'smallest_singular_value', 'condition_number', 'flexure_strain', 'misfit',
    'scale', 'secondary_scale', 'major_jump', 'rate_jump', 'tracking_error',
)


class MetricsPublisher:
    """Publishes everything under ``~/metrics``; a ``prefix`` begins the hardware ids."""

    def __init__(self, node: Node, mechanism: Mechanism, prefix: str) -> None:
        self._name = mechanism.name
        self._prefix = f'{prefix}/' if prefix else ''
        self._all = node.create_publisher(DiagnosticArray, '~/metrics', 10)
        self._scalars = {
            name: node.create_publisher(Float64, f'~/metrics/{name}', 10)
            for name in topics.SCALARS
        }
        self._arrays = {
            mode: node.create_publisher(Float64MultiArray, f'~/metrics/{name}', 10)
            for mode, name in topics.ARRAYS.items()
        }

    @property
    def subscribed(self) -> bool:
        """Whether any of the topics has a subscriber."""
        publishers = (self._all, *self._scalars.values(), *self._arrays.values())
        return any(one.get_subscription_count() for one in publishers)

    def publish(
        self, stamp: Time, metrics: Metrics, told: tuple[int, str], further: Mapping[str, str]
    ) -> None:
        """Publish the ``metrics`` with their ``stamp`` on every topic that has a subscriber.

        The status of the mechanism has level and text as ``told``, and the ``further`` values.
        """
        if self._all.get_subscription_count():
            self._all.publish(diagnostics_to_msg(stamp, self._statuses(metrics, told, further)))
        for name, publisher in self._scalars.items():
            if publisher.get_subscription_count():
                failed = name == 'active_failures'
                value = len(metrics.failures) if failed else getattr(metrics, name)
                # Every published number is finite: what is not known is not published.
                if value is not None:
                    publisher.publish(Float64(data=float(value)))
        for mode, publisher in self._arrays.items():
            if publisher.get_subscription_count():
                parts = metrics.struts if mode == 'hard' else metrics.actuators
                # The measure of a failed part is 0.
                values = {part.name: float(getattr(part, mode) or 0.0) for part in parts}
                publisher.publish(labelled_array_to_msg(values))

    def _statuses(
        self, metrics: Metrics, told: tuple[int, str], further: Mapping[str, str]
    ) -> Iterator[DiagnosticStatus]:
        """Yield the status of the mechanism, of every actuator and of every strut."""
        yield status_to_msg(
            'fault_tolerance: mechanism', f'{self._prefix}{self._name}',
            *told, {**_mechanism_values(metrics), **further},
        )
        for part in (*metrics.actuators, *metrics.struts):
            failed = part.failure != 'none'
            level = (ERROR if metrics.level == ERROR else WARN) if failed else OK
            yield status_to_msg(
                f'fault_tolerance: {part.name}', f'{self._prefix}{part.name}',
                level, f'{part.failure} failure' if failed else 'healthy', _part_values(part),
            )


def _mechanism_values(metrics: Metrics) -> Mapping[str, str]:
    return {
        'state': metrics.state,
        'failures': ', '.join(metrics.failures),
        'mobility': str(metrics.mobility),
        'lost': ', '.join(metrics.lost),
        'gained': ', '.join(metrics.gained),
        **{key: decimal(getattr(metrics, key)) for key in _DECIMALS},
        'saturation': ', '.join(metrics.saturation),
        'out_of_range': ', '.join(metrics.out_of_range),
        'sensorless': ', '.join(metrics.sensorless),
        'recovery_time_us': decimal(1e6 * metrics.reconfiguration_time),
        'time_since_report': _decimal_or_nothing(metrics.time_since_report),
        'internal_force': _decimal_or_nothing(metrics.internal_force),
        'groups': ', '.join(f'{one.name} next: {one.outlook}' for one in metrics.groups),
        'worst_next': metrics.worst_next and (
            f'{metrics.worst_next} {decimal(metrics.worst_next_measure)}'),
    }


def _decimal_or_nothing(value: float | None) -> str:
    return '' if value is None else decimal(value)


def _part_values(part: ActuatorMetrics | StrutMetrics) -> Mapping[str, str]:
    """Return the failure of a part, and the measures there are of it."""
    keys = ('hard',) if isinstance(part, StrutMetrics) else (
        'position', 'torque', 'position_optimality', 'torque_optimality'
    )
    measures = {key: getattr(part, key) for key in keys}
    return {
        'failure': part.failure,
        **{key: decimal(value) for key, value in measures.items() if value is not None},
    }
