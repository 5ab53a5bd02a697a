# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""All three nodes are sent odd, wrong and broken messages: none dies, none sends nonsense.

`make fuzz SECONDS=600 SEED=7` goes on for longer, or again.
"""

from __future__ import annotations

import math
import os
import time
from array import array
from collections.abc import Callable

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from hostile import Hostile
from node_rig import Plant, Probe, values_of
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, String

from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import fitted_configuration

SECONDS = float(os.environ.get('FUZZ_SECONDS', '10'))
SEED = int(os.environ.get('FUZZ_SEED', '1'))
BURST = 1.0
"""Seconds of nonsense between two looks at whether the controller still works."""

AT_A_TIME = 8
STEPS_TO_ARRIVE = 10
LATE_ANSWERS = 10
ATTEMPTS = 20
LONG_PATIENCE = 60.0
MECHANISM = mechanism_named('mirror_4_strut')
NAMES = (*MECHANISM.actuator_names, *MECHANISM.strut_names)
TOLERABLE = [(mode, name) for mode in ('position', 'torque') for name in MECHANISM.actuator_names]
TOLERABLE += [('hard', name) for name in MECHANISM.strut_names]


def floats_of(message) -> list[float]:
    """Return all numbers in a message."""
    found = []
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        for one in value if isinstance(value, (list, array)) else [value]:
            if isinstance(one, float):
                found.append(one)
            elif hasattr(one, 'get_fields_and_field_types'):
                found += floats_of(one)
    return found


class Bench:
    """The three nodes, what they send, and somebody who sends them nonsense."""

    def __init__(self, probe: Probe, start) -> None:
        self.probe = probe
        node = probe.node
        # The mirror and its pointing loop live elsewhere: here the test plays the mirror.
        self.nodes = [
            # Patient with a busy machine, and soon ready to forget what was reported.
            start(
                'controller', hardware_id_prefix='robot', report_timeout=0.2,
                joint_state_timeout=1.0, command_timeout=1.0,
            ),
            start('fsm_simulator', 'other'),
            start('pointing_reference', 'other'),
        ]
        self.plant = Plant(probe, list(MECHANISM.actuator_names))
        self.wrong: list[str] = []
        self.heard = 0
        count = len(MECHANISM.actuators)
        for kind, topic, wanted in (
            (Float64MultiArray, 'velocity_controller/commands', count),
            (TwistStamped, 'fault_tolerance/achieved_velocity', 6),
            (Float64MultiArray, 'fault_tolerance/metrics/position_measures', count),
            (Float64MultiArray, 'fault_tolerance/metrics/torque_measures', count),
            (Float64MultiArray, 'fault_tolerance/metrics/hard_measures', len(MECHANISM.struts)),
            *((Float64, f'fault_tolerance/metrics/{name}', 1) for name in (
                'position_tolerance', 'torque_tolerance', 'hard_tolerance',
                'retained_manipulability', 'condition_number', 'active_failures',
                'reconfiguration_time', 'tracking_error')),
            (JointState, '/other/joint_states', 3 * count),
            (TwistStamped, '/other/fsm/mirror_velocity', 6),
            (TwistStamped, '/other/fault_tolerance/task_velocity', 6),
        ):
            node.create_subscription(
                kind, topic, self._checked(topic, wanted), qos_profile_sensor_data
            )
        self.health: dict[str, dict[str, str]] = {}
        node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.targets = [
            (self.plant.joint_states, Hostile.joint_state),
            (self.plant.velocities, Hostile.twist),
            (self.plant.diagnostics, Hostile.diagnostics),
            (node.create_publisher(
                Float64MultiArray, '/other/velocity_controller/commands', 10), Hostile.numbers),
            (node.create_publisher(String, '/other/fsm/inject_fault', 10), Hostile.words),
            (node.create_publisher(
                PoseStamped, '/other/fsm/mirror_pose', qos_profile_sensor_data), Hostile.pose),
        ]

    def burst(self, hostile: Hostile) -> int:
        """Send nonsense, with sane messages in between; return how many messages."""
        deadline, sent = time.monotonic() + BURST, 0
        while time.monotonic() < deadline:
            for _ in range(AT_A_TIME):
                publisher, make = hostile.choice(self.targets)
                message = make(hostile)
                publisher.publish(hostile.broken(message) if hostile.is_broken() else message)
            values = [hostile.valid(2e-5) for _ in MECHANISM.actuators]
            self.plant.joint_states.publish(self.plant.joint_state(values))
            self.plant.ask(hostile.valid(0.01), hostile.valid(0.01))
            sent += AT_A_TIME
            self.probe.spin(0.001)
        return sent

    def check(self) -> None:
        """Fail if a node has died, or has sent something that is no number."""
        for process in self.nodes:
            assert process.alive, process.output
            assert 'Traceback' not in process.output, process.output
        assert not self.wrong, self.wrong[:5]

    def caught_up(self) -> None:
        """Wait until everything that the controller has sent so far has been heard."""
        begin = self.plant.stamp()

        def later() -> bool:
            if not self.probe.metrics:
                return False
            stamp = self.probe.metrics[-1].header.stamp
            return (stamp.sec, stamp.nanosec) > (begin.sec, begin.nanosec)

        self.until(later, 'metrics')

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Go on as a mirror at rest until a condition holds."""

        def holds() -> bool:
            self.plant.step()
            return condition()

        self.probe.wait(holds, what, LONG_PATIENCE)

    def cleared(self) -> None:
        """Clear until nothing is reported any more, and the controller works again."""
        self.caught_up()

        def nominal() -> bool:
            self.probe.clear()
            self.caught_up()
            return self.probe.state == 'nominal' and not self.probe.mechanism['failures']

        self.probe.wait(nominal, 'nominal again', LONG_PATIENCE)

    def fail(self, mode: str, name: str) -> None:
        """Report a failure until it is the only one: nonsense may still be waiting."""

        def alone() -> bool:
            self.plant.report(mode, name)
            self.caught_up()
            if self.probe.mechanism['failures'] == f'{mode}:{name}':
                return True
            self.probe.clear()
            return False

        self.probe.wait(alone, f'{mode} {name} to be known', LONG_PATIENCE)

    def moving_with(
        self, mode: str, name: str, values: list[float], hostile: Hostile
    ) -> np.ndarray:
        """Return a command (N,) at the joint values given with one failure and no other."""
        for _ in range(ATTEMPTS):
            self.fail(mode, name)
            # On a busy machine joint states from before may still be on their way: until these
            # have passed, a command may answer those.
            for _ in range(STEPS_TO_ARRIVE):
                self.plant.step(self.plant.joint_state(values))
            self.plant.asked = (hostile.valid(0.01), hostile.valid(0.01))
            found = self.moving(values)
            self.caught_up()
            # Or else nonsense that was still waiting has broken something more meanwhile.
            if any(found) and self.probe.mechanism['failures'] == f'{mode}:{name}':
                return found
            self.plant.asked = None
            self.cleared()
        raise AssertionError(f'{mode} {name}: no command in {ATTEMPTS} attempts')

    def moving(self, values: list[float]) -> np.ndarray:
        """Return a command (N,) at the joint values given, not all zeros unless it is stopped."""
        found: list[float] = []

        def moves() -> bool:
            found[:] = self.plant.step(self.plant.joint_state(values))
            return any(found) or self.probe.state == 'stopped'

        self.probe.wait(moves, 'a command that moves', LONG_PATIENCE)
        return np.array(found)

    def _checked(self, topic: str, wanted: int):
        def check(message) -> None:
            self.heard += 1
            found = floats_of(message)
            # Before the first joint state there are no measures to tell.
            unknown = not found and '/metrics/' in topic
            if not (unknown or len(found) == wanted) or not all(map(math.isfinite, found)):
                self.wrong.append(f'{topic}: {found}, not {wanted} numbers')

        return check

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if ': ' in status.name and not status.name.startswith('drive'):
                self.health[status.name] = values_of(status)

    def rejected(self, name: str) -> int:
        """Return how much a node says that it has left aside."""
        counts = self.health.get(name, {})
        return sum(int(value) for key, value in counts.items() if key.startswith('rejected_'))


@pytest.fixture
def bench(probe, start):
    bench = Bench(probe, start)
    bench.plant.connect()
    probe.wait(
        lambda: all(publisher.get_subscription_count() for publisher, _ in bench.targets),
        'the other nodes',
    )
    return bench


def expected_space(values: list[float], mode: str, name: str) -> np.ndarray:
    """Return range(T^) with passive rates (N, n), by definition."""
    failures = failure_set(MECHANISM, [(mode, name)])
    found = fitted_configuration(MECHANISM, np.array(values), failures.lost)
    post = reconfigured(strut_rows(found), failures)
    assert post.verdict.tolerable
    return post.present.rate_map


def test_nonsense_on_every_input(bench, probe):
    print(f'seed {SEED}, {SECONDS:g} s')
    hostile = Hostile(SEED, NAMES, bench.plant.stamp)
    deadline, sent, rounds = time.monotonic() + SECONDS, 0, 0
    while time.monotonic() < deadline or rounds == 0:
        sent, rounds = sent + bench.burst(hostile), rounds + 1
        bench.check()

        bench.plant.asked = None
        bench.cleared()
        bench.check()
        mode, name = hostile.choice(TOLERABLE)
        # Of those that close the loops: equal and opposite, as a turn about one axis gives them.
        turn = hostile.valid(2e-5)
        values = [turn, 0.0, -turn, 0.0]
        space = expected_space(values, mode, name)
        found = bench.moving_with(mode, name, values, hostile)
        for _ in range(LATE_ANSWERS):
            inside = space @ np.linalg.lstsq(space, found, rcond=None)[0]
            if np.allclose(found, inside, rtol=1e-7, atol=1e-9 * np.abs(found).max()):
                break
            # A busy machine may still answer a joint state from before.
            found = bench.moving(values)
        np.testing.assert_allclose(found, inside, atol=1e-9 * np.abs(found).max())
        if mode == 'position':
            assert found[MECHANISM.actuator_names.index(name)] == 0.0
        bench.plant.asked = None
        bench.cleared()

    # Everybody has counted what was left aside, and the mirror that was sent nonsense still works.
    names = ('fault_tolerance: controller', 'other/fsm: simulator', 'other/pointing: reference')
    probe.wait(lambda: all(bench.rejected(one) for one in names), f'counters in {bench.health}')
    faults = bench.targets[4][0]
    poses = probe.heard(JointState, '/other/joint_states', qos_profile_sensor_data)
    faults.publish(String(data='ok all'))
    probe.wait(lambda: len(poses) > 10, 'the simulator')
    bench.check()
    assert bench.heard > 100
    print(f'{sent} messages of nonsense in {rounds} rounds, {bench.heard} answers, left aside: '
          + ', '.join(f'{one} {bench.rejected(one)}' for one in names))
