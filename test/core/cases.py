# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Named mechanisms at home and away from it, and sets of failures to befall them."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
from core import reference
from core.mechanisms import DOCUMENTS, bennett, made

from fault_tolerance.control.joint_states import JointStateReader
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import PostFailure, reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import (
    Configuration,
    fitted_configuration,
    home_configuration,
    solved_configuration,
)
from fault_tolerance.mechanism.description import Mechanism

PAPER = ('fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated')
NAMES = (*PAPER, 'mirror_overactuated', 'gough_stewart_6', 'bennett', *DOCUMENTS)
# The four-strut mirror is rigid at home only: its compliance has tests of its own.
RIGID = tuple(name for name in NAMES if name != 'fsm_4_strut')


@cache
def named(name: str) -> Mechanism:
    """Return a mechanism of the test catalogue, or one that is shipped."""
    if name == 'bennett':
        return made(bennett())
    return made(DOCUMENTS[name]()) if name in DOCUMENTS else mechanism_named(name)


def joint_values(configuration: Configuration) -> np.ndarray:
    """Return the values of all joints, strut by strut."""
    mechanism = configuration.mechanism
    return np.concatenate([
        configuration.joint_values[index, : len(strut.joints)]
        for index, strut in enumerate(mechanism.struts)
    ])


@cache
def independent_drives(name: str) -> tuple[str, ...]:
    """Return actuators that determine where the mechanism is, the first ones that do."""
    mechanism = named(name)
    values = np.zeros(sum(len(strut.joints) for strut in mechanism.struts))
    mapping = reference.model(mechanism, values).mapping
    chosen: list[int] = []
    for index in range(len(mapping)):
        if np.linalg.matrix_rank(mapping[[*chosen, index]], 1e-6) > len(chosen):
            chosen.append(index)
    return tuple(mechanism.actuator_names[index] for index in chosen)


def unit(mechanism: Mechanism, actuator: str) -> float:
    """Return a radian, or a characteristic length for a prismatic actuator."""
    kind = mechanism.actuators[mechanism.actuator_index(actuator)].kind
    return 1.0 if kind == 'revolute' else mechanism.characteristic_length


@cache
def moves(name: str, size: float = 0.1) -> dict[str, float]:
    """Return values of the independent drives that take the mechanism away from home."""
    rng = np.random.default_rng(len(name))
    mechanism = named(name)
    return {
        actuator: float(rng.uniform(0.3, 1.0) * rng.choice([-1, 1])) * size
        * unit(mechanism, actuator)
        for actuator in independent_drives(name)
    }


@cache
def home(name: str) -> Configuration:
    return home_configuration(named(name))


@cache
def away(name: str) -> Configuration:
    return solved_configuration(named(name), moves(name))


def state(configuration: Configuration, failures=()) -> PostFailure:
    """Return the kinematics at ``configuration`` with the pairs (mode, name) of ``failures``."""
    return reconfigured(
        strut_rows(configuration), failure_set(configuration.mechanism, failures)
    )


def single_failures(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Return every failure there can be, as pairs (mode, name)."""
    return [
        *(('position', name) for name in mechanism.actuator_names),
        *(('torque', name) for name in mechanism.actuator_names),
        *(('hard', name) for name in mechanism.strut_names),
    ]


def failure_lists(mechanism: Mechanism, most: int = 40) -> list[list[tuple[str, str]]]:
    """Return no failure, all single ones and ``most`` of two to four, each effective."""
    singles = single_failures(mechanism)
    rng = np.random.default_rng(most)
    several = [list(chosen) for chosen in combinations(singles, 2)]
    several += [
        [singles[index] for index in rng.choice(len(singles), size, replace=False)]
        for size in (3, 4)
        for _ in range(most)
        if size <= len(singles)
    ]
    rng.shuffle(several)
    chosen = [[], *([single] for single in singles), *several[:most]]
    sets = dict.fromkeys(failure_set(mechanism, failures) for failures in chosen)
    return [
        [(failure.mode.value, failure.name) for failure in found.failures] for found in sets
    ]


@cache
def tilted(name: str, about_x: float, about_y: float, lift: float = 0.0) -> Configuration:
    """Return a mirror tilted by these small angles: readings as the linear model has them."""
    mechanism = named(name)
    values = []
    for strut in mechanism.struts:
        x, y, _ = strut.joints[-1].point - mechanism.origin
        values.append(about_x * y - about_y * x + lift)
    return fitted_configuration(mechanism, np.array(values))


def joint_readings(mechanism, names, positions, failed=()):
    """Return what a reader makes of a joint state when it comes for the second time.

    The first one without all joints is a part, to which others may come.
    """
    reader = JointStateReader(mechanism)
    reader.readings(names, positions, failed)
    return reader.readings(names, positions, failed)
