# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated time may be absent, stand still or be set back: the controller holds and resumes."""

from __future__ import annotations

import pytest
from builtin_interfaces.msg import Time
from node_rig import Plant
from rosgraph_msgs.msg import Clock

NOMINAL = [0.0070711, -0.0141421, -0.0070711, 0.0141421]


class SimulatedPlant(Plant):
    """Drives in simulated time."""

    def __init__(self, probe) -> None:
        super().__init__(probe, [f'theta_{number}' for number in range(1, 5)])
        self.time: float | None = None
        self._clock = probe.node.create_publisher(Clock, '/clock', 10)

    def stamp(self) -> Time:
        """Let some time pass, if there is any, and return it."""
        if self.time is None:
            return Time()
        self.time += 0.004
        stamp = Time(sec=int(self.time), nanosec=int(1e9 * (self.time % 1.0)))
        self._clock.publish(Clock(clock=stamp))
        return stamp


@pytest.fixture
def plant(start, probe):
    start('controller', mechanism='fsm_4_strut', use_sim_time=True)
    plant = SimulatedPlant(probe)
    plant.connect()
    plant.asked = (0.01, 0.02)
    return plant


def test_without_a_clock_it_goes_by_the_time_of_receipt(plant):
    plant.settle(NOMINAL)


def test_a_clock_that_stands_still_leads_to_hold_and_back(plant, probe):
    plant.time = 100.0
    plant.settle(NOMINAL)
    probe.wait_for_state('hold')
    plant.settle(NOMINAL)
    plant.reach('nominal')


def test_a_clock_set_back_leads_to_hold_and_back(plant, probe):
    plant.time = 100.0
    plant.settle(NOMINAL)
    plant.reach('nominal')
    plant.time = 3.0
    plant.joint_state()  # sets the clock, and is not sent
    probe.wait_for_state('hold')
    plant.settle(NOMINAL)
    plant.reach('nominal')


def test_a_clock_set_forward_is_no_more_than_a_pause(plant, probe):
    plant.time = 100.0
    plant.settle(NOMINAL)
    plant.time += 3600.0
    plant.settle(NOMINAL)
    probe.wait(lambda: any(plant.step()) and probe.state == 'nominal', 'nominal')
