# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Odd stamps, bursts, silence, strangers and monsters: one controller bears them all in a row."""

from __future__ import annotations

import signal
import time

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistStamped
from node_rig import Plant, Probe, values_of
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

NAMES = ['theta_1', 'theta_2', 'theta_3', 'theta_4']
ASKED = (0.01, 0.02)
NOMINAL = [0.0070711, -0.0141421, -0.0070711, 0.0141421]
TIMEOUT, WATCHDOG = 0.1, 0.01
MEGABYTE = 1_000_000
ATTEMPTS = 8


class Machine:
    """A controller, the drives and the operator the test plays, and what the controller tells."""

    def __init__(self, start) -> None:
        self.probe = Probe()
        self._diagnostics = self.probe.heard(DiagnosticArray, '/diagnostics')
        self.process = start('controller', mechanism='fsm_4_strut')
        self.plant = Plant(self.probe, NAMES)
        self.plant.connect()
        self.plant.asked = ASKED
        self.probe.wait(lambda: self.health, 'the health of the controller')

    @property
    def health(self) -> DiagnosticStatus | None:
        """The controller's newest status."""
        for message in reversed(self._diagnostics):
            for status in message.status:
                if status.name == 'fault_tolerance: controller':
                    return status
        return None

    @property
    def health_count(self) -> int:
        """How many statuses it has published."""
        return sum(
            status.name == 'fault_tolerance: controller'
            for message in self._diagnostics
            for status in message.status
        )

    def count(self, key: str) -> int:
        return int(values_of(self.health).get(key, '0'))

    def wait_for_count(self, key: str, least: int, meanwhile=lambda: None) -> None:
        def counted() -> bool:
            meanwhile()
            return self.count(key) >= least

        self.probe.wait(counted, f'{least} {key}, not {values_of(self.health)}')

    def resume(self) -> None:
        self.plant.settle(NOMINAL)
        self.plant.reach('nominal')

    def wait_for_failures(self, words: str) -> None:
        self.probe.wait(lambda: self.probe.mechanism['failures'] == words, words or 'no failure')

    def release(self) -> None:
        """Clear until nothing is left; what is reported healthy may still be on its way."""
        def released() -> bool:
            self.probe.clear()
            self.probe.spin(0.02)
            return not self.probe.mechanism['failures']

        self.probe.wait(released, 'the release')

    def marked(self) -> None:
        """Wait until all diagnostics sent so far have been read."""
        before = self.count('rejected_unknown_name')
        self.plant.report('position', 'theta_9')
        self.wait_for_count('rejected_unknown_name', before + 1)


@pytest.fixture(scope='module')
def shared_machine(ros, start_for_module):
    machine = Machine(start_for_module)
    yield machine
    machine.probe.close()


@pytest.fixture
def machine(shared_machine):
    """The controller of all tests here, nominal; alive and without complaints afterwards."""
    shared_machine.resume()
    yield shared_machine
    assert shared_machine.process.alive
    for complaint in ('Traceback', 'a callback failed', 'internal error'):
        assert complaint not in shared_machine.process.output


def test_while_it_waits_it_says_what_for(start, ros):
    probe = Probe('patient')
    heard = probe.heard(DiagnosticArray, '/diagnostics')
    process = start('controller', 'patient', mechanism='fsm_4_strut')

    def told():
        return [status for message in heard for status in message.status
                if status.name == 'patient/fault_tolerance: controller']

    probe.wait_for_state('waiting')
    probe.wait(told, 'the health of the controller')
    assert told()[-1].level == DiagnosticStatus.STALE
    hint = 'no joint state yet on /patient/joint_states (0 publishers; any reliability'
    assert hint in told()[-1].message
    # In the log with the next status.
    probe.wait(lambda: hint in process.output, 'the hint')
    wheels = JointState(name=['left_wheel', 'right_wheel'], position=[0.0, 1.0])
    publisher = probe.node.create_publisher(JointState, '/patient/joint_states', 10)
    expected = '/patient/joint_states are of left_wheel, right_wheel, not of theta_1, theta_2'
    probe.wait(lambda: publisher.publish(wheels) or expected in told()[-1].message, expected)
    probe.node.destroy_publisher(publisher)
    probe.close()


def stamped(machine, stamp: Time) -> JointState:
    message = machine.plant.joint_state()
    message.header.stamp = stamp
    return message


def test_without_stamps_the_time_of_receipt_counts_with_one_warning(machine):
    probe, plant = machine.probe, machine.plant
    velocity = TwistStamped()
    velocity.twist.angular.x, velocity.twist.angular.y = ASKED
    plant.asked = None
    probe.spin(2 * TIMEOUT)
    probe.commands.clear()

    def moving():
        plant.velocities.publish(velocity)
        plant.joint_states.publish(stamped(machine, Time()))
        return probe.commands and any(probe.commands[-1].data)

    for _ in range(2):
        probe.wait(moving, 'a command')
        probe.spin(0.05)
    machine.wait_for_count('warned_no_stamp_joint_state', 1, moving)
    machine.wait_for_count('warned_no_stamp_task_velocity', 1, moving)
    assert machine.count('warned_no_stamp_joint_state') == 1
    assert machine.count('warned_no_stamp_task_velocity') == 1
    assert machine.process.output.count('without a stamp') == 2
    plant.asked = ASKED


def later(stamp: Time, seconds: int) -> Time:
    return Time(sec=stamp.sec + seconds, nanosec=stamp.nanosec)


@pytest.mark.parametrize(
    'change',
    [
        lambda stamp: later(stamp, 3600),
        lambda stamp: Time(sec=2**31 - 1, nanosec=999_999_999),
        lambda stamp: Time(sec=stamp.sec, nanosec=2**32 - 1),
    ],
    ids=['an hour ahead', 'the end of time', 'too many nanoseconds'],
)
def test_stamps_from_the_future_count_as_now(machine, change):
    machine.probe.commands.clear()

    def answered():
        machine.plant.ask(*ASKED)
        machine.plant.joint_states.publish(stamped(machine, change(machine.plant.stamp())))
        return machine.probe.commands

    machine.probe.wait(answered, 'a command')
    # Nor do they make later ones with a true stamp old.
    machine.probe.spin(0.05)
    machine.resume()


@pytest.mark.parametrize(
    ('reason', 'change'),
    [
        ('stale_joint_state', lambda stamp: later(stamp, -10)),
        ('stale_joint_state', lambda stamp: Time(sec=-1)),
        ('old_joint_state', lambda stamp: Time(sec=stamp.sec, nanosec=stamp.nanosec // 2)),
        ('empty_joint_state', None),
    ],
    ids=['stale', 'before the epoch', 'older', 'empty'],
)
def test_what_is_old_or_empty_is_no_sign_of_life(machine, reason, change):
    probe, plant = machine.probe, machine.plant
    before = machine.count(f'rejected_{reason}')

    def sent():
        if change is None:
            message = JointState()
            message.header.stamp = plant.stamp()
        elif reason == 'old_joint_state':
            # One from before the last one, but fresh enough.
            message = stamped(machine, last)
        else:
            message = stamped(machine, change(plant.stamp()))
        plant.joint_states.publish(message)
        return probe.state == 'hold'

    last = plant.stamp()
    probe.spin(0.005)
    plant.step()
    sent()
    probe.wait(sent, 'hold')
    assert list(probe.commands[-1].data) == [0.0] * 4
    machine.wait_for_count(f'rejected_{reason}', before + 1, sent)


@pytest.mark.timed
def test_of_a_burst_the_newest_counts(machine):
    probe, node = machine.probe, machine.probe.node
    reliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
    publisher = node.create_publisher(JointState, 'joint_states', reliable)
    probe.wait(publisher.get_subscription_count, 'the controller')
    beyond, count, took = 0.051, 2000, []
    while len(took) < ATTEMPTS and min(took, default=1.0) > 0.2:
        machine.resume()
        probe.wait(lambda: not probe.mechanism['out_of_range'], 'metrics')
        probe.commands.clear()
        begin = time.monotonic()
        for number in range(count):
            # No faster than drives go; only the last one is beyond the stroke.
            far = beyond if number == count - 1 else 0.049 * min(1.0, number / 1000)
            publisher.publish(machine.plant.joint_state([far, 0.0, -far, 0.0]))
            while time.monotonic() < begin + 1e-4 * number:
                pass
        end = time.monotonic()
        # The metrics come five times a second, and with the hold that follows a burst.
        while probe.mechanism['out_of_range'] != 'theta_1, theta_3':
            if time.monotonic() > end + 2.0:
                break
            probe.spin(0.005)
        took.append(time.monotonic() - end)
        assert len(probe.commands) <= count + 5
    node.destroy_publisher(publisher)
    assert min(took) <= 0.35


@pytest.mark.timed
@pytest.mark.parametrize('joint_states_too', [True, False])
def test_what_ceases_ends_the_motion_within_its_timeout(machine, joint_states_too):
    """The least of some attempts: what the machine does meanwhile only adds to it."""
    probe, plant, took = machine.probe, machine.plant, []
    while len(took) < ATTEMPTS and min(took, default=1.0) > TIMEOUT + WATCHDOG:
        machine.resume()
        plant.ask(*ASKED)
        plant.joint_states.publish(plant.joint_state())
        asked = time.monotonic()

        def at_rest():
            if not joint_states_too:
                plant.joint_states.publish(plant.joint_state())
            return not any(probe.commands[-1].data)

        probe.wait(at_rest, 'rest')
        took.append(time.monotonic() - asked)
    # The probe itself needs a moment to hear of it.
    assert 0.9 * TIMEOUT <= min(took) <= TIMEOUT + WATCHDOG + 0.01


def test_two_who_ask_are_warned_of(machine):
    another = machine.probe.node.create_publisher(
        TwistStamped, 'fault_tolerance/task_velocity', 10
    )
    machine.wait_for_count('warned_several_commanders', 1, machine.plant.step)
    assert 'several nodes publish task velocities' in machine.process.output
    machine.probe.node.destroy_publisher(another)


def rejections(machine):
    """Return the counters of what was left aside, but for the marks of the test."""
    counters = values_of(machine.health)
    counters.pop('rejected_unknown_name', None)
    return {key: number for key, number in counters.items() if key.startswith('rejected')}


def test_its_own_words_and_those_of_strangers_are_no_reports(machine):
    probe, plant = machine.probe, machine.plant
    plant.report('position', 'theta_4')
    machine.wait_for_failures('position:theta_4')
    own = [probe.metrics[-1], DiagnosticArray(status=[machine.health])]
    plant.report('none', 'theta_4')
    machine.release()
    machine.resume()
    before = rejections(machine)
    strangers = [
        DiagnosticStatus(name=name, hardware_id=part, level=b'\x02', values=values)
        for name, part in (('battery', 'battery'), ('drive: theta_4', 'theta_4'), ('', ''))
        for values in ([], [KeyValue(key='voltage', value='position')])
    ]
    for message in (*own, DiagnosticArray(status=strangers), DiagnosticArray()):
        message.header.stamp = plant.stamp()
        plant.diagnostics.publish(message)
    machine.marked()
    assert probe.mechanism['failures'] == ''
    assert rejections(machine) == before
    machine.resume()


def monster(name='drive', part='theta_4', mode='position', padding=0) -> DiagnosticArray:
    values = [KeyValue(key=f'key {number}', value='x') for number in range(padding)]
    values.append(KeyValue(key='failure_mode', value=mode))
    return DiagnosticArray(
        status=[DiagnosticStatus(name=name, hardware_id=part, level=b'\x01', values=values)]
    )


def test_monsters_are_cut_to_size(machine):
    plant = machine.plant
    odd = 'a\nb\x07\x1b[31m'
    known = len(machine.process.output.splitlines())
    for message in (
        monster(part='y' * MEGABYTE),
        monster(part=odd),
        monster(mode=odd + 'z' * MEGABYTE),
        monster(name='\n' * MEGABYTE, mode='melted'),
    ):
        plant.diagnostics.publish(message)
    machine.marked()
    machine.resume()
    lines = machine.process.output.splitlines()[known:]
    assert max(map(len, lines)) < 700
    assert not any('\x07' in line or '\x1b[31m' in line for line in lines)
    # Long as they are, they are understood where they make sense.
    plant.diagnostics.publish(monster(name='n\0' * 1000, padding=10_000))
    machine.wait_for_failures('position:theta_4')
    plant.diagnostics.publish(monster(name='n\0' * 1000, mode='none', padding=10_000))
    machine.release()


@pytest.mark.timed
def test_a_stall_is_counted_and_not_made_up_for(machine):
    probe, plant = machine.probe, machine.plant
    before = machine.count('stalls')
    machine.process.process.send_signal(signal.SIGSTOP)
    end = time.monotonic() + 0.25
    while time.monotonic() < end:
        plant.joint_states.publish(plant.joint_state())
        plant.ask(*ASKED)
        probe.spin(0.002)
    probe.commands.clear()
    machine.process.process.send_signal(signal.SIGCONT)
    probe.spin(0.1)
    # The newest joint state, and zeros from the watchdog as nothing comes after it.
    assert len(probe.commands) <= 3
    machine.wait_for_count('stalls', before + 1)


def test_a_parameter_that_is_fixed_or_bad_is_refused_with_a_reason(machine):
    changes = {'mechanism': 'planar_4rpr', 'tolerance_threshold': 5.0, 'recovery': 'no'}
    for name, value in changes.items():
        result = machine.probe.set_parameter('fault_tolerance', name, value)
        assert not result.successful
        assert result.reason


def test_a_report_without_a_stamp_shows_when_it_was_received(machine):
    probe, plant = machine.probe, machine.plant
    before = plant.stamp()
    plant.report('torque', 'theta_2', stamped=False)
    machine.wait_for_failures('torque:theta_2')
    shown = float(probe.mechanism['report_stamp'])
    assert before.sec - 1 <= shown <= plant.stamp().sec + 1
    plant.report('none', 'theta_2')
    machine.release()


def test_a_warning_that_a_failure_is_latched_goes_with_the_failure(machine):
    probe, plant = machine.probe, machine.plant
    plant.report('torque', 'theta_2')
    machine.wait_for_failures('torque:theta_2')
    plant.report('none', 'theta_2')
    probe.wait(
        lambda: plant.step() and 'stays until it is cleared' in machine.health.message,
        'the warning',
    )
    assert machine.health.level == DiagnosticStatus.WARN
    assert probe.clear().success
    cleared = machine.health_count
    # The next status but one at the latest, whatever the load of the machine.
    probe.wait(lambda: plant.step() and machine.health_count >= cleared + 2, 'two statuses')
    assert 'stays until it is cleared' not in machine.health.message
    # What else there may be to tell passes: that no drive of this plant follows, for one.
    plant.asked = (0.0, 0.0)
    probe.wait(lambda: plant.step() and machine.health.message == 'nominal: no failure', 'nominal')
    assert machine.health.level == DiagnosticStatus.OK
    plant.asked = ASKED


def test_without_anybody_who_listens_it_goes_on(start, ros):
    probe = Probe('alone')
    for subscription in list(probe.node.subscriptions):
        probe.node.destroy_subscription(subscription)
    process = start('controller', 'alone', mechanism='fsm_4_strut')
    plant = Plant(probe, NAMES)

    def nominal():
        for _ in range(5):
            plant.ask(*ASKED)
            plant.joint_states.publish(plant.joint_state())
            probe.spin(0.01)
        return probe.pause(False).message == 'nominal'

    probe.wait(plant.joint_states.get_subscription_count, 'the controller')
    probe.wait(nominal, 'a nominal controller')
    assert probe.node.count_subscribers('/alone/velocity_controller/commands') == 0
    assert process.signal(signal.SIGINT) < 2.0
    assert process.process.returncode == 0
    assert 'Traceback' not in process.output
    assert 'failed' not in process.output
    probe.close()
