# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The kernel says what the definitions say, for every mechanism and any failures."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from core.kernel.kernel_cases import (
    Deviations,
    compare,
    cranked_hexapod,
    failure_sets,
    modelled,
    singles,
    values_at,
)
from core.mechanisms import DOCUMENTS, by_numbers, made, random_machine, revolute, serial_3r

from fault_tolerance.control.estimate import estimate
from fault_tolerance.control.rate_command import initial_command, rate_command
from fault_tolerance.kernel.compilation import best_kernel, python_kernel
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names
from fault_tolerance.mechanism.configuration import fitted_configuration

SHIPPED = [mechanism_named(name) for name in shipped_names()]
OTHERS = [*(made(document()) for document in DOCUMENTS.values()), made(by_numbers())]


def compared(mechanisms, kernel, shares, doubles, triples):
    """Return the deviations at home and ``shares`` of Lc away from it."""
    deviations = Deviations()
    for mechanism in mechanisms:
        model, rng = modelled(mechanism, kernel), np.random.default_rng(1)
        for share in shares:
            values = values_at(mechanism, share, rng) if share else np.zeros(len(
                mechanism.actuators))
            for failures in failure_sets(mechanism, rng, doubles, triples):
                compare(model, values, failures, deviations)
    return deviations


def test_shipped_mechanisms_at_home_with_every_double_failure():
    deviations = Deviations()
    for mechanism in SHIPPED:
        model, home = modelled(mechanism, best_kernel()), np.zeros(len(mechanism.actuators))
        for pair in combinations(singles(mechanism), 2):
            compare(model, home, failure_set(mechanism, pair), deviations)
    assert deviations.cases > 800
    assert not deviations.over()


def test_any_kind_of_mechanism_at_home_and_away():
    deviations = compared([*SHIPPED, *OTHERS], best_kernel(), (0.0, 0.01, 0.3), 2, 2)
    assert deviations.cases > 1000
    assert not deviations.over()


def test_random_machines_many_of_which_are_loose_or_locked():
    deviations = Deviations()
    for seed in range(40):
        mechanism, rng = made(random_machine(seed)), np.random.default_rng(seed)
        model = modelled(mechanism, best_kernel())
        for failures in failure_sets(mechanism, rng, 4, 4)[::2]:
            compare(model, np.zeros(len(mechanism.actuators)), failures, deviations)
    assert deviations.cases > 500
    assert not deviations.over()


def test_beside_the_dead_centre_of_one_strut():
    """Its drive pushes ever harder, and in the end turns without moving the platform."""
    places = [cranked_hexapod(off) for off in (0.1, 1e-3, 1e-5, 1e-7, 0.0)]
    deviations = compared(places, best_kernel(), (0.0, 1e-3), 6, 3)
    assert not deviations.over()


def test_an_arm_beside_its_stretched_configurations():
    mechanism, deviations = made(serial_3r()), Deviations()
    model = modelled(mechanism, best_kernel())
    first = np.arctan2(0.9, 0.5)
    second = np.arctan2(0.2, 0.8) - first
    for bend in (0.1, 1e-3, 1e-5, 1e-7, 1e-12, 0.0):
        values = np.array([0.0, -first + bend, -second + bend])
        for failures in failure_sets(mechanism, np.random.default_rng(1), 20, 20):
            compare(model, values, failures, deviations)
    # p, and so the margin of motion, is the quotient of two numbers down to 1e-7 there.
    assert not set(deviations.over()) - {'measures', 'margins'}, deviations.largest
    assert not deviations.over(1e-8)


def test_a_platform_beside_its_singularity_at_home():
    """Legs 2 and 4 to 8 alone do not hold it at home: the kernel is as near as rounding allows."""
    mechanism, deviations = mechanism_named('gough_stewart_8'), Deviations()
    model = modelled(mechanism, best_kernel())
    failures = failure_set(mechanism, [('free', 'leg_1'), ('free', 'leg_3')])
    legs = np.array([1.0, -0.4, 0.7, 0.2, -0.9, 0.5, 0.3, -0.6]) * mechanism.characteristic_length
    for share in (1e-1, 1e-2, 1e-3, 1e-4, 0.0):
        values = fitted_configuration(mechanism, share * legs).actuator_values
        compare(model, values, failures, deviations)
    # J is the inverse of what is nearly singular: errors grow by its condition.
    assert not {kind for kind in deviations.over() if kind != 'jacobian'}, deviations.largest
    assert not deviations.over(1e-8)


def test_the_kernel_as_python_stays_within_its_arrays():
    """numpy raises IndexError where machine code would read beyond the end.

    And what is used of the workspace leaves room.
    """
    machines = [made(random_machine(seed)) for seed in range(12)]
    chosen = [mechanism_named('mirror_4_strut'), mechanism_named('fsm_overactuated'),
              made(DOCUMENTS['two_stage_mirror']()), made(DOCUMENTS['two_stage_hexapod']()),
              made(by_numbers()), *machines]
    deviations = Deviations()
    for mechanism in chosen:
        model, rng = modelled(mechanism, python_kernel()), np.random.default_rng(2)
        count, work = len(mechanism.actuators), model.packed.work
        work.fill(np.nan)
        for failures in failure_sets(mechanism, rng, 2, 2)[::5]:
            compare(model, np.zeros(count), failures, deviations)
        nonsense = estimate(model, model.unknown, np.full(count, 50.0), failures)
        rate_command(model, nonsense, np.ones(len(mechanism.task.coordinates)),
                     initial_command(model), 0.0)
        assert np.flatnonzero(~np.isnan(work)).max() < 0.7 * len(work), mechanism.name
    assert not deviations.over()


def drives_in_series(count):
    """Return a platform on a strut of ``count`` drives behind six hinges, and on two others."""
    rng = np.random.default_rng(3)

    def strut(name, passive, driven):
        joints = [revolute(f'{name}_{place}', rng.normal(size=3), rng.uniform(-1.0, 1.0, 3),
                           actuated=place >= passive) for place in range(passive + driven)]
        return {'name': name, 'joints': joints}

    return made({
        'mechanism': 'series', 'task': {'coordinates': ['wx'], 'major': ['wx']},
        'platform': {'origin': [0.1, 0.2, 0.3]}, 'characteristic_length': 1.0,
        'struts': [strut('a', 6, count), strut('b', 5, 1), strut('c', 600, 1)],
    })


def test_there_is_room_for_many_drives_in_series_and_for_long_struts():
    for count in (2, 12):
        mechanism = drives_in_series(count)
        model, names = modelled(mechanism, python_kernel()), mechanism.actuator_names
        work, values = model.packed.work, np.zeros(len(names))
        work.fill(np.nan)
        failures = failure_set(mechanism, [('stuck', names[0]), ('free', names[1]), ('hard', 'b')])
        found = estimate(model, model.unknown, values, failures)
        assert found.located
        found.measures()
        assert np.flatnonzero(~np.isnan(work)).max() < 0.95 * len(work)


SENTINEL = 12345.678


def test_machine_code_writes_nothing_behind_its_workspace():
    """It would overwrite whatever comes next in memory, and say nothing."""
    for mechanism in [*SHIPPED, *OTHERS, drives_in_series(2), drives_in_series(12)]:
        model, rng = modelled(mechanism, best_kernel()), np.random.default_rng(7)
        count, size = len(mechanism.actuators), len(model.packed.work)
        room = np.full(size + 1000, SENTINEL)
        model = replace(model, packed=replace(model.packed, work=room[:size]))
        asked, found = np.ones(len(mechanism.task.coordinates)), model.unknown
        command = initial_command(model)
        for number, failures in enumerate(failure_sets(mechanism, rng, 3, 3)):
            for values in (np.zeros(count), np.full(count, 50.0), rng.normal(size=count)):
                found = estimate(model, found, values, failures)
                assert (room[size:] == SENTINEL).all(), mechanism.name
                command = rate_command(model, found, asked, command, 1e-3 * number)
                assert (room[size:] == SENTINEL).all(), mechanism.name
                found.measures()
                assert (room[size:] == SENTINEL).all(), mechanism.name
