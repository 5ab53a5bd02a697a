# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A machine of somebody else's, with its own names and messages, beside the controller."""

from __future__ import annotations

import subprocess
import sys
import time
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from node_rig import Probe, values_of
from rclpy.client import Client
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Temperature
from std_msgs.msg import Int32MultiArray
from std_srvs.srv import SetBool, Trigger

from fault_tolerance.drive_rules.drive_watch import DriveWatch
from fault_tolerance.drive_rules.rule_files import rules_named
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.drive_resets import DriveResets
from fault_tolerance.nodes.message_types import message_type

RULES = """
rules:
  - name: leg monitor
    topic: /diagnostics
    type: diagnostic_msgs/msg/DiagnosticArray
    field: status[.name=hexapod monitor].values[.key={drive}].value
    drives: {theta_1: leg A, theta_2: leg B, theta_3: leg C, theta_4: leg D}
    reset: {service: monitor/reset}
    cases:
      - {is: tracking, says: well}
      - {is: [idle, homing], says: nothing}
      - {is: seized, says: stuck, text: seized}
    otherwise: worse
  - name: amplifiers
    topic: amplifiers/codes
    type: std_msgs/msg/Int32MultiArray
    field: data[{drive}]
    drives: "{index}"
    reset: {service: "amplifiers/reset_{drive}", type: std_srvs/srv/SetBool, request: {data: true}}
    cases:
      - {is: 0, says: well}
      - {bits: 1, says: free, text: no supply}
    otherwise: worse
  - name: heat
    topic: motor_{drive}/temperature
    type: sensor_msgs/msg/Temperature
    best_effort: true
    field: temperature
    drives: "{number}"
    cases:
      - {within: [-50, 80], says: well}
      - {within: [80, 120], says: nothing}
    otherwise: worse
  - name: never heard
    topic: never
    type: std_msgs/msg/Int32MultiArray
    field: data[0]
    cases:
      - {is: 0, says: well}
    otherwise: worse
  - name: not here
    topic: elsewhere
    type: other_vendors_msgs/msg/DriveState
    field: state
    cases:
      - {is: 0, says: well}
    otherwise: worse
"""


class Machine:
    """Drives with a monitor of their own, which knows nothing of this package."""

    def __init__(self, probe: Probe) -> None:
        self._probe = probe
        self._monitor = probe.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._amplifiers = probe.node.create_publisher(Int32MultiArray, 'amplifiers/codes', 10)
        self.heard = probe.heard(DiagnosticArray, '/diagnostics')
        probe.wait(self._amplifiers.get_subscription_count, 'drive_reports')

    def legs(self, level: bytes = DiagnosticStatus.OK, **states: str) -> None:
        """Publish what the monitor says; all legs track, but for those given."""
        legs = dict.fromkeys('ABCD', 'tracking') | states
        values = [KeyValue(key=f'leg {name}', value=word) for name, word in legs.items()]
        self._monitor.publish(DiagnosticArray(status=[
            DiagnosticStatus(name='hexapod monitor', level=level, values=values)]))

    def codes(self, *codes: int) -> None:
        self._amplifiers.publish(Int32MultiArray(data=codes))

    def reports(self) -> dict[str, DiagnosticStatus]:
        """Return the newest report of every drive and rule."""
        return {
            status.name: status for message in list(self.heard) for status in message.status
            if 'failure_mode' in values_of(status) and 'drive_reports: ' in status.name
        }


@pytest.fixture
def controller(start, probe):
    return start(
        'controller', mechanism='fsm_4_strut', reset_service='drive_reports/reset')


@pytest.fixture
def machine(start, probe, plant, tmp_path):
    rules = tmp_path / 'legs.yaml'
    rules.write_text(RULES, encoding='utf-8')
    start('drive_reports', mechanism='fsm_4_strut', rules=rules)
    return Machine(probe)


def mode_of(machine: Machine, name: str) -> str:
    status = machine.reports().get(name)
    return '' if status is None else values_of(status)['failure_mode']


def test_a_fault_degrades_and_its_reset_and_a_clear_make_it_nominal(machine, plant, probe):
    machine.legs(B='homing')
    machine.legs()
    machine.codes(0, 0, 0, 0)
    plant.reach('nominal')
    machine.legs(DiagnosticStatus.WARN, B='seized')
    begin = time.monotonic()
    plant.reach('degraded')
    assert time.monotonic() - begin < 5.0
    probe.wait(lambda: probe.mechanism['failures'] == 'position:theta_2', 'the metrics')
    report = machine.reports()['drive_reports: theta_2 (leg monitor)']
    assert (report.level, report.hardware_id) == (DiagnosticStatus.ERROR, 'theta_2')
    assert report.message == 'seized: seized'
    # It is reported again while it holds, so it cannot be cleared, and silence mends nothing.
    count = len(machine.heard)
    probe.wait(lambda: sum(
        any(one.name == report.name for one in message.status) for message in machine.heard[count:]
    ) >= 2, 'two repetitions')
    assert not probe.clear().success
    # On its way back it is not well yet.
    machine.legs(B='homing')
    machine.legs()
    probe.wait(
        lambda: mode_of(machine, report.name) == 'none', 'the report that it is well again')
    assert probe.clear().success
    plant.reach('nominal')


def test_two_rules_about_one_drive_add_up_and_it_is_reset(machine, plant, probe):
    machine.legs(D='seized')
    machine.codes(0, 0, 0, 3)
    plant.reach('degraded')
    probe.wait(lambda: mode_of(machine, 'drive_reports: theta_4 (amplifiers)') == 'torque', 'both')
    assert mode_of(machine, 'drive_reports: theta_4 (leg monitor)') == 'position'
    plant.step()
    probe.wait(lambda: probe.mechanism['failures'] == 'position:theta_4', 'the worse of them')
    # There is no service: that is said, and it is cleared even so.
    answer = probe.clear()
    assert not answer.success
    assert answer.message.startswith(
        'no service /monitor/reset; no service /amplifiers/reset_3; still reported: ')
    asked: list[Any] = []

    def amplifier(request, response):
        asked.append(request.data)
        machine.codes(0, 0, 0, 0)
        response.success = True
        return response

    def monitor(_, response):
        response.success, response.message = len(asked) > 1, 'too hot'
        return response

    services = (
        probe.node.create_service(SetBool, 'amplifiers/reset_3', amplifier),
        probe.node.create_service(Trigger, 'monitor/reset', monitor),
    )

    def refused():
        # Until drive_reports has discovered them.
        answer = probe.clear()
        return not answer.success and 'refused: too hot' in answer.message

    probe.wait(refused, 'a refusal')
    assert asked == [True] and mode_of(machine, 'drive_reports: theta_4 (amplifiers)') == 'none'
    plant.reach('degraded')
    client = probe.node.create_client(Trigger, 'fault_tolerance/clear_failures')
    probe.wait(client.service_is_ready, 'the controller')
    asked.append(True)
    cleared = client.call_async(Trigger.Request())
    plant.reach('hold')
    probe.metrics.clear()

    def told():
        # Metrics from before the hold may still be on their way.
        plant.step()
        assert probe.state == 'hold' and not cleared.done()
        return probe.metrics and 'drives are reset' in probe.metrics[-1].status[0].message

    probe.wait(told, 'why it holds')
    machine.legs()
    probe.wait(cleared.done, 'the answer')
    assert cleared.result().message.startswith('reset: theta_4; released ')
    assert cleared.result().success
    plant.reach('nominal')
    for one in services:
        probe.node.destroy_service(one)


def test_sensor_data_of_one_topic_for_each_drive(machine, plant, probe):
    publisher = probe.node.create_publisher(
        Temperature, 'motor_3/temperature', qos_profile_sensor_data)
    probe.wait(publisher.get_subscription_count, 'drive_reports')

    def reported(temperature: float, mode: str) -> bool:
        # Sensor data may get lost.
        publisher.publish(Temperature(temperature=temperature))
        probe.listen(0.02)
        return mode_of(machine, 'drive_reports: theta_3 (heat)') == mode

    probe.wait(lambda: reported(135.5, 'torque'), 'too hot')
    plant.reach('degraded')
    report = machine.reports()['drive_reports: theta_3 (heat)']
    assert report.message == 'unknown value: 135.5'
    reported(100.0, '')
    probe.wait(lambda: reported(60.0, 'none'), 'cool again')
    assert probe.clear().success
    plant.reach('nominal')


def test_a_type_that_is_missing_is_told_in_one_line(start, probe, tmp_path):
    rules = tmp_path / 'legs.yaml'
    rules.write_text(RULES, encoding='utf-8')
    node = start('drive_reports', 'left', mechanism='fsm_4_strut', rules=rules)
    machine = Machine(Probe('left'))
    machine.codes(0, 1, 0, 0)
    name = 'left/drive_reports: theta_2 (amplifiers)'
    own: list[Any] = []

    def told() -> bool:
        machine._probe.listen(0.02)
        own[:] = [status for message in machine.heard for status in message.status
                  if status.name == 'left/drive_reports: rules']
        return bool(own) and mode_of(machine, name) == 'torque'

    probe.wait(told, 'the other rule to work')
    # In a namespace another robot's controller must not take it for its own.
    assert machine.reports()[name].hardware_id == 'left/theta_2'
    assert own[-1].hardware_id == 'left/drive_reports'
    assert own[-1].level == DiagnosticStatus.WARN
    assert 'no type other_vendors_msgs/msg/DriveState; waiting for ' in own[-1].message
    assert node.output.count('other_vendors_msgs/msg/DriveState') == 1
    # What has said nothing after 5 s is told too.
    probe.wait(lambda: 'never heard waits for it' in node.output, 'the line about silence')
    assert 'nothing on never yet' in node.output
    text = 'check the drive names in the rule file'
    probe.wait(lambda: text in node.output, 'the line about drives')
    assert '/diagnostics says nothing of theta_1, theta_2, theta_3, theta_4:' in node.output
    assert 'elsewhere' not in node.output
    assert node.alive
    machine._probe.close()


def test_a_wrong_rule_file_is_one_line_and_no_start(tmp_path):
    rules = tmp_path / 'legs.yaml'
    rules.write_text(RULES.replace('theta_3', 'theta_9'), encoding='utf-8')
    done = subprocess.run(
        [sys.executable, '-m', 'fault_tolerance.nodes.drive_reports', '--ros-args',
         '-p', f'rules:={rules}'],
        capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        f'drive_reports: {rules}: rules.leg monitor.drives.theta_9: is no drive of '
        'mirror_4_strut; known: theta_1, theta_2, theta_3, theta_4, strut_1, strut_2, strut_3, '
        'strut_4\n')


@pytest.mark.parametrize(('kind', 'there'), [
    ('std_msgs/msg/Int32', True), ('std_msgs/msg/Nothing', False), ('no_msgs/msg/Int32', False),
    ('os/msg/Path', False),
])
def test_types_are_found_by_name(kind, there):
    found = message_type(kind)
    assert (found is not None) is there
    if there:
        assert found.__name__ == kind.rpartition('/')[2]


def test_a_call_that_raises_is_answered_with_its_error(probe, tmp_path, monkeypatch):
    file = tmp_path / 'rules.yaml'
    file.write_text(RULES)
    watch = DriveWatch(rules_named(str(file)), mechanism_named('fsm_4_strut'))
    watch.take('amplifiers/codes', Int32MultiArray(data=[0, 0, 0, 3]))
    resets = DriveResets(probe.node, watch, 0.5)
    name = probe.node.resolve_service_name('amplifiers/reset_3')
    probe.node.create_service(SetBool, name, lambda _, response: response)
    client = probe.node.create_client(Trigger, '~/reset')
    call = Client.call_async

    def broken(self, request):
        future = call(self, request)
        if self.service_name == name:
            future.set_exception(RuntimeError('of another version'))
        return future

    monkeypatch.setattr(Client, 'call_async', broken)
    probe.wait(lambda: client.service_is_ready() and probe.node.count_services(name), 'services')
    answer = client.call_async(Trigger.Request())
    probe.wait(lambda: resets.look() or answer.done(), 'an answer')
    assert not answer.result().success
    assert answer.result().message.endswith(f'{name} refused: of another version')
