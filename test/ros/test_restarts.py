# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Controller and simulator end and come back in any order, by a signal or killed."""

from __future__ import annotations

import signal
import time

import pytest
from geometry_msgs.msg import TwistStamped
from node_rig import CALM, Probe
from std_msgs.msg import String

ASKED = (0.001, 0.002)


class Pair:
    """A controller and a simulator, each to be started and ended on its own."""

    def __init__(self, probe: Probe, start) -> None:
        self.probe, self._start = probe, start
        self.joint_states = probe.joint_states()
        self._faults = probe.node.create_publisher(String, 'fsm/inject_fault', 10)
        self._velocities = probe.node.create_publisher(
            TwistStamped, 'fault_tolerance/task_velocity', 10
        )

    def start(self, module: str):
        rate = {'rate': CALM} if module == 'fsm_simulator' else {}
        return self._start(module, mechanism='fsm_4_strut', **rate)

    def inject(self, words: str, **reported: str) -> None:
        """Break or mend something, and wait until the metrics show the failures it leaves."""
        self.probe.wait(self._faults.get_subscription_count, 'the simulator')
        self._faults.publish(String(data=words))

    def wait_for_failures(self, failures: str) -> None:
        self.probe.wait(lambda: self.probe.mechanism.get('failures') == failures, failures)

    def asked(self) -> bool:
        message = TwistStamped()
        message.header.stamp = self.probe.node.get_clock().now().to_msg()
        message.twist.angular.x, message.twist.angular.y = ASKED
        self._velocities.publish(message)
        return True

    def command(self) -> list[float]:
        """Return a command that moves, as answer to the velocity asked for."""
        self.probe.commands.clear()
        self.probe.wait(
            lambda: self.asked() and self.probe.commands and any(self.probe.commands[-1].data),
            'a command that moves',
        )
        return list(self.probe.commands[-1].data)

    @property
    def moving(self) -> bool:
        return any(abs(speed) > 1e-5 for speed in self.joint_states[-1].velocity)

    def clear(self) -> None:
        """Clear until something is released: what was mended may still be on its way."""
        self.probe.wait(lambda: self.probe.clear().success, 'a release')


@pytest.fixture
def pair(start, probe):
    return Pair(probe, start)


def test_killed_and_restarted_the_controller_is_degraded_again_with_the_same_kinematics(
    pair, probe
):
    controller = pair.start('controller')
    probe.wait_for_state('waiting')
    pair.start('fsm_simulator')
    probe.wait_for_state('nominal')
    healthy = pair.command()

    pair.inject('stuck theta_4')
    pair.wait_for_failures('position:theta_4')
    before, told = pair.command(), probe.mechanism
    assert before[3] == 0.0
    assert before != pytest.approx(healthy, rel=0.1)
    probe.wait(lambda: pair.asked() and pair.moving, 'the mirror to move')
    controller.signal(signal.SIGKILL)
    killed = time.monotonic()
    probe.wait(lambda: pair.asked() and not pair.moving, 'the mirror to stop')
    assert time.monotonic() - killed < 1.0

    probe.states.clear()
    probe.metrics.clear()
    restarted = pair.start('controller')
    probe.wait(lambda: probe.states, 'the first state')
    appeared = time.monotonic()
    probe.wait_for_state('degraded')
    assert time.monotonic() - appeared < 1.5
    pair.wait_for_failures('position:theta_4')
    # The same T^ and J^: the command for a velocity is T^ times the inverse of J^_m.
    assert pair.command() == pytest.approx(before, rel=1e-2, abs=1e-9)
    for key in ('mobility', 'lost', 'gained'):
        assert probe.mechanism[key] == told[key]
    for key in ('retained_manipulability', 'smallest_singular_value', 'position_measure'):
        assert float(probe.mechanism[key]) == pytest.approx(float(told[key]), rel=1e-2)
    assert restarted.alive


def test_the_simulator_may_be_restarted_and_what_had_failed_waits_for_a_clear(pair, probe):
    simulator = pair.start('fsm_simulator')
    probe.wait(lambda: pair.joint_states, 'joint states', 60.0)
    controller = pair.start('controller')
    probe.wait_for_state('nominal')

    # Two failures stop it; with one of them repaired and cleared it is back at work.
    pair.inject('stuck theta_1')
    pair.inject('stuck theta_2')
    pair.wait_for_failures('position:theta_1, position:theta_2')
    assert probe.mechanism['state'] == 'stopped'
    pair.inject('ok theta_1')
    pair.clear()
    pair.wait_for_failures('position:theta_2')
    probe.wait_for_state('degraded')
    assert pair.command()[1] == 0.0

    simulator.signal(signal.SIGKILL)
    probe.wait_for_state('hold')
    assert list(probe.commands[-1].data) == [0.0] * 4
    again = pair.start('fsm_simulator')
    probe.wait_for_state('degraded')
    assert pair.command()[1] == 0.0
    # The new one is healthy, and says nothing of theta_2.
    pair.clear()
    probe.wait_for_state('nominal')
    assert pair.command()[1] != 0.0
    assert controller.alive
    assert again.alive
