# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Whatever arrives, the controller lives, says what it left aside, and commands finite rates."""

from __future__ import annotations

import time
from math import inf, isfinite, nan

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TwistStamped
from node_rig import Plant, Probe, values_of
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

NOMINAL = [0.0070711, -0.0141421, -0.0070711, 0.0141421]
STUCK_4 = [-0.0070711, -0.0282843, -0.0212132, 0.0]
ATTEMPTS = 5
NAMES = ['theta_1', 'theta_2', 'theta_3', 'theta_4']


ALL = (*NAMES, 'strut_1', 'strut_2', 'strut_3', 'strut_4')


class Shared:
    """One controller for all tests here, and the drives and the operator the test plays."""

    def __init__(self, start) -> None:
        self.probe = Probe()
        self.controller = start('controller', mechanism='fsm_4_strut')
        self.plant = Plant(self.probe, NAMES)
        self.plant.connect()

    def renew(self) -> None:
        """Bring it back to where it began: nominal, at rest, with nothing reported or asked."""
        probe, plant = self.probe, self.plant
        plant.asked = None

        def at_rest() -> bool:
            command = plant.step()
            if probe.state in ('degraded', 'stopped'):
                plant.report('none', *ALL)
                probe.clear()
            return probe.state == 'nominal' and command == [0.0] * 4

        def told() -> bool:
            plant.step()
            return bool(probe.metrics) and probe.mechanism['failures'] == ''

        probe.wait(at_rest, 'rest')
        probe.metrics.clear()
        probe.wait(told, 'metrics without failures')
        plant.step()
        probe.wait_for_state('nominal')
        del probe.states[:-1]


@pytest.fixture(scope='module')
def shared(ros, start_for_module):
    shared = Shared(start_for_module)
    yield shared
    shared.probe.close()


@pytest.fixture
def controller(shared):
    return shared.controller


@pytest.fixture
def probe(shared):
    return shared.probe


@pytest.fixture
def plant(shared):
    """Drives of a controller that is as good as new; it lives through every test."""
    assert shared.controller.alive
    shared.renew()
    yield shared.plant
    assert shared.controller.alive
    assert 'Traceback' not in shared.controller.output


@pytest.fixture
def asking(plant):
    """Drives and an operator who asks for the velocity of the paper's worked case."""
    plant.asked = (0.01, 0.02)
    return plant


@pytest.fixture
def health(plant, probe):
    """Return what the counters of the controller have gained in this test, as they come."""
    heard = probe.heard(DiagnosticArray, '/diagnostics')
    begin = plant.stamp()

    def counts() -> dict[str, int] | None:
        mine = [
            status
            for message in heard
            for status in message.status
            if status.name == 'fault_tolerance: controller'
            and (message.header.stamp.sec, message.header.stamp.nanosec)
            > (begin.sec, begin.nanosec)
        ]
        found = values_of(mine[-1]) if mine else {}
        return {
            key: int(value) for key, value in found.items()
            if key.startswith(('rejected_', 'warned_'))
        } if mine else None

    # From here on counted: everything that earlier tests had sent has been taken by now.
    probe.wait(lambda: plant.step() and counts() is not None, 'the health of the controller')
    before = counts() or {}

    def gained() -> dict[str, int]:
        return {
            key: value - before.get(key, 0) for key, value in (counts() or {}).items()
            if value > before.get(key, 0)
        }

    return gained


def test_commands_are_those_of_the_worked_case(asking, probe):
    asking.settle(NOMINAL)
    assert probe.state == 'nominal'


def test_nothing_moves_before_anybody_asks(start, ros):
    probe = Probe('new')
    start('controller', 'new', mechanism='fsm_4_strut')
    plant = Plant(probe, NAMES)
    plant.connect()
    assert plant.step() == [0.0] * 4
    assert {tuple(message.data) for message in probe.commands} == {(0.0,) * 4}
    probe.close()


def test_every_joint_state_is_answered_by_one_command(asking, probe):
    asking.settle(NOMINAL)
    probe.commands.clear()
    for number in range(1, 21):
        asking.step()
        assert len(probe.commands) == number


@pytest.mark.parametrize('reliability', ReliabilityPolicy.__members__.values())
def test_joint_states_of_any_reliability_arrive(plant, probe, reliability):
    if reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT):
        node = probe.node
        usual = plant.joint_states
        plant.joint_states = node.create_publisher(
            JointState, 'joint_states', QoSProfile(depth=10, reliability=reliability)
        )
        try:
            probe.wait(plant.joint_states.get_subscription_count, 'the controller')
            probe.commands.clear()
            assert plant.step() == [0.0] * 4
        finally:
            node.destroy_publisher(plant.joint_states)
            plant.joint_states = usual


REJECTED = [
    ('not_finite', lambda message: message.position.__setitem__(2, nan)),
    ('not_finite', lambda message: message.position.__setitem__(0, inf)),
    ('length', lambda message: message.position.pop()),
    ('missing_joint', lambda message: message.name.__setitem__(1, 'other')),
    ('doubled_joint', lambda message: message.name.__setitem__(1, 'theta_1')),
]


@pytest.mark.parametrize(('reason', 'spoil'), REJECTED)
def test_a_bad_joint_state_is_rejected_and_counted(
    asking, probe, health, controller, reason, spoil
):
    asking.settle(NOMINAL)
    bad = asking.joint_state()
    spoil(bad)

    def counted() -> bool:
        asking.joint_states.publish(bad)
        probe.spin(0.05)
        return health().get(f'rejected_{reason}', 0) >= 1

    probe.wait(counted, 'a counter')
    asking.settle(NOMINAL)
    assert controller.alive
    assert 'Traceback' not in controller.output
    assert all(isfinite(rate) for message in probe.commands for rate in message.data)


def test_a_flood_of_nan_is_logged_once_a_second_at_most(asking, probe, health, controller):
    asking.settle(NOMINAL)
    bad = asking.joint_state([nan] * 4)
    known, begin = len(controller.output), time.monotonic()

    def counted() -> bool:
        asking.joint_states.publish(bad)
        probe.spin(0.005)
        lasted = time.monotonic() - begin
        return lasted > 2.0 and health().get('rejected_not_finite', 0) >= 50

    probe.wait(counted, 'a counter')
    lasted = time.monotonic() - begin
    lines = [line for line in controller.output[known:].splitlines() if 'the position of' in line]
    assert 1 <= len(lines) <= lasted + 1.0
    assert 'theta_1, theta_2, theta_3, theta_4' in lines[0]


def test_order_and_strangers_do_not_matter(asking, probe):
    asking.settle(NOMINAL)
    mixed = asking.joint_state(
        [nan, 0.0, 0.0, 0.0, 0.0], name=['hinge', 'theta_3', 'theta_1', 'theta_4', 'theta_2']
    )
    assert asking.step(mixed) == pytest.approx(NOMINAL, abs=1e-6)


def test_joint_states_that_cease_lead_to_hold_and_back(asking, probe):
    asking.settle(NOMINAL)
    probe.wait_for_state('hold')
    assert list(probe.commands[-1].data) == [0.0] * 4
    probe.wait(lambda: probe.mechanism['state'] == 'hold', 'metrics')
    # Nobody waits for a probe that could begin with the next readings only.
    refused = probe.call(Trigger, 'fault_tolerance/probe', Trigger.Request())
    assert refused.message == 'the controller does not move the mechanism: hold'
    asking.settle(NOMINAL)
    asking.reach('nominal')


def test_a_task_velocity_that_ceases_leads_to_rest(asking, probe):
    asking.settle(NOMINAL)
    asking.asked = None
    probe.wait(lambda: asking.step() == [0.0] * 4, 'rest')
    probe.wait_for_state('hold')


@pytest.mark.parametrize(
    ('reason', 'spoil'),
    [
        ('not_finite', lambda message: setattr(message.twist.linear, 'x', nan)),
        ('wrong_frame', lambda message: setattr(message.header, 'frame_id', 'camera')),
        ('stale_task_velocity', lambda message: setattr(message.header.stamp, 'sec', 1)),
    ],
)
def test_a_bad_task_velocity_is_rejected_and_counted(plant, probe, health, reason, spoil):
    message = TwistStamped()
    message.header.stamp = plant.stamp()
    message.twist.angular.x = 0.01
    spoil(message)
    plant.velocities.publish(message)
    probe.wait(lambda: f'rejected_{reason}' in health(), 'a counter')
    assert plant.step() == [0.0] * 4


def test_a_task_velocity_in_the_base_frame_is_taken(plant, probe):
    message = TwistStamped()
    message.header.frame_id = 'base_link'
    message.twist.angular.x, message.twist.angular.y = 0.01, 0.02

    def taken():
        plant.velocities.publish(message)
        return plant.step() == pytest.approx(NOMINAL, abs=1e-6)

    probe.wait(taken, 'the command')


def test_components_outside_the_task_are_ignored(asking, probe, health):
    asking.settle(NOMINAL)
    asking.ask(0.01, 0.02, x=1.0)
    probe.wait(lambda: 'warned_outside_task' in health(), 'a warning')
    asking.settle(NOMINAL)


def test_a_huge_task_velocity_keeps_its_direction(plant, probe):
    plant.asked = (1e300, 2e300)
    probe.wait(lambda: any(plant.step()), 'a command')
    command = plant.step()
    assert all(isfinite(rate) for rate in command)
    scale = command[0] / NOMINAL[0]
    assert scale > 0.0
    assert command == pytest.approx([scale * rate for rate in NOMINAL], rel=1e-3)


def test_pause_holds_until_it_is_lifted(asking, probe):
    asking.settle(NOMINAL)
    assert probe.pause(True).message == 'hold'
    assert asking.step() == [0.0] * 4
    assert probe.pause(False).success
    asking.settle(NOMINAL)


def test_a_report_is_answered_at_once_by_the_new_kinematics(asking, probe, shared):
    for _ in range(ATTEMPTS):
        asking.settle(NOMINAL)
        probe.commands.clear()
        report = asking.report('position', 'theta_4')
        probe.wait(lambda: probe.commands, 'a command that no joint state asked for')
        if any(probe.commands[0].data):
            break
        # A busy machine: meanwhile the velocity asked for has timed out.
        probe.wait_for_state('hold')
        probe.wait(lambda: asking.step() and probe.state == 'degraded', 'degraded')
        asked = asking.asked
        shared.renew()
        asking.asked = asked
    assert list(probe.commands[0].data) == pytest.approx(STUCK_4, abs=1e-6)
    assert probe.commands[0].data[3] == 0.0
    probe.wait_for_state('degraded')
    probe.wait(lambda: probe.mechanism.get('state') == 'degraded', 'metrics')
    stamp = report.header.stamp
    assert probe.mechanism['report_stamp'] == f'{stamp.sec}.{stamp.nanosec:09d}'
    assert 0.0 < float(probe.mechanism['recovery_time_us']) < 1e6
    assert probe.mechanism['failures'] == 'position:theta_4'
    assert probe.metrics[-1].status[0].level == DiagnosticStatus.WARN
    assert 'theta_4 stuck; wx, wy retained, vz coupled' in probe.metrics[-1].status[0].message


def test_what_the_platform_will_really_do_is_published(asking, probe):
    achieved = probe.heard(TwistStamped, 'fault_tolerance/achieved_velocity')
    asking.settle(NOMINAL)
    asking.report('position', 'theta_4')
    asking.settle(STUCK_4)
    achieved.clear()
    probe.wait(lambda: achieved or not asking.step(), 'the achieved velocity')
    twist = achieved[-1].twist
    assert (twist.angular.x, twist.angular.y) == pytest.approx((0.01, 0.02), abs=1e-6)
    assert twist.linear.z == pytest.approx(-0.0141421, abs=1e-5)

    def told():
        asking.step()
        residual = [float(number) for number in probe.mechanism['residual'].split(', ')]
        return residual == pytest.approx([0.0, 0.0, 0.0141421], abs=1e-5)

    probe.wait(lambda: probe.metrics and told(), 'what is missing, in the metrics')


def test_a_level_of_two_typed_without_brackets_is_applied_with_a_warning(
    asking, probe, controller
):
    asking.step()
    asking.report('position', 'theta_4', level=DiagnosticStatus.OK, stamped=False)
    asking.reach('degraded')
    assert 'level: [2]' in controller.output


def test_stale_reports_and_strangers_change_nothing(asking, probe, health):
    asking.step()
    asking.report('position', 'theta_4', level=DiagnosticStatus.STALE)
    asking.report('position', 'theta_9')
    probe.wait(lambda: 'rejected_unknown_name' in health(), 'a counter')
    assert 'degraded' not in {message.data for message in probe.states}


def test_an_unknown_mode_of_a_known_part_stops(asking, probe):
    asking.step()
    asking.report('melted', 'theta_4')
    probe.wait_for_state('stopped')
    assert asking.step() == [0.0] * 4


def test_an_unfit_combination_stops_and_is_left_by_clearing_only(asking, probe):
    asking.settle(NOMINAL)
    asking.report('position', 'theta_3', 'theta_4')
    probe.wait_for_state('stopped')
    assert asking.step() == [0.0] * 4
    probe.wait(lambda: probe.mechanism.get('state') == 'stopped', 'metrics')
    assert probe.metrics[-1].status[0].level == DiagnosticStatus.ERROR
    answer = probe.clear()
    assert not answer.success
    assert 'still reported: theta_3 (position), theta_4 (position)' in answer.message
    asking.report('none', 'theta_3')
    probe.wait(lambda: 'theta_3' in probe.clear().message, 'a release')
    assert asking.step() is not None
    asking.reach('degraded')


def test_a_lost_struts_joints_may_be_missing_or_nan(asking, probe):
    asking.settle(NOMINAL)
    asking.report('hard', 'strut_4')
    asking.reach('degraded')
    for message in (
        asking.joint_state([0.0, 0.0, 0.0, nan]),
        asking.joint_state([0.0, 0.0, 0.0], name=NAMES[:3]),
    ):
        asking.settle([*NOMINAL[:3], 0.0], message)


def test_one_message_per_joint_makes_one_step(asking, probe):
    asking.settle(NOMINAL)
    for _ in range(10):
        asking.settle(NOMINAL)
        probe.spin(0.005)
        probe.commands.clear()
        stamp = asking.stamp()
        for name in NAMES:
            message = JointState(name=[name], position=[0.0])
            message.header.stamp = stamp
            asking.joint_states.publish(message)
            probe.spin(0.003)
        probe.spin(0.02)
        # What is asked for ceases meanwhile, which brings zeros.
        moving = [command.data for command in probe.commands if any(command.data)]
        if len(moving) == 1:
            break
    # Best effort: a part may get lost, and then the next round completes the set.
    assert len(moving) == 1
    np.testing.assert_allclose(moving[0], NOMINAL, atol=1e-6)


@pytest.mark.parametrize('dead', [nan, None])
def test_an_encoder_that_dies_with_its_drive_stops_nothing(asking, probe, dead):
    asking.settle(NOMINAL)
    asking.report('position', 'theta_4')
    asking.reach('degraded')
    if dead is None:
        message = asking.joint_state([0.0, 0.0, 0.0], name=NAMES[:3])
    else:
        message = asking.joint_state([0.0, 0.0, 0.0, dead])
    asking.settle(STUCK_4, message)
    probe.metrics.clear()
    # Metrics are made in pieces: the first may still be of an earlier step.
    probe.wait(
        lambda: asking.step(message) and probe.metrics and probe.mechanism['sensorless'],
        'metrics that name the drive')
    assert probe.state == 'degraded'
    assert probe.mechanism['sensorless'] == 'theta_4'


def test_strangers_alone_are_nobodys_business(asking, probe, health):
    asking.settle(NOMINAL)
    for _ in range(20):
        asking.joint_states.publish(asking.joint_state([0.1, nan], name=['gripper', 'finger']))
        asking.step()
    probe.spin(1.2)
    # The drives do not follow here; on a busy machine that lasts long enough to be told.
    assert set(health()) <= {'warned_several_commanders', 'warned_not_followed'}


def test_jumps_are_counted_and_not_followed(asking, probe, health):
    """A second publisher, whose readings come between the true ones."""
    asking.settle(NOMINAL)
    false = asking.joint_state([0.0, 0.5, 0.0, 0.0])

    def held() -> bool:
        false.header.stamp = asking.stamp()
        asking.joint_states.publish(false)
        probe.spin(0.005)
        asking.joint_states.publish(asking.joint_state())
        asking.ask(*asking.asked)
        probe.spin(0.005)
        return probe.state == 'hold'

    probe.commands.clear()
    probe.wait(held, 'a hold')
    probe.metrics.clear()
    probe.wait(lambda: held() and bool(probe.metrics), 'metrics')
    assert 'theta_2 by 0.5 m' in probe.metrics[-1].status[0].message
    for command in probe.commands:  # eased after a hold, and never towards the false reading
        share = float(np.dot(command.data, NOMINAL) / np.dot(NOMINAL, NOMINAL))
        np.testing.assert_allclose(command.data, share * np.array(NOMINAL), atol=1e-6)
        assert -1e-6 < share < 1.0 + 1e-3
    probe.wait(lambda: health().get('rejected_jump', 0) > 1, 'a counter')
    asking.settle(NOMINAL)
