# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Helpers for tests of the controller: reports, and a supervisor fed with fresh inputs."""

from __future__ import annotations

import numpy as np

from fault_tolerance.control.reports import ERROR, Report
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.supervisor import Supervisor
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
