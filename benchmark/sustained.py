# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A thousand joint states a second, all in: what rate of commands comes, and how evenly.

A generator publishes joint states of a moving mechanism, task velocities, and every second a
failure or its end; somebody listens to commands, metrics and achieved velocity. Intervals are
between the times at which the controller published, as the middleware stamps them.

``python -m benchmark.sustained`` runs this alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic, sleep
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from benchmark.middleware import MECHANISM, controller_command
from benchmark.names import SUSTAINED, SUSTAINED_REAL_TIME
from benchmark.prober import START_PATIENCE, Prober, probing
from benchmark.samples import main
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.spinning import make_executor

RATE = 1000.0
DURATION = 60.0
QUICK_DURATION = 2.0
PRIORITY = 50
_PERIOD = 0.01
_SENSOR = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


class Stamps:
    """The times at which the messages of a topic were published."""

    def __init__(self, prober: Prober, kind: type, topic: str, qos: Any = 1000) -> None:
        self.nanoseconds: list[int] = []
        # Taken by hand: EventsExecutor fails where a callback wants the time of publication.
        self._subscription = prober.node.create_subscription(kind, topic, print, qos, raw=True)

    def take(self) -> None:
        """Take what has come."""
        with (handle := self._subscription.handle):
            while (taken := handle.take_message(self._subscription.msg_type, True)) is not None:
                self.nanoseconds.append(taken[1]['source_timestamp'])

    @property
    def intervals_us(self) -> FloatArray:
        """Microseconds from one to the next."""
        return np.diff(np.array(self.nanoseconds, dtype=np.float64)) * 1e-3

    @property
    def rate(self) -> float:
        """Messages per second."""
        if len(self.nanoseconds) < 2:
            return 0.0
        first, last = self.nanoseconds[0], self.nanoseconds[-1]
        return (len(self.nanoseconds) - 1) / ((last - first) * 1e-9)


def run(repeats: int = 1, quick: bool = False) -> list[dict[str, Any]]:
    """Return the rows of this benchmark: with ordinary and with real-time scheduling."""
    del repeats  # its samples are the messages of a minute
    duration = QUICK_DURATION if quick else DURATION
    return [
        _measured(SUSTAINED, duration, 0),
        _measured(SUSTAINED_REAL_TIME, duration, PRIORITY),
    ]


def _measured(name: str, duration: float, priority: int) -> dict[str, Any]:
    commands = {
        'controller': [
            *controller_command(MECHANISM), '-p', f'realtime_priority:={priority}'
        ],
        'generator': ['benchmark.generator', MECHANISM, str(RATE), str(priority)],
    }
    with probing(commands) as (prober, processes):
        given = Stamps(prober, JointState, 'joint_states', _SENSOR)
        sent = Stamps(prober, Float64MultiArray, 'velocity_controller/commands')
        metrics = Stamps(prober, DiagnosticArray, 'fault_tolerance/metrics')
        achieved = Stamps(prober, TwistStamped, 'fault_tolerance/achieved_velocity')
        heard = (given, sent, metrics, achieved)
        _listen(heard, START_PATIENCE, until=lambda: len(sent.nanoseconds) > 1000)
        for stamps in heard:
            stamps.nanoseconds.clear()
        before = processes.cpu('controller')
        _listen(heard, duration)
        processes.check()
        cpu = processes.cpu('controller') - before
        error = np.abs(sent.intervals_us - 1e6 / RATE)
        given_error = np.abs(given.intervals_us - 1e6 / RATE)
        count = len(sent.nanoseconds)
        executor_kind = type(make_executor()).__name__
        return {
            'name': name,
            'mechanism': MECHANISM,
            'struts': len(mechanism_named(MECHANISM).struts),
            'p50_us': round(float(np.percentile(error, 50)), 1),
            'p99_us': round(float(np.percentile(error, 99)), 1),
            'repeats': 1,
            'note': f'error of the interval between commands; {duration:g} s, '
            f'{executor_kind}',
            'rate_hz': round(sent.rate, 2),
            'longest_interval_us': round(float(sent.intervals_us.max()), 1),
            'input_rate_hz': round(given.rate, 2),
            'input_p99_us': round(float(np.percentile(given_error, 99)), 1),
            'cpu_us': round(1e6 * cpu / count, 1),
            'metrics_rate_hz': round(len(metrics.nanoseconds) / duration, 2),
            'achieved_velocity_rate_hz': round(achieved.rate, 2),
        }


def _listen(
    heard: Sequence[Stamps], duration: float, until: Callable[[], bool] = lambda: False
) -> None:
    """Take messages for so long, or until a condition holds."""
    end = monotonic() + duration
    while monotonic() < end and not until():
        for stamps in heard:
            stamps.take()
        sleep(_PERIOD)


if __name__ == '__main__':
    main(run)
