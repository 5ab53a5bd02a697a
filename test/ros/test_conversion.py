# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A limp drive of the three-strut mirror, whose brakes the controller may engage, over DDS."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import Vector3Stamped
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64MultiArray, String

from fault_tolerance.analysis.topics import BRAKE_COMMANDS
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path
from fault_tolerance.nodes.messages import labelled_array_to_msg
from fault_tolerance.nodes.simulated_brakes import SimulatedBrakes
from fault_tolerance.simulation.engines import plant_named

BRAKE_TIME = 0.4
"""Seconds."""


@pytest.fixture
def machine(start, probe, tmp_path):
    """Start all nodes; return what injects faults, and the errors of pointing heard."""
    file = tmp_path / 'braked.yaml'
    text = mechanism_path('mirror_3_strut').read_text() + (
        'groups: {amplifier: [theta_1]}\npark: {vz: 0.0001}\n')
    file.write_text(text.replace('actuated: true,', 'actuated: true, brake: true,'))

    def started(**simulator):
        start('fsm_simulator', mechanism=str(file), **simulator)
        controller = start('controller', mechanism=str(file), convert='act')
        start('pointing_reference', mechanism=str(file), kind='circle', amplitude=5e-4)
        errors = probe.heard(Vector3Stamped, 'pointing/error', qos_profile_sensor_data)
        faults = probe.node.create_publisher(String, 'fsm/inject_fault', 10)
        probe.wait_for_state('nominal')
        probe.wait(lambda: errors and faults.get_subscription_count(), 'pointing')
        return controller, faults, errors

    return started


def rms(probe, errors):
    probe.spin(0.5)
    errors.clear()
    probe.spin(1.5)
    found = np.array([(one.vector.x, one.vector.y) for one in errors])
    return float(np.sqrt((found**2).sum(axis=1).mean()))


@pytest.mark.paced
def test_it_is_braked_and_goes_on(machine, probe):
    brakes = probe.heard(Float64MultiArray, 'fault_tolerance/brake_commands', 10)
    controller, faults, errors = machine()
    healthy = rms(probe, errors)
    faults.publish(String(data='torque theta_2'))
    probe.wait_for_state('degraded')
    # For some hundredths of a second it was stopped.
    probe.wait(lambda: 'stopped: theta_2 free' in controller.output, 'a line in the log')
    assert brakes[-1].layout.dim[0].label == 'theta_1,theta_2,theta_3'
    assert brakes[-1].data.tolist() == [0.0, 1.0, 0.0]
    probe.spin(1.5)  # what the stop has cost decays
    # While a busy machine stalls, what is seen says little.
    assert any(rms(probe, errors) < 1.2 * healthy + 1e-7 for _ in range(3))
    probe.metrics.clear()
    probe.wait(lambda: probe.metrics, 'metrics')
    assert probe.mechanism['failures'] == 'position:theta_2'
    # Both measures are 0: the first one counts as the worse.
    assert probe.mechanism['groups'] == 'amplifier next: stopped'
    # Repaired and cleared: the brake lets go.
    faults.publish(String(data='ok all'))
    probe.wait(lambda: probe.clear() is None or probe.state == 'nominal', 'a repair')
    probe.wait_for_state('nominal')
    probe.wait(lambda: brakes[-1].data.tolist() == [0.0] * 3, 'a brake that lets go')
    # No brake helps two that are stuck, but what is left can be parked.
    faults.publish(String(data='position theta_1'))
    faults.publish(String(data='position theta_2'))
    probe.wait(lambda: 'given independently (position measure 0); parked' in controller.output,
               'the end of a park move')
    assert 'parking' in controller.output
    assert probe.state == 'stopped'
    faults.publish(String(data='ok all'))
    probe.wait(lambda: probe.clear() is None or probe.state == 'nominal', 'a repair')
    probe.wait_for_state('nominal')
    # Once more, and nobody reports that the brake has closed: the readings show it.
    assert probe.set_parameter('fsm', 'brakes_report', False).successful
    assert probe.set_parameter('fsm', 'brake_time', 0.1).successful
    faults.publish(String(data='torque theta_2'))
    probe.wait_for_state('stopped')
    probe.wait_for_state('degraded')
    text = 'conversion: readings show that the brake of theta_2 holds'
    # It is said with every reading until the report has come back.
    assert text in controller.output


def test_a_brake_that_does_not_confirm_leaves_the_stop_in_force(machine, probe):
    controller, faults, _ = machine(brakes_work=False)
    faults.publish(String(data='torque theta_2'))
    probe.wait_for_state('stopped')
    probe.wait(lambda: 'not confirmed within 1 s: theta_2' in controller.output, 'a warning')
    assert probe.state == 'stopped'


def test_a_brake_that_lets_go_before_it_has_closed_begins_anew(probe):
    mechanism = mechanism_named('mirror_3_strut')
    plant = plant_named('elastic', replace(mechanism, actuators=tuple(
        replace(one, brake=True) for one in mechanism.actuators)))
    done, node = [], probe.node
    node.declare_parameter('brake_time', BRAKE_TIME)
    node.declare_parameter('brakes_report', True)

    def apply(command):
        done.append((time.monotonic(), str(command.mode)))
        plant.apply(command)

    SimulatedBrakes(node, plant, apply)
    publisher = node.create_publisher(Float64MultiArray, BRAKE_COMMANDS, 10)
    probe.wait(publisher.get_subscription_count, 'the brakes')
    for value in (1.0, 0.0, 1.0):
        begin = time.monotonic()
        publisher.publish(labelled_array_to_msg({'theta_1': value}))
        probe.spin(0.3 * BRAKE_TIME)
    probe.wait(lambda: done, 'a brake that closes')
    assert done[0][0] - begin > 0.95 * BRAKE_TIME
    publisher.publish(labelled_array_to_msg({'theta_1': 0.0}))
    probe.wait(lambda: len(done) > 1, 'a brake that lets go')
    assert [mode for _, mode in done] == ['position', 'none']
