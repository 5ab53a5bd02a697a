# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What is carried from one estimate to the next, and kept, only saves time."""

from dataclasses import replace

import numpy as np
from core.kernel.kernel_cases import failure_sets, modelled, relative, values_at
from core.mechanisms import DOCUMENTS, by_numbers, made

from fault_tolerance.control.estimate import Estimate, estimate
from fault_tolerance.control.rate_command import initial_command, rate_command
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.catalogue import mechanism_named

MACHINES = [mechanism_named(name) for name in
            ('mirror_4_strut', 'mirror_overactuated', 'gough_stewart_8', 'serial_3r')]
MACHINES += [made(DOCUMENTS['two_stage_mirror']()), made(DOCUMENTS['guided_mirror']()),
             made(by_numbers())]


def walk(mechanism, rng):
    """Yield joint values along a closed way, and the failures of each place."""
    sets = failure_sets(mechanism, rng, 4, 2)
    ends = [values_at(mechanism, 0.03, rng) for _ in range(3)]
    for number in range(60):
        first, second = ends[number // 20], ends[(number // 20 + 1) % 3]
        share = (number % 20) / 20
        yield (1.0 - share) * first + share * second, sets[(number // 7) % len(sets)]


def results_of(found: Estimate, asked) -> list:
    """Return what an estimate says, and the command that follows from it."""
    command = rate_command(found.model, found, asked, initial_command(found.model), 0.0)
    arrays = found.arrays
    mapping = arrays.driving[:, None] * arrays.follow
    free = [mapping @ mapping.T, arrays.jacobian @ mapping.T]
    return [found.pose, found.actuator_values, *free, found.measures(), command.rates]


def test_an_estimate_is_the_same_from_the_last_one_and_from_home():
    for mechanism in MACHINES:
        rng = np.random.default_rng(3)
        model = modelled(mechanism, best_kernel())
        asked, last = rng.standard_normal(len(mechanism.task.coordinates)), model.unknown
        for values, failures in walk(mechanism, rng):
            last = estimate(model, last, values, failures)
            afresh = estimate(model, model.unknown, values, failures)
            where = mechanism.name, failures
            assert (last.hold_reason, last.tolerated, last.mobility) == (
                afresh.hold_reason, afresh.tolerated, afresh.mobility), where
            if last.tolerated and not last.hold_reason:
                off = [relative(one, other) for one, other in zip(
                    results_of(last, asked), results_of(afresh, asked), strict=True)]
                # Pose and joint values; then what follows from them, which bends more.
                assert max(off[:2]) <= 1e-9, where
                assert max(off) <= 1e-8, where


def test_a_long_way_round_leads_back_to_the_same_place():
    for mechanism in MACHINES:
        model, rng = modelled(mechanism, best_kernel()), np.random.default_rng(6)
        way = [values_at(mechanism, 0.02, rng) for _ in range(5)]
        last = model.unknown
        for number in range(5000):
            last = estimate(model, last, way[number % len(way)], FailureSet())
        afresh = estimate(model, model.unknown, way[number % len(way)], FailureSet())
        assert relative(last.pose, afresh.pose) <= 1e-9, mechanism.name
        turn = last.pose[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-14)


def test_flags_that_are_carried_over_are_those_that_would_be_made():
    for mechanism in MACHINES:
        model = modelled(mechanism, best_kernel())
        last = model.unknown
        for values, failures in walk(mechanism, np.random.default_rng(4)):
            # Of an estimate with other failures nothing can be carried over.
            other = replace(last, failures=FailureSet(stuck=('nobody',)),
                            flags=np.full_like(last.flags, np.nan))
            other = estimate(model, other, values, failures)
            last = estimate(model, last, values, failures)
            np.testing.assert_array_equal(last.flags, other.flags)
            for one, same in zip(last.arrays, other.arrays, strict=True):
                np.testing.assert_array_equal(one, same)


def test_what_an_estimate_was_made_from_is_left_alone():
    mechanism = MACHINES[0]
    model, values = modelled(mechanism, best_kernel()), np.full(4, 1e-5)
    first = estimate(model, model.unknown, values, FailureSet(stuck=('theta_1',)))
    before, given = [one.copy() for one in first.arrays], values.copy()
    estimate(model, first, values, FailureSet(lost=('strut_2',)))
    rate_command(model, first, np.ones(3), initial_command(model), 0.0)
    first.measures()

    for one, same in zip(first.arrays, before, strict=True):
        np.testing.assert_array_equal(one, same)
    np.testing.assert_array_equal(values, given)
    values[:] = 7.0
    np.testing.assert_array_equal(first.readings, given)
