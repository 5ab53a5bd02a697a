# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The state of a running controller, from its topics, for the live view."""

from __future__ import annotations

import math
from collections import deque
from functools import partial
from operator import itemgetter
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from std_msgs.msg import Float64MultiArray, String

from fault_tolerance.analysis import topics
from fault_tolerance.analysis.recorded_data import DETECTION_STATUS
from fault_tolerance.analysis.snapshot import Actuator, Snapshot, Strut, Suspect
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.operator_client import CONTROLLER

ERRORS_KEPT = 300
"""Pointing errors in the sparkline: three seconds at 100 Hz."""

REFRESH_PERIOD = 0.2
"""Seconds between two pictures."""

SUSPICIONS_KEPT = 1.5
"""Seconds for which a suspicion is shown; a controller repeats it every second."""

# Decay per command of the largest recent rate: half in about a second at 100 Hz.
_FORGETTING = 0.993
_UNITS = {'revolute': 'rad/s', 'prismatic': 'm/s'}
_SHOWN = {
    'retained_manipulability': 'manipulability retained',
    'condition_number': 'condition number',
    'recovery_time_us': 'reconfiguration time, us',
}


class ControllerMonitor:
    """Subscribes to one controller, in the namespace of ``node``, and summarises its state.

    ``mechanism`` is for limits and units; by default the shipped one that the controller names.
    The controller's own name is ``controller``.
    """

    def __init__(
        self, node: Node, mechanism: Mechanism | None = None, controller: str = CONTROLLER
    ) -> None:
        self._mechanism = mechanism
        self._namespace = node.get_namespace()
        self._state = ''
        self._heard = monotonic()
        self._metrics: DiagnosticArray | None = None
        self._suspects: tuple[Suspect, ...] = ()
        self._suspected = -math.inf
        self._rates: list[float] = []
        self._fastest = 0.0
        self._errors: deque[float] = deque(maxlen=ERRORS_KEPT)
        self._names: dict[str, list[str]] = {'position': [], 'hard': []}
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        state = topics.renamed(topics.STATE, controller)
        metrics = topics.renamed(topics.METRICS, controller)
        node.create_subscription(String, state, self._take_state, latched)
        node.create_subscription(DiagnosticArray, metrics, self._take_metrics, 10)
        node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._take_diagnostics, 10)
        node.create_subscription(Float64MultiArray, topics.COMMANDS, self._take_rates, 10)
        node.create_subscription(
            Vector3Stamped, topics.POINTING_ERROR, self._take_error, qos_profile_sensor_data
        )
        for mode in self._names:
            name, take = topics.ARRAYS[mode], partial(self._take_names, mode)
            node.create_subscription(Float64MultiArray, f'{metrics}/{name}', take, 10)

    @property
    def heard(self) -> bool:
        """Whether the controller has told its state."""
        return bool(self._state)

    def snapshot(self) -> Snapshot:
        """Return a summary of the newest messages."""
        status = self._metrics.status if self._metrics else []
        by_name = {one.name.partition(': ')[2]: one for one in status}
        overall = _values(by_name.get('mechanism'))
        told = by_name['mechanism'].message if 'mechanism' in by_name else ''
        worst, measure = _worst(overall)
        return Snapshot(
            title=self._title(by_name.get('mechanism')),
            state=self._state,
            # ~/state is published before the metrics: until they follow, the reason is unknown.
            reason=told.partition(': ')[2] if told.startswith(self._state) else '',
            failures=tuple(filter(None, overall.get('failures', '').split(', '))),
            worst_next=worst,
            worst_measure=measure,
            values={words: number for key, words in _SHOWN.items()
                    if (number := _number(overall.get(key)))},
            actuators=self._actuators(by_name),
            struts=tuple(
                Strut(name, found.get('failure', 'none'), _number(found.get('hard')))
                for name in self._names['hard']
                for found in [_values(by_name.get(name))]
            ),
            errors=tuple(self._errors),
            fastest=self._fastest,
            suspects=self._suspects if monotonic() - self._suspected < SUSPICIONS_KEPT else (),
            alike=tuple(
                tuple(group.split(', '))
                for group in filter(None, overall.get('not_told_apart', '').split('; '))
            ),
            age=monotonic() - self._heard,
        )

    def _actuators(self, by_name: dict[str, DiagnosticStatus]) -> tuple[Actuator, ...]:
        names = self._names['position']
        rates = self._rates if len(self._rates) == len(names) else [None] * len(names)
        machine = self._mechanism
        if machine is None or list(machine.actuator_names) != names:
            limits, units = [math.inf] * len(names), [''] * len(names)
        else:
            limits = machine.velocity_limits.tolist()
            units = [_UNITS[one.kind] for one in machine.actuators]
        found = [_values(by_name.get(name)) for name in names]
        return tuple(
            Actuator(name, values.get('failure', 'none'),
                     _number(values.get('position')), _number(values.get('torque')), *rest)
            for name, values, *rest in zip(names, found, rates, limits, units, strict=True)
        )

    def _title(self, status: DiagnosticStatus | None) -> str:
        name = status.hardware_id.rpartition('/')[2] if status else 'fault_tolerance'
        return name if self._namespace == '/' else f'{name} in {self._namespace}'

    def _take_state(self, message: String) -> None:
        self._state = message.data
        self._heard = monotonic()

    def _take_metrics(self, message: DiagnosticArray) -> None:
        if self._metrics is None and self._mechanism is None and message.status:
            self._mechanism = _shipped(message.status[0].hardware_id.rpartition('/')[2])
        self._metrics = message
        self._heard = monotonic()

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        """Take what detection suspects on this robot."""
        place = self._namespace.strip('/')
        if self._metrics is not None and self._metrics.status:
            place = self._metrics.status[0].hardware_id.rpartition('/')[0]
        found = [
            _suspect(status) for status in message.status
            if status.name == DETECTION_STATUS and status.hardware_id.rpartition('/')[0] == place
        ]
        if found:
            self._suspects, self._suspected = tuple(found), monotonic()

    def _take_rates(self, message: Float64MultiArray) -> None:
        self._rates = message.data.tolist()
        largest = max((abs(rate) for rate in self._rates), default=0.0)
        self._fastest = max(largest, _FORGETTING * self._fastest)

    def _take_error(self, message: Vector3Stamped) -> None:
        self._errors.append(math.hypot(message.vector.x, message.vector.y))

    def _take_names(self, mode: str, message: Float64MultiArray) -> None:
        self._names[mode] = topics.labels_in(message)


def _values(status: DiagnosticStatus | None) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values} if status else {}


def _worst(values: dict[str, str]) -> tuple[str, float]:
    """Return the next failure that hurts most, and its measure: with what is suspected, too."""
    told = [
        (name, _number(measure) or 0.0) for key in ('worst_next', 'worst_next_suspected')
        for name, _, measure in [values.get(key, '').rpartition(' ')]
    ]
    # While it is stopped there is none.
    return min(filter(itemgetter(0), told), key=itemgetter(1)) if told[0][0] else ('', 0.0)


def _suspect(status: DiagnosticStatus) -> Suspect:
    values = _values(status)
    candidates = tuple(filter(None, values.get('candidates', '').split(',')))
    return Suspect(
        candidates or (status.hardware_id.rpartition('/')[2],),
        _number(values.get('log_odds')), values.get('would_separate', ''),
    )


def _number(text: str | None) -> float | None:
    try:
        number = float(text) if text else math.nan
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def _shipped(name: str) -> Mechanism | None:
    try:
        return mechanism_named(name)
    except FaultToleranceError:
        return None
