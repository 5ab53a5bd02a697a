# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Mechanisms of many struts: what a step costs, and that it is no other for being many."""

import time

import numpy as np

from fault_tolerance.control.settings import Settings
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.configuration import fitted_configuration
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

LONG = Settings(joint_state_timeout=1e9, command_timeout=1e9)


class Following:
    """A supervisor of a mirror on many struts that follows a motion."""

    def __init__(self, struts):
        self.mechanism = evenly_spaced_mirror(struts)
        self.supervisor = Supervisor(self.mechanism, LONG)
        self.supervisor.task_velocity(np.array([1e-3, 7e-4, 0.0]), 0.0)
        self.supervisor.joint_reading(np.zeros(struts), 0.0)
        direction = self.supervisor.step(0.0).rates
        self.places = [
            fitted_configuration(self.mechanism, way * direction).actuator_values
            for way in np.linspace(0.0, 0.5, 5)
        ]
        self.count = 0

    def step(self):
        """Take the next joint values; return the seconds a step takes."""
        self.count += 1
        now = 1e-3 * self.count
        begin = time.process_time()
        self.supervisor.joint_reading(self.places[self.count % len(self.places)], now)
        self.output = self.supervisor.step(now)
        return time.process_time() - begin


def test_a_step_costs_no_more_a_strut_when_they_are_many():
    few, many = Following(32), Following(512)
    costs = [[one.step() for one in (few, many)] for _ in range(30)]
    least_few, least_many = np.min(costs, axis=0)
    assert least_many / least_few < 1.5 * 512 / 32
    for one in (few, many):
        output = one.output
        assert output.rates.any()
        np.testing.assert_allclose(output.residual, 0.0, atol=1e-12)
