# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A machine with its own wiring, units and delays, for a file that may describe it wrongly."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from fault_tolerance.commissioning.couplings import couplings
from fault_tolerance.commissioning.first_motion import FirstMotion
from fault_tolerance.commissioning.standing import home_findings, stroke_findings
from fault_tolerance.commissioning.step_sizes import planned
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.faults import FaultCommand
from fault_tolerance.simulation.plant import ElasticPlant


class Machine:
    """The elastic plant behind drives and encoders of its own; commands and readings by place.

    ``mechanism`` is the truth. ``encoders`` and ``drives`` (N,) are gains, beside the signs of the
    mechanism; ``delay`` is in seconds.
    """

    def __init__(self, mechanism, *, encoders=1.0, drives=1.0, delay=0.0, period=0.04,
                 motor=False, settings=None):
        self.mechanism, self.period = mechanism, period
        self.plant = ElasticPlant(mechanism, settings)
        count = len(mechanism.actuators)
        self.encoders = np.broadcast_to(encoders, count)
        self.drives = np.broadcast_to(drives, count)
        self.motor = np.broadcast_to(motor, count)
        self.now = 0.0
        self._queue = deque([np.zeros(count)] * round(delay / period))
        for _ in range(20):
            self.plant.step(period)

    def step(self, commands):
        """Take published commands (N,), let a period pass, and return readings by name."""
        self._queue.append(np.asarray(commands, dtype=np.float64))
        rates = self.mechanism.rates_from_readings(self._queue.popleft())
        self.plant.command(self.drives * rates)
        state = self.plant.step(self.period)
        self.now += self.period
        read = np.where(self.motor, self.plant.setpoints + 1e-9 * np.sin(1e4 * self.now),
                        state.measured_values)
        readings = self.mechanism.readings_from_values(self.encoders * read)
        return dict(zip(self.mechanism.joint_state_names, readings.tolist(), strict=True))

    def breaks(self, name, mode):
        self.plant.apply(FaultCommand(mode, (name,)))


def values_of(file, readings):
    return file.values_from_readings(
        np.array([readings[name] for name in file.joint_state_names]))


def rest(file, machine, duration=1.0):
    """Return mean and standard deviation of the values at rest, as the node takes them."""
    count = len(file.actuators)
    found = np.array([values_of(file, machine.step(np.zeros(count)))
                      for _ in range(round(duration / machine.period))])
    return found.mean(axis=0), found.std(axis=0)


def commissioned(file, machine, *, step=None, strain=None, meanwhile=None, longest=200.0):
    """Return the first motion of a machine by a file, once it has ended.

    ``meanwhile(machine)`` is called in every period.
    """
    mean, noise = rest(file, machine)
    motion = FirstMotion(planned(file, couplings(file, mean), step, strain), noise, mean)
    motion.standing = [*stroke_findings(file, mean), *home_findings(file, mean, noise)]
    rates, end = np.zeros(len(mean)), machine.now + longest
    while not motion.ended:
        assert machine.now < end, 'does not end'
        if meanwhile:
            meanwhile(machine)
        readings = machine.step(file.rates_from_readings(rates))
        rates = motion.reading(machine.now, values_of(file, readings))
    assert not rates.any()
    return motion


def changed(mechanism, **changes) -> Mechanism:
    """Return a mechanism with other actuators: ``name={'sign': -1}``."""
    actuators = tuple(replace(one, **changes.get(one.name, {})) for one in mechanism.actuators)
    by_name = {one.name: one for one in actuators}
    struts = tuple(
        replace(strut, joints=tuple(
            replace(joint, actuator=by_name[joint.actuator.name]) if joint.actuator else joint
            for joint in strut.joints))
        for strut in mechanism.struts)
    return replace(mechanism, actuators=actuators, struts=struts)


def reordered(mechanism, *order) -> Mechanism:
    """Return a mechanism whose ``actuators`` have another order."""
    return replace(mechanism, actuators=tuple(mechanism.actuators[i] for i in order))


def wrong_of(motion):
    return [one for one in motion.findings if one.level == 'wrong']


def shipped(name, **changes):
    return changed(mechanism_named(name), **changes)
