# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Two mirrors in two namespaces share /diagnostics and nothing else."""

from __future__ import annotations

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from node_rig import CALM, Probe, values_of
from std_msgs.msg import String

NAMESPACES = ('left', 'right')


@pytest.fixture
def robots(ros, start):
    for namespace in NAMESPACES:
        start('fsm_simulator', namespace, mechanism='fsm_4_strut', rate=CALM)
        start('controller', namespace, mechanism='fsm_4_strut')
    probes = [Probe(namespace) for namespace in NAMESPACES]
    for probe in probes:
        probe.wait_for_state('nominal')
    yield probes
    for probe in probes:
        probe.close()


def test_what_breaks_on_one_does_not_reach_the_other(robots):
    left, right = robots
    heard = left.heard(DiagnosticArray, '/diagnostics')
    reports: list = []
    faults = left.node.create_publisher(String, 'fsm/inject_fault', 10)
    left.wait(faults.get_subscription_count, 'the simulator')
    faults.publish(String(data='torque strut_4'))
    left.wait_for_state('degraded')

    def count() -> int:
        reports[:] = [
            status
            for message in heard
            for status in message.status
            if 'failure_mode' in values_of(status)
        ]
        return len(reports)

    left.wait(lambda: count() >= 3, 'three reports')
    assert {status.hardware_id for status in reports} == {'left/theta_4'}
    right.metrics.clear()
    right.wait(lambda: right.metrics, 'metrics')
    right.wait_for_state('nominal')
    assert right.mechanism['failures'] == ''
    assert left.mechanism['failures'] == 'torque:theta_4'
    assert not right.clear().success
    left.wait_for_state('degraded')


def test_a_prefix_of_ones_own_may_be_chosen(start, probe):
    start('fsm_simulator', mechanism='fsm_4_strut', rate=CALM)
    start('controller', mechanism='fsm_4_strut', hardware_id_prefix='left')
    probe.wait_for_state('nominal')
    left = Probe('left')
    start('fsm_simulator', 'left', mechanism='fsm_4_strut', rate=CALM)
    faults = left.node.create_publisher(String, 'fsm/inject_fault', 10)
    left.wait(faults.get_subscription_count, 'the simulator')
    faults.publish(String(data='torque strut_4'))
    probe.wait_for_state('degraded')
    left.close()
