# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the controller publishes about the mechanism: state and metrics, in messages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, Float64MultiArray, String

from fault_tolerance.control.metrics import ActuatorMetrics, Metrics, StrutMetrics
from fault_tolerance.control.reports import ERROR, OK, WARN
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.messages import (
    decimal,
    diagnostics_to_msg,
    labelled_array_to_msg,
    status_to_msg,
)

SCALARS = (
    'position_tolerance',
    'torque_tolerance',
    'hard_tolerance',
    'retained_manipulability',
    'condition_number',
    'active_failures',
    'recovery_time',
)
"""The metrics that have a topic of their own."""

_DECIMALS = (
    'retained_manipulability',
    'position_measure',
    'torque_measure',
    'hard_measure',
    'smallest_singular_value',
    'condition_number',
    'flexure_strain',
    'misfit',
    'scale',
    'secondary_scale',
    'major_jump',
    'rate_jump',
)


class MetricsPublisher:
    """Publishes ``~/state`` and everything under ``~/metrics``.

    Parameters
    ----------
    node : Node
    mechanism : Mechanism
    prefix : str
        Put before hardware ids; may be empty.
    """

    def __init__(self, node: Node, mechanism: Mechanism, prefix: str) -> None:
        self._name = mechanism.name
        self._prefix = f'{prefix}/' if prefix else ''
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._state = node.create_publisher(String, '~/state', latched)
        self._all = node.create_publisher(DiagnosticArray, '~/metrics', 10)
        self._scalars = {
            name: node.create_publisher(Float64, f'~/metrics/{name}', 10) for name in SCALARS
        }
        self._arrays = {
            mode: node.create_publisher(Float64MultiArray, f'~/metrics/{mode}', 10)
            for mode in ('position', 'torque', 'hard')
        }
        self._heard: set[Publisher] = set()

    @property
    def heard(self) -> bool:
        """Whether anybody listened to any of the metrics when it was last looked."""
        return bool(self._heard)

    def look_for_listeners(self) -> None:
        """Find out which metrics are listened to; the others are not made up."""
        publishers = (self._all, *self._scalars.values(), *self._arrays.values())
        self._heard = {one for one in publishers if one.get_subscription_count()}

    def publish_state(self, state: str) -> None:
        """Publish the state, for those as well who come later."""
        self._state.publish(String(data=state))

    def publishing(
        self, stamp: Time, metrics: Metrics, further: Mapping[str, str]
    ) -> Iterator[None]:
        """Publish the metrics in every form that is listened to, piece by piece.

        Parameters
        ----------
        stamp : Time
        metrics : Metrics
        further : mapping of str to str
            More values of the mechanism.
        """
        if self._all in self._heard:
            statuses = [self._overall(metrics, further)]
            yield
            statuses += self._parts(metrics)
            yield
            self._all.publish(diagnostics_to_msg(stamp, statuses))
            yield
        for name, publisher in self._scalars.items():
            if publisher not in self._heard:
                continue
            if name == 'active_failures':
                value = float(len(metrics.failures))
            else:
                value = float(getattr(metrics, name))
            publisher.publish(Float64(data=value))
        for mode, publisher in self._arrays.items():
            if publisher not in self._heard:
                continue
            parts = metrics.struts if mode == 'hard' else metrics.actuators
            # What has failed already has nothing left to lose: 0, as every float is finite.
            values = {part.name: float(getattr(part, mode) or 0.0) for part in parts}
            publisher.publish(labelled_array_to_msg(values))

    def _overall(self, metrics: Metrics, further: Mapping[str, str]) -> DiagnosticStatus:
        """Return the status of the mechanism."""
        return status_to_msg(
            'fault_tolerance: mechanism', f'{self._prefix}{self._name}',
            metrics.level, metrics.message, {**_mechanism_values(metrics), **further},
        )

    def _parts(self, metrics: Metrics) -> list[DiagnosticStatus]:
        """Return a status for every actuator and for every strut."""
        statuses = []
        parts: tuple[ActuatorMetrics | StrutMetrics, ...] = (*metrics.actuators, *metrics.struts)
        for part in parts:
            failed = part.failure != 'none'
            level = (ERROR if metrics.level == ERROR else WARN) if failed else OK
            statuses.append(
                status_to_msg(
                    f'fault_tolerance: {part.name}', f'{self._prefix}{part.name}',
                    level, f'{part.failure} failure' if failed else 'healthy', _part_values(part),
                )
            )
        return statuses


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
        'inconsistent': ', '.join(metrics.inconsistent),
        'recovery_time_us': decimal(1e6 * metrics.recovery_time),
        'worst_next': f'{metrics.worst_next} {decimal(metrics.worst_next_measure)}'.strip(),
    }


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
