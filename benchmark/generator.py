# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A plant at a fixed rate: joint states, task velocities, and a failure now and then.

``python -m benchmark.generator MECHANISM RATE PRIORITY`` publishes until a signal comes.
"""

from __future__ import annotations

import ctypes
import gc
import signal
import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from benchmark.echo import NEWEST
from benchmark.motion import circle
from benchmark.prober import report, twist
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.messages import joint_state_to_msg
from fault_tolerance.nodes.scheduling import set_realtime_priority

VELOCITIES_EVERY = 10
REPORTS_EVERY = 1.0
"""Seconds from a failure to its end, and from there to the next one."""

_TIMER_SLACK = 29  # PR_SET_TIMERSLACK


def main() -> int:
    """Publish until a signal."""
    name, rate, priority = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
    mechanism = mechanism_named(name)
    places = circle(name)
    leaving: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: leaving.append(number))
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node('generator', enable_rosout=False)
    joint_states = node.create_publisher(JointState, 'joint_states', NEWEST)
    velocities = node.create_publisher(TwistStamped, 'fault_tolerance/task_velocity', 10)
    reports = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
    clock = node.get_clock()
    zeros = 0.0 * places[0]
    names = mechanism.joint_state_names
    set_realtime_priority(priority)
    ctypes.CDLL(None).prctl(_TIMER_SLACK, 1, 0, 0, 0)
    gc.collect()
    gc.freeze()
    gc.disable()
    period, per_report = 1.0 / rate, int(REPORTS_EVERY * rate)
    due, count = time.monotonic(), 0
    while not leaving:
        place = places[count % len(places)]
        joint_states.publish(
            joint_state_to_msg(clock.now().to_msg(), names, place, zeros, zeros)
        )
        if count % VELOCITIES_EVERY == 1:
            velocities.publish(twist(node, (1e-3, 7e-4)))
        if count % per_report == per_report - 1:
            turn = count // per_report
            actuator = mechanism.actuator_names[(turn // 2) % len(names)]
            reports.publish(report(node, actuator, 'none' if turn % 2 else 'position'))
        count += 1
        due += period
        wait = due - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        elif wait < -0.1:  # it was stopped: what is past is not made up for
            due -= wait
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
