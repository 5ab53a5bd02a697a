# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The simulated mirror breaks on request, tells so as drives do, and refuses nonsense."""

from __future__ import annotations

from statistics import median

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_rig import Probe, values_of
from numpy import diff
from std_msgs.msg import Float64MultiArray, String

ACTUATORS = [f'theta_{number}' for number in range(1, 5)]
STRUTS = [f'strut_{number}' for number in range(1, 5)]


class Bench:
    """A simulator alone, and what it reports."""

    def __init__(self, probe: Probe, process) -> None:
        self.namespace = probe.node.get_namespace().strip('/')
        self.probe = probe
        self.process = process
        self.joint_states = probe.joint_states()
        self.diagnostics = probe.heard(DiagnosticArray, '/diagnostics')
        self.faults = probe.node.create_publisher(String, 'fsm/inject_fault', 10)
        self.commands = probe.node.create_publisher(
            Float64MultiArray, 'velocity_controller/commands', 10
        )
        probe.wait(self.faults.get_subscription_count, 'the simulator')
        probe.wait(self.commands.get_subscription_count, 'the simulator')
        probe.wait(lambda: self.joint_states, 'joint states')

    def inject(self, words: str) -> None:
        self.faults.publish(String(data=words))

    @property
    def statuses(self) -> list[DiagnosticStatus]:
        """Everything this simulator has told of, the newest last."""
        return [
            status
            for message in self.diagnostics
            for status in message.status
            if status.hardware_id.rpartition('/')[0] == self.namespace
        ]

    @property
    def reports(self) -> dict[str, str]:
        """The newest mode reported of each part."""
        return {
            status.hardware_id.rpartition('/')[2]: values_of(status)['failure_mode']
            for status in self.statuses
            if 'failure_mode' in values_of(status)
        }

    @property
    def health(self) -> DiagnosticStatus | None:
        mine = [status for status in self.statuses if status.name.endswith('fsm: simulator')]
        return mine[-1] if mine else None

    def wait_for_reports(self, **modes: str) -> None:
        """Wait until the parts named are reported so, and all others healthy if at all."""

        def reported() -> bool:
            others = {self.reports[part] for part in self.reports.keys() - modes.keys()}
            return self.reports.items() >= modes.items() and others <= {'none'}

        self.probe.wait(reported, f'{modes}, not {self.reports}')

    def wait_for_refusals(self, number: int) -> None:
        """Wait until so many fault commands have been refused."""

        def refused() -> bool:
            counters = values_of(self.health) if self.health else {}
            return int(counters.get('rejected_fault_command', '0')) >= number

        self.probe.wait(refused, f'{number} refusals')

    def commanded(self, rates, cycles):
        """Command ``rates`` for some cycles, and return the joint states of these."""
        found = []
        for _ in range(cycles):
            self.commands.publish(Float64MultiArray(data=rates))
            found.append(self.next_joint_state())
        return found

    def wait_for_velocity(self, rates, expected) -> None:
        """Command ``rates`` until the joints move as ``expected``."""
        self.probe.wait(
            lambda: list(self.commanded(rates, 1)[0].velocity)
            == pytest.approx(expected, rel=0.1, abs=1e-3),
            f'velocities {expected}, not {list(self.joint_states[-1].velocity)}')

    def next_joint_state(self):
        count = len(self.joint_states)
        self.probe.wait(lambda: len(self.joint_states) > count, 'a joint state')
        return self.joint_states[-1]


@pytest.fixture(scope='module')
def shared_bench(ros, start_for_module):
    probe = Probe()
    yield Bench(probe, start_for_module('fsm_simulator', mechanism='fsm_4_strut'))
    probe.close()


@pytest.fixture
def another(ros):
    """A probe for a simulator that a test starts for itself."""
    probe = Probe('another')
    yield probe
    probe.close()


@pytest.fixture
def bench(shared_bench):
    """The simulator of all tests, mended after each."""
    yield shared_bench
    shared_bench.inject('ok all')
    shared_bench.wait_for_reports()
    shared_bench.diagnostics.clear()


@pytest.mark.parametrize(
    ('words', 'reports'),
    [
        ('torque strut_4', {'theta_4': 'torque'}),
        ('theta_2 stuck', {'theta_2': 'position'}),
        ('HARD theta_3', {'strut_3': 'hard'}),
        ('free all', dict.fromkeys(ACTUATORS, 'torque')),
        ('lost all', dict.fromkeys(STRUTS, 'hard')),
        ('frozen theta_1', {'theta_1': 'position'}),
        ('strut_1 encoder', {'theta_1': 'position'}),
        ('biased all', dict.fromkeys(ACTUATORS, 'position')),
        ('weak theta_2', {'theta_2': 'position'}),
        ('REVERSED strut_3', {'theta_3': 'position'}),
        ('runaway theta_4', {'theta_4': 'runaway'}),
    ],
)
def test_faults_are_reported_as_drives_would(bench, words, reports):
    bench.inject(words)
    bench.wait_for_reports(**reports)
    message = [
        message for message in bench.diagnostics
        if any(status.hardware_id in reports for status in message.status)
    ][-1]
    levels = {status.level for status in message.status if status.hardware_id in reports}
    assert levels == {DiagnosticStatus.ERROR}
    assert message.header.stamp.sec > 0


def test_a_mirror_in_mujoco_moves_breaks_and_tells_so(start, another):
    bench = Bench(another, start('fsm_simulator', 'another', engine='mujoco'))
    first = bench.next_joint_state()
    for _ in range(3):
        bench.commands.publish(Float64MultiArray(data=[1e-3, 1e-3, 1e-3, 1e-3]))
        bench.next_joint_state()
    another.wait(
        lambda: min(bench.next_joint_state().position) > max(first.position) + 1e-5, 'motion')
    # The drives carry the mirror: a quarter of a newton.
    assert 0.2 < sum(first.effort) < 0.3
    bench.inject('torque theta_2')
    bench.wait_for_reports(theta_2='torque')
    another.wait(lambda: bench.next_joint_state().effort[1] == 0.0, 'a limp drive')


def test_what_is_mended_is_reported_healthy(bench):
    bench.inject('stuck theta_4')
    bench.wait_for_reports(theta_4='position')
    bench.inject('ok all')
    bench.wait_for_reports(theta_4='none')


def test_silent_faults_are_not_reported_neither_as_they_come_nor_as_they_go(bench):
    bench.inject('silent stuck theta_4')
    bench.probe.wait(
        lambda: bench.probe.parameter('fsm', 'faults.theta_4') == 'position', 'the fault'
    )
    bench.inject('ok theta_4')
    bench.inject('free theta_1')
    bench.wait_for_reports(theta_1='torque')


def test_reports_come_again_every_second(bench):
    bench.inject('stuck theta_4')
    bench.wait_for_reports(theta_4='position')
    count = len(bench.diagnostics)

    def times() -> list[float]:
        """Return when it was reported again, by the stamps."""
        return [
            message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            for message in bench.diagnostics[count:]
            if any(status.hardware_id == 'theta_4' for status in message.status)
        ]

    bench.probe.wait(lambda: len(times()) > 3, 'four more reports')
    assert median(diff(times())) == pytest.approx(1.0, abs=0.1)


def test_who_comes_late_hears_the_reports(bench):
    bench.inject('stuck theta_4')
    bench.wait_for_reports(theta_4='position')
    late = bench.probe.heard(DiagnosticArray, '/diagnostics')
    # How long it takes until one is discovered is the middleware's; from then on it is a second.
    bench.probe.wait(lambda: late, 'the simulator')
    bench.probe.wait(
        lambda: any(status.hardware_id == 'theta_4' for one in late for status in one.status),
        'the report', 1.5,
    )


def test_bad_words_are_refused_with_the_valid_ones_in_log_and_diagnostics(start, another):
    bench = Bench(another, start('fsm_simulator', 'another', mechanism='fsm_4_strut'))
    refused = {
        'melted theta_4': 'torque',
        'stuck theta_9': 'strut_4',
        'stuck': 'position',
        '': 'position',
        'silent silent theta_1': 'position',
        'a\nb\0c ' + 100 * 'x': 'position',
    }
    for number, (words, hint) in enumerate(refused.items(), start=1):
        bench.inject(words)
        bench.wait_for_refusals(number)
        assert bench.health.level == DiagnosticStatus.WARN
        assert hint in bench.health.message.split('valid: ')[1]
    assert bench.process.alive
    lines = [line for line in bench.process.output.splitlines() if 'rejected' in line]
    assert 'valid: position, stuck' in lines[0]
    assert len(lines) <= len(refused)
    assert max(map(len, lines)) < 600
    bench.wait_for_reports()


def test_a_parameter_breaks_things_with_an_answer(bench):
    probe = bench.probe
    assert probe.set_parameter('fsm', 'faults.strut_4', 'torque').successful
    bench.wait_for_reports(theta_4='torque')
    assert probe.parameter('fsm', 'faults.theta_4') == 'torque'
    refused = probe.set_parameter('fsm', 'faults.strut_4', 'melted')
    assert not refused.successful
    assert 'valid: position, stuck' in refused.reason
    assert probe.parameter('fsm', 'faults.strut_4') == 'torque'
    assert probe.set_parameter('fsm', 'faults.strut_4', 'ok').successful
    bench.wait_for_reports(theta_4='none')
    assert probe.parameter('fsm', 'faults.theta_4') == 'none'


def test_parameters_show_what_was_broken_by_topic(bench):
    bench.inject('hard strut_2')
    bench.wait_for_reports(strut_2='hard')
    assert bench.probe.parameter('fsm', 'faults.strut_2') == 'hard'
    assert bench.probe.parameter('fsm', 'faults.theta_2') == 'hard'
    assert bench.probe.parameter('fsm', 'faults.theta_1') == 'none'


def test_what_is_broken_from_the_start_is_reported_behind_the_namespace(start, another):
    bench = Bench(another, start('fsm_simulator', 'another', **{'faults.theta_1': 'stuck'}))
    bench.wait_for_reports(theta_1='position')
    another.wait(lambda: bench.health, 'the health of the simulator')
    ids = {status.hardware_id for one in bench.diagnostics for status in one.status}
    assert {'another/theta_1', 'another/fsm'} <= ids


def test_injection_can_be_switched_off(start, another):
    bench = Bench(another, start('fsm_simulator', 'another', enable_fault_injection=False))
    bench.inject('stuck theta_4')
    bench.wait_for_refusals(1)
    assert not another.set_parameter('fsm', 'faults.theta_4', 'torque').successful
    bench.wait_for_reports()


def test_joint_states_hold_every_actuator(bench):
    message = bench.joint_states[-1]
    assert list(message.name) == ACTUATORS
    assert len(message.position) == len(message.velocity) == len(message.effort) == 4
    assert message.header.stamp.sec > 0


def test_a_lost_strut_keeps_its_position_with_velocity_zero(bench):
    bench.inject('lost strut_4')
    bench.wait_for_reports(strut_4='hard')
    first = bench.next_joint_state()
    for _ in range(5):
        bench.commands.publish(Float64MultiArray(data=[0.01, 0.0, 0.0, 0.01]))
        message = bench.next_joint_state()
        assert message.position[3] == first.position[3]
        assert message.velocity[3] == 0.0
        assert message.effort[3] == 0.0


def test_words_of_drives_go_with_the_mode_that_is_reported(bench):
    bench.inject('weak theta_2')
    bench.wait_for_reports(theta_2='position')
    bench.inject('runaway theta_3')
    bench.wait_for_reports(theta_2='position', theta_3='runaway')
    said = {one.hardware_id: one.message for one in bench.statuses if one.level == b'\x02'}
    assert said['theta_2'] == 'drive moves less far than told'
    assert said['theta_3'] == 'drive moves by itself'
    assert bench.probe.parameter('fsm', 'faults.theta_2') == 'weak'


@pytest.mark.parametrize('word', ['frozen', 'biased', 'weak', 'reversed', 'runaway'])
def test_a_parameter_sets_every_misbehaviour_silently_and_mends_it(bench, word):
    probe = bench.probe
    assert probe.set_parameter('fsm', 'faults.theta_4', f'silent {word}').successful
    for part in ('theta_4', 'strut_4'):
        assert probe.parameter('fsm', f'faults.{part}') == word
    assert probe.set_parameter('fsm', 'faults.strut_4', 'ok').successful
    assert probe.parameter('fsm', 'faults.theta_4') == 'none'
    # What is reported next is all that ever was.
    assert probe.set_parameter('fsm', 'faults.theta_1', word).successful
    bench.wait_for_reports(theta_1='runaway' if word == 'runaway' else 'position')


def test_faults_of_drive_and_encoder_stand_beside_each_other(bench):
    bench.inject('free theta_1')
    bench.inject('encoder theta_1')
    bench.wait_for_reports(theta_1='position')
    bench.probe.wait(
        lambda: bench.probe.parameter('fsm', 'faults.theta_1') == 'torque frozen', 'both faults')
    bench.inject('ok theta_1')
    bench.wait_for_reports(theta_1='none')
    assert bench.probe.parameter('fsm', 'faults.theta_1') == 'none'


def test_a_frozen_encoder_repeats_its_last_reading(bench):
    bench.inject('silent frozen theta_1')
    bench.probe.wait(lambda: bench.probe.parameter('fsm', 'faults.theta_1') == 'frozen', 'it')
    found = bench.commanded([0.01] * 4, 10)
    assert len({one.position[0] for one in found}) == 1
    assert {one.velocity[0] for one in found} == {0.0}
    assert found[-1].position[1] - found[0].position[1] > 1e-4
    assert max(one.velocity[1] for one in found) == pytest.approx(0.01, rel=0.1)


def test_the_reading_of_a_biased_encoder_jumps(bench):
    bench.probe.wait(lambda: max(map(abs, bench.next_joint_state().velocity)) < 1e-9, 'rest')
    before = bench.next_joint_state().position
    bench.inject('silent biased theta_3')
    bench.probe.wait(
        lambda: bench.next_joint_state().position[2] - before[2] > 1e-6, 'the jump')
    jump = [now - then for now, then in zip(
        bench.next_joint_state().position, before, strict=True)]
    # Six standard deviations of the noise, twice.
    assert jump == pytest.approx([0.0, 0.0, 2e-6, 0.0], abs=2.5e-8)


@pytest.mark.parametrize(('word', 'share'), [('weak', 0.5), ('reversed', -1.0)])
def test_drives_obey_in_part_or_the_wrong_way(bench, word, share):
    bench.inject(f'silent {word} all')
    bench.probe.wait(lambda: bench.probe.parameter('fsm', 'faults.theta_4') == word, 'it')
    bench.wait_for_velocity([0.01] * 4, [0.01 * share] * 4)
    bench.inject('ok all')
    bench.wait_for_velocity([0.01] * 4, [0.01] * 4)


def test_drives_run_away_by_themselves(bench):
    bench.inject('silent runaway all')
    bench.probe.wait(
        lambda: list(bench.next_joint_state().velocity) == pytest.approx([1e-4] * 4, rel=0.2),
        'motion')


def test_the_drive_of_a_silently_lost_strut_goes_on(bench):
    bench.inject('silent lost strut_4')
    bench.probe.wait(lambda: bench.probe.parameter('fsm', 'faults.strut_4') == 'hard', 'it')
    bench.wait_for_velocity([0.0, 0.0, 0.0, 0.01], [0.0, 0.0, 0.0, 0.01])
    found = bench.commanded([0.0, 0.0, 0.0, 0.01], 10)
    assert found[-1].position[3] - found[0].position[3] > 1e-4
    assert found[-1].effort[3] == 0.0


def test_encoders_of_the_motors_read_drives_that_stick_now_and_then(start, another):
    bench = Bench(another, start(
        'fsm_simulator', 'another', mechanism='fsm_4_strut', encoders='motor', encoder_noise=0.0,
        encoder_bias=1e-3, breakaway=1e-4, weak_share=0.25, runaway_rate=0.002,
        **{'faults.theta_1': 'silent stuck', 'faults.theta_3': 'silent runaway'},
    ))
    bench.inject('silent biased theta_4')
    another.wait(lambda: bench.next_joint_state().position[3] > 9e-4, 'the jump')
    # theta_3 sticks for the 50 ms in which it runs away by its breakaway.
    another.wait(lambda: bench.next_joint_state().position[2] > 0.0, 'the drive that runs away')
    found = bench.commanded([0.0, 0.001, 0.0, 0.0], 40)
    positions = [one.position for one in found]
    # Pulled at by the others, but its own encoder does not know.
    assert {one[0] for one in positions} == {0.0}
    assert positions[-1][2] > positions[0][2] > 0.0
    assert {one[3] for one in positions} == {1e-3}
    # 10 um a cycle of 10 ms: at rest in most of them.
    assert positions[-1][1] > positions[0][1]
    steps = diff([one[1] for one in positions])
    assert sum(step == 0.0 for step in steps) > 20
    assert all(step == 0.0 or 1e-4 < step < 3e-4 for step in steps)
    assert {one.hardware_id for one in bench.statuses} <= {'another/fsm'}


def test_commands_move_the_actuators_and_bad_ones_do_not(bench):
    rates = [0.01, -0.01, -0.01, 0.01]

    def rests():
        return max(map(abs, bench.joint_states[-1].velocity)) < 1e-3

    bench.probe.wait(rests, 'the plant to come to rest')
    for data in ([0.01], [float('nan'), 0.0, 0.0, 0.0], []):
        bench.commands.publish(Float64MultiArray(data=data))
    bench.probe.wait(
        lambda: bench.health
        and {'rejected_length', 'rejected_not_finite'} <= values_of(bench.health).keys(),
        'counters',
    )
    assert rests()

    def follows():
        bench.commands.publish(Float64MultiArray(data=rates))
        return list(bench.next_joint_state().velocity) == pytest.approx(rates, rel=0.1)

    bench.probe.wait(follows, 'the commanded velocity')
    bench.probe.wait(rests, 'the plant to stop')
