# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Commands are what the middleware would make of them, and rivals are noticed."""

from __future__ import annotations

import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray

from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes import command_publisher
from fault_tolerance.nodes.command_publisher import CommandPublisher
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.timeline import TimeLine

TOPIC = 'velocity_controller/commands'


def publisher_of(probe, name):
    node = probe.node
    return CommandPublisher(node, mechanism_named(name), 'base', TimeLine(node.get_clock()))


@pytest.mark.parametrize('name', ['fsm_4_strut', 'gough_stewart_6', 'gough_stewart_8'])
def test_any_number_of_drives_gets_its_rates(probe, name):
    heard, publisher = probe.heard(Float64MultiArray, TOPIC), publisher_of(probe, name)
    probe.wait(lambda: probe.node.count_publishers(TOPIC), 'the publisher')
    rates = np.linspace(-1.0, 1.0, len(mechanism_named(name).actuators))
    probe.wait(lambda: publisher.publish(rates, np.zeros(6)) or heard, 'a command')
    signs = mechanism_named(name).rates_from_readings(np.ones(len(rates)))
    assert list(heard[-1].data) == (signs * rates).tolist()
    assert (list(heard[-1].layout.dim), heard[-1].layout.data_offset) == ([], 0)
    publisher.stop()
    probe.wait(lambda: not any(heard[-1].data), 'zeros')


def test_another_publisher_of_commands_is_told_of_once_it_has_lasted(probe, monkeypatch):
    """One that was killed is known for some time."""
    monkeypatch.setattr(command_publisher, 'RIVAL_PATIENCE', 0.3)
    publisher, timeline = publisher_of(probe, 'fsm_4_strut'), TimeLine(probe.node.get_clock())
    health = Health(probe.node, timeline, 'controller', '', lambda: (0, 'well'))

    def told():
        publisher.check_publishers(health)
        return health.told()[1]

    alone = timeline.now() + 0.5
    probe.wait(lambda: told() and timeline.now() > alone, 'a while alone')
    assert told() == 'well'
    other = probe.node.create_publisher(Float64MultiArray, TOPIC, 10)
    probe.wait(lambda: probe.node.count_publishers(TOPIC) == 2, 'the other')
    assert told() == 'well'
    expected = f'well; 2 publishers on /{TOPIC}: the drives follow whichever is the last'
    probe.wait(lambda: told() != 'well', 'a warning')
    assert told() == expected
    probe.node.destroy_publisher(other)
