# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Helpers for tests of the controller: reports, and a supervisor fed with fresh inputs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from fault_tolerance.control.control_model import ControlModel, control_model
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.step_output import Output
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    differential_kinematics,
)
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import Configuration, fitted_configuration
from fault_tolerance.mechanism.description import Mechanism


def report(mode: str, target: str | None, **more) -> Report:
    """Return a report on ``target`` by its drive, at level ERROR and received when stamped."""
    name = more.pop('name', 'drive')
    fields = {'level': ERROR, 'stamp': None, **more}
    return Report((name, target or 'nobody'), target, mode, fields['level'], fields['stamp'])


def fed(mechanism: Mechanism, now: float = 0.0, velocity=None, **settings) -> Supervisor:
    """Return a supervisor that knows the mechanism is at home, with a task velocity if given."""
    supervisor = Supervisor(mechanism, Settings(**settings))
    feed(supervisor, now, velocity)
    return supervisor


def feed(supervisor: Supervisor, now: float, velocity=None, values=None) -> None:
    """Give fresh joint values (home by default) and, if given, a task velocity."""
    count = len(supervisor.mechanism.actuators)
    values = np.zeros(count) if values is None else values
    assert supervisor.joint_reading(values, now) is None
    if velocity is not None:
        assert supervisor.task_velocity(np.asarray(velocity, dtype=float), now) is None


def beside_home(mechanism: Mechanism, direction, size: float) -> Configuration:
    """Return a configuration off home in a direction of the reduced rates.

    The actuator that goes farthest goes by about ``size``, in characteristic lengths or radians.
    """
    mapping = _home(mechanism).mapping
    way = mapping @ np.resize(np.asarray(direction, dtype=float), mapping.shape[1])
    farthest = np.abs(way * mechanism.rate_scale).max() / mechanism.characteristic_length
    return fitted_configuration(mechanism, size * way / farthest)


def values_towards(mechanism: Mechanism, twist) -> np.ndarray:
    """Return how actuators (N,) move for a task displacement (l,) from home, to first order."""
    home = _home(mechanism)
    return home.mapping @ np.linalg.pinv(home.jacobian) @ np.asarray(twist, dtype=float)


@cache
def _home(mechanism: Mechanism) -> DifferentialKinematics:
    return differential_kinematics(home_rows(mechanism))


@cache
def place(name: str, seed: int, size: float = 0.02) -> np.ndarray:
    """Return joint values (N,) near home at which the loops close."""
    mechanism = mechanism_named(name)
    mapping = _home(mechanism).mapping
    rng = np.random.default_rng(seed)
    length = size * mechanism.characteristic_length
    wanted = length * mapping @ rng.uniform(-1.0, 1.0, mapping.shape[1])
    return fitted_configuration(mechanism, wanted).actuator_values


def watched(supervisor: Supervisor, now: float) -> Output:
    """Step, compare readings with commands, and return the output that tells of both."""
    supervisor.step(now)
    supervisor.watch()
    return supervisor.step(now)


def failing(supervisor: Supervisor, *parts: str) -> None:
    """Let the named entry points of the kernel raise from now on."""
    def fail(*_given: object) -> None:
        raise RuntimeError('a\nfault')

    supervisor.kernel = replace(supervisor.kernel, **dict.fromkeys(parts, fail))


def counted(supervisor: Supervisor, part: str) -> list[int]:
    """Return a list that grows with every call of one of the kernel's entry points."""
    calls: list[int] = []
    computed = getattr(supervisor.kernel, part)

    def count(*given: object) -> None:
        calls.append(len(calls))
        computed(*given)

    supervisor.kernel = replace(supervisor.kernel, **{part: count})
    return calls


def modelled(mechanism: Mechanism, **settings) -> ControlModel:
    """Return the model of a mechanism under control, with `Settings` by name."""
    return control_model(mechanism, Settings(**settings), best_kernel())
