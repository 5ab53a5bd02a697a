# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A failure and a clearing every second, for long: memory stays, nothing drifts, commands come.

`make soak` goes on for half an hour.
"""

from __future__ import annotations

import itertools
import math
import os
import time
from pathlib import Path

from geometry_msgs.msg import PoseStamped, Vector3Stamped
from node_rig import values_of
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.mechanism.catalogue import mechanism_named

SECONDS = float(os.environ.get('SOAK_SECONDS', '30'))
WARM_UP = 10
"""Cycles until memory counts: by then every failure has been met once, and every table filled."""

LARGEST_GROWTH, GROWTH_A_CYCLE = 5.0, 0.1
"""Megabytes; where there are few cycles, less counts."""

MECHANISM = mechanism_named('mirror_4_strut')
HEIGHT = float(MECHANISM.origin[2])
FAULTS = (
    'position theta_1', 'torque theta_2', 'hard strut_3', 'position theta_4', 'torque strut_1',
    'hard strut_2', 'position strut_3', 'torque theta_4', 'hard strut_1', 'position theta_2',
)
MEASURES = ('position', 'torque', 'hard')
PATIENCE = 30.0


def resident_megabytes(process: int) -> float:
    pages = int(Path(f'/proc/{process}/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


class Soak:
    """The three nodes, and somebody who breaks the mirror and mends it again and again."""

    def __init__(self, probe, start) -> None:
        self.probe = probe
        best_kernel()  # a node that loads machine code later takes 130 MB more from then on
        self.controller = start('controller')
        self.others = [start('fsm_simulator'), start('pointing_reference')]
        node = probe.node
        self._faults = node.create_publisher(String, 'fsm/inject_fault', 10)
        self._clear = node.create_client(Trigger, 'fault_tolerance/clear_failures')
        self.commands, self.longest_gap, self._last = 0, 0.0, math.inf
        self.wrong: list[list[float]] = []
        node.create_subscription(
            Float64MultiArray, 'velocity_controller/commands', self._on_command, 10
        )
        self.readings = 0
        node.create_subscription(
            JointState, 'joint_states', self._on_joint_state, qos_profile_sensor_data
        )
        self.errors: list[float] = []
        node.create_subscription(Vector3Stamped, 'pointing/error', self._on_error, 10)
        self.heights: list[float] = []
        node.create_subscription(
            PoseStamped, 'fsm/mirror_pose',
            lambda pose: self.heights.append(pose.pose.position.z - HEIGHT),
            qos_profile_sensor_data,
        )
        probe.wait_for_state('nominal')
        probe.wait(lambda: self._faults.get_subscription_count(), 'the simulator')
        probe.wait(self._clear.service_is_ready, 'the service')
        probe.wait(lambda: self.commands > 250, 'commands')

    def cycle(self, fault: str) -> None:
        """Break, mend and clear within a second."""
        begin = time.monotonic()
        self.forget()
        self._faults.publish(String(data=fault))
        self.probe.wait(lambda: self.probe.state == 'degraded', fault, PATIENCE)
        self._pass(begin + 0.4)
        self._faults.publish(String(data='ok all'))
        self.clear()
        self._pass(begin + 1.0)

    def clear(self) -> None:
        """Ask for the failures to be released until all of them are."""
        future, asked = self._clear.call_async(Trigger.Request()), time.monotonic()

        def released() -> bool:
            nonlocal future, asked
            if self.probe.state == 'nominal':
                return True
            # The report that all is well may come after the first request.
            if time.monotonic() - asked > 0.1:
                future, asked = self._clear.call_async(Trigger.Request()), time.monotonic()
            return False

        self.probe.wait(released, 'nominal', PATIENCE)

    def measures(self) -> dict[str, float]:
        """Return the measures of every part, with nothing broken."""
        self.probe.metrics.clear()
        self.probe.wait(lambda: self.probe.metrics, 'metrics')
        return {
            f'{status.name} {key}': float(value)
            for status in self.probe.metrics[-1].status
            for key, value in values_of(status).items()
            if key in MEASURES
        }

    def points_well(self) -> bool:
        """Tell whether the mirror is where it should be: 50 microradians, a micrometre."""
        return bool(self.errors and self.heights) and (
            self.errors[-1] < 50e-6**2 and abs(self.heights[-1]) < 1e-6)

    def forget(self) -> None:
        """Keep this process from growing instead."""
        for heard in (self.probe.commands, self.probe.metrics, self.errors, self.heights):
            heard.clear()
        del self.probe.states[:-1]

    def _pass(self, until: float) -> None:
        self.probe.spin(max(0.0, until - time.monotonic()))

    def _on_command(self, message: Float64MultiArray) -> None:
        now = time.monotonic()
        self.longest_gap = max(self.longest_gap, now - self._last)
        self._last = now
        self.commands += 1
        if len(message.data) != len(MECHANISM.actuators) or not all(map(math.isfinite,
                                                                        message.data)):
            self.wrong.append(list(message.data))

    def _on_joint_state(self, _: JointState) -> None:
        self.readings += 1

    def _on_error(self, message: Vector3Stamped) -> None:
        self.errors.append(message.vector.x**2 + message.vector.y**2)


def test_a_failure_and_a_clearing_every_second(probe, start):
    soak = Soak(probe, start)
    before = soak.measures()
    begin, megabytes = time.monotonic(), []
    for fault in itertools.cycle(FAULTS):
        soak.cycle(fault)
        megabytes.append(resident_megabytes(soak.controller.process.pid))
        assert soak.controller.alive, soak.controller.output
        passed = time.monotonic() - begin
        if passed > SECONDS and len(megabytes) > 2 * WARM_UP:
            break
    after = soak.measures()

    growth = megabytes[-1] - megabytes[WARM_UP - 1]
    print(
        f'{len(megabytes)} failures in {passed:.0f} s; memory {megabytes[WARM_UP - 1]:.1f} MB and '
        f'{growth:+.2f} MB; '
        f'{soak.commands / passed:.0f} commands/s for {soak.readings / passed:.0f} joint '
        f'states/s, longest gap {soak.longest_gap:.2f} s'
    )
    most = min(LARGEST_GROWTH, GROWTH_A_CYCLE * (len(megabytes) - WARM_UP))
    assert growth < most, megabytes
    assert not soak.wrong
    # A busy machine skips joint states; the newest is what counts.
    assert soak.longest_gap < 2.0
    assert soak.commands > 10 * passed
    # Nothing has drifted: the measures are those before, the mirror is where it should be.
    assert before.keys() == after.keys()
    assert all(abs(after[name] - value) < 1e-3 for name, value in before.items()), (before, after)
    soak.forget()
    probe.wait(soak.points_well, 'the mirror to point where it should', PATIENCE)
    assert probe.state == 'nominal'
    assert all(process.alive for process in (soak.controller, *soak.others))
    assert 'Traceback' not in soak.controller.output
