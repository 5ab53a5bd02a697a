# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What the controller makes of the reports: from a message of a drive to the state, and back."""

import pytest
from core.control.control_cases import fed, feed
from core.drive_rules.drive_messages import (
    NAMES,
    Message,
    dynamic_joint_state,
    mirror,
    watch,
)

from fault_tolerance.control.failure_reports import ERROR, OK, part_names, report_of

PREFIX = 'mirror'


class Machine:
    """A controller that gets what rules make of messages, as the node sends it."""

    def __init__(self, rules, mechanism):
        self.watch, self.supervisor = watch(rules, mechanism), fed(mechanism)
        self.now = 0.0
        self.names = part_names(mechanism)

    def take(self, topic, message):
        """Return state and failures after a message."""
        self.now += 0.01
        self.watch.take(topic, message)
        found = [
            report_of(
                f'drive_reports: {one.actuator} ({one.rule})', f'{PREFIX}/{one.actuator}',
                OK if one.mode == 'none' else ERROR, one.mode, None,
                prefix=PREFIX, names=self.names)
            for one in self.watch.reports()
        ]
        self.supervisor.reports(found, self.now)
        return self.state()

    def state(self):
        feed(self.supervisor, self.now)
        output = self.supervisor.step(self.now)
        return output.state.value, ','.join(map(str, output.failures.failures))

    def clear(self):
        self.now += 0.01
        return self.supervisor.clear(self.now)


def words(**given):
    return dynamic_joint_state(dict.fromkeys(NAMES, 0x237) | given)


def test_a_fault_and_its_reset():
    machine = Machine('cia402', mirror(theta_2='stuck'))
    topic = 'dynamic_joint_states'
    assert machine.take(topic, words(theta_2=0x240)) == ('nominal', '')
    assert machine.take(topic, words()) == ('nominal', '')
    degraded = ('degraded', 'position:theta_2')
    assert machine.take(topic, words(theta_2=0x218)) == degraded
    assert machine.take(topic, words(theta_2=0x240)) == degraded
    machine.clear()
    assert machine.state() == degraded
    # Well again, and latched until somebody clears it.
    assert machine.take(topic, words()) == degraded
    machine.clear()
    assert machine.state() == ('nominal', '')


def test_an_amplifier_that_carries_two_drives_stops_a_machine_that_bears_one():
    rules = """
drives: {theta_1: 1, theta_2: 2, amplifier: 3}
rules:
  - name: amplifiers
    topic: codes
    type: std_msgs/msg/Int32MultiArray
    field: data[{drive}]
    cases: [{is: 0, says: well}]
    otherwise: when_off
"""
    machine = Machine(rules, mirror())
    assert machine.take('codes', Message(data=[0, 0, 0, 0])) == ('nominal', '')
    state, failures = machine.take('codes', Message(data=[0, 0, 0, 7]))
    assert (state, failures) == ('stopped', 'torque:theta_3,torque:theta_4')


@pytest.mark.parametrize('code', [1, 1034, -5])
def test_an_error_that_names_no_leg_stops_the_machine_until_it_is_gone_and_cleared(code):
    machine = Machine('machine_error', mirror())
    topic = 'machine/error_id'
    assert machine.take(topic, Message(data=0)) == ('nominal', '')
    assert machine.take(topic, Message(data=code))[0] == 'stopped'
    machine.clear()
    assert machine.state()[0] == 'stopped'
    assert machine.take(topic, Message(data=0))[0] == 'stopped'
    machine.clear()
    assert machine.state() == ('nominal', '')
