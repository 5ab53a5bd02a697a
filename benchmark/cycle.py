# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller's step without ROS, at another configuration in every call, beside its peers.

A step derives everything anew: loops closed from the drives' readings, rows, J, T, verdict,
resolved rates, limits. It is all that `Supervisor.joint_reading`, `Supervisor.step` and
`Supervisor.watch` do, state machine, watchdogs and plausibility included; targets go by it. A row
of its own has the two functions inside it, `estimate` and `rate_command`. All that is compared
runs in turn, call by call, in one process.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmark.listening import Listening
from benchmark.names import BANK, CYCLE, DEGRADED, DETECTION, GROWTH, STEP
from benchmark.peers import PEERS
from benchmark.samples import main, row
from fault_tolerance.control.control_model import control_model
from fault_tolerance.control.estimate import estimate
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.rate_command import initial_command, rate_command
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import Configuration, fitted_configuration
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

CACHED = 'step of the controller, joint values as before'
RECONFIGURATION = 'reconfiguration by definition'

NAMED = ('mirror_3_strut', 'mirror_4_strut', 'mirror_overactuated', 'gough_stewart_6',
         'gough_stewart_8')
COMPARED = ('mirror_4_strut', 'gough_stewart_8')
MANY = (5, 7, 16, 64, 256, 1000)
_AMPLITUDE = 2e-3
_POSES = 200


def path(mechanism: Mechanism) -> list[Configuration]:
    """Return configurations along a closed curve, small steps apart, loops closed."""
    rng = np.random.default_rng(1)
    scale = _AMPLITUDE * mechanism.characteristic_length / mechanism.rate_scale
    first, second = rng.normal(size=(2, len(scale))) * scale
    found, last = [], None
    for phase in np.linspace(0.0, 2.0 * np.pi, _POSES, endpoint=False):
        values = first * np.cos(phase) + second * np.sin(phase)
        last = fitted_configuration(mechanism, values, start=last)
        found.append(last)
    return found


def derived_anew(mechanism: Mechanism, readings: list[np.ndarray]) -> Callable[[], object]:
    """Return a call of estimate and command at the next readings, each from the last."""
    model, none = control_model(mechanism, Settings(), best_kernel()), failure_set(mechanism, [])
    last, sent = model.unknown, initial_command(model)
    velocity = np.full(len(mechanism.task.coordinates), 1e-5)
    velocity.setflags(write=False)
    count = 0

    def call() -> object:
        nonlocal count, last, sent
        count += 1
        last = estimate(model, last, readings[count % len(readings)], none)
        sent = rate_command(model, last, velocity, sent, 1e-3 * count)
        return sent

    return call


class Cycles:
    """A supervisor that follows a path, a reading a call."""

    def __init__(
        self, mechanism: Mechanism, readings: list[np.ndarray], stuck: str | None = None
    ) -> None:
        self._supervisor = Supervisor(mechanism, Settings(joint_state_timeout=1e9,
                                                          command_timeout=1e9))
        if stuck:
            report = Report(('benchmark', stuck), stuck, 'position', ERROR, None)
            self._supervisor.reports([report], 0.0)
        self._readings = readings
        self._call = 0
        velocity = np.full(len(mechanism.task.coordinates), 1e-5)
        self._supervisor.task_velocity(velocity, 0.0)

    def at_the_next(self) -> None:
        """Take the next joint values, compute the command, and watch."""
        self._call += 1
        now = 1e-3 * self._call
        self._supervisor.joint_reading(self._readings[self._call % len(self._readings)], now)
        self._supervisor.step(now)
        self._supervisor.watch()

    def as_before(self) -> None:
        """Compute the command again."""
        self._call += 1
        self._supervisor.step(1e-3 * self._call)


def in_turn(
    functions: list[Callable[[], Any]], repeats: int, calls: int
) -> list[list[list[float]]]:
    """Return microseconds of every call, by function and repeat; all functions take turns."""
    samples: list[list[list[float]]] = [[[] for _ in range(repeats)] for _ in functions]
    clock = time.perf_counter_ns
    for function in functions:
        function()
    for repeat in range(repeats):
        for _ in range(calls):
            for place, function in enumerate(functions):
                begun = clock()
                function()
                samples[place][repeat].append((clock() - begun) * 1e-3)
    return samples


def run(repeats: int = 5, *, quick: bool = False) -> list[dict[str, Any]]:
    """Return the rows of the results."""
    calls = 20 if quick else 200
    rows = _growth(repeats, calls)
    mechanisms = [mechanism_named(name) for name in NAMED]
    mechanisms += [evenly_spaced_mirror(count) for count in (MANY[:2] if quick else MANY)]
    for mechanism in mechanisms:
        rows += _of_one(mechanism, repeats, calls if len(mechanism.struts) < 100 else calls // 10)
    return rows


def _of_one(mechanism: Mechanism, repeats: int, calls: int) -> list[dict[str, Any]]:
    """Return the rows for one mechanism."""
    configurations = path(mechanism)
    readings = [np.array(one.actuator_values) for one in configurations]
    struts = strut_rows(configurations[0])
    stuck = failure_set(mechanism, [('position', mechanism.actuator_names[-1])])
    named = {
        CYCLE: derived_anew(mechanism, readings),
        STEP: Cycles(mechanism, readings).at_the_next,
        CACHED: Cycles(mechanism, readings).as_before,
        DEGRADED: Cycles(mechanism, readings, mechanism.actuator_names[-1]).at_the_next,
        RECONFIGURATION: lambda: reconfigured(struts, stuck),
    }
    notes = dict.fromkeys(named, '')
    named[CACHED]()
    if mechanism.name in COMPARED:
        listening = Listening(configurations[0])
        named |= {BANK: listening.bank, DETECTION: listening.readings}
        notes |= {BANK: 'all filters, one set of readings', DETECTION: 'after the command'}
        for name, make in PEERS.items():
            step = make(mechanism)
            if step is None:
                continue
            named[name] = _peer(step, mechanism, configurations)
            notes[name] = (
                'given all joint values, loops closed: kinematics, Jacobians of loops and task; '
                + ('one quadratic program' if name in ('pink', 'mink')
                   else 'null space and least squares by numpy')
                + '; no limits, no verdict'
            )
    found = in_turn(list(named.values()), repeats, calls)
    return [
        row(name, samples, mechanism=mechanism.name, struts=len(mechanism.struts),
            note=notes[name])
        for name, samples in zip(named, found, strict=True)
    ]


def _growth(repeats: int, calls: int) -> list[dict[str, Any]]:
    """Return the rows of the step of the mechanisms compared, these two in turn."""
    mechanisms = [mechanism_named(name) for name in COMPARED]
    cycles = []
    for mechanism in mechanisms:
        readings = [np.array(one.actuator_values) for one in path(mechanism)]
        cycles.append(Cycles(mechanism, readings).at_the_next)
    return [
        row(GROWTH.format(len(mechanism.struts)), samples, mechanism=mechanism.name,
            struts=len(mechanism.struts), note='in turn with the other')
        for mechanism, samples in zip(mechanisms, in_turn(cycles, repeats, calls), strict=True)
    ]


def _peer(
    step: Callable[[np.ndarray, np.ndarray], np.ndarray],
    mechanism: Mechanism,
    configurations: list[Configuration],
) -> Callable[[], object]:
    """Return a call of ``step`` at the next configuration."""
    joints = [
        np.concatenate([
            one.joint_values[index, : len(strut.joints)]
            for index, strut in enumerate(mechanism.struts)
        ])
        for one in configurations
    ]
    velocity = np.full(len(mechanism.task.coordinates), 1e-5)
    place = 0

    def call() -> object:
        nonlocal place
        place = (place + 1) % len(joints)
        return step(joints[place], velocity)

    return call


if __name__ == '__main__':
    main(run)
