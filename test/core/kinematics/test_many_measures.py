# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""All single and double measures at once are what the definitions say, one by one."""

import tracemalloc
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from core import cases
from core.mechanisms import by_numbers, made
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.kinematics import many_measures
from fault_tolerance.kinematics import measures as defined
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import Failure, FailureMode
from fault_tolerance.kinematics.many_measures import (
    hard_measures,
    pair_measures,
    position_measures,
    single_measures,
    torque_measures,
)
from fault_tolerance.mechanism.configuration import home_configuration
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

EXACT = 1e-9


def configurations(name):
    # Away from home the four-strut mirror is rigid and does not close.
    return (cases.home(name),) if name == 'fsm_4_strut' else (cases.home(name), cases.away(name))


def assert_pairs_as_defined(kinematics, pairs):
    driving = np.flatnonzero(kinematics.active).tolist()
    for values in pairs:
        assert np.isnan(values[~kinematics.active]).all()
        assert np.isnan(values[:, ~kinematics.active]).all()
    for first, second in combinations(driving, 2):
        for found, measure in zip(
            pairs, (defined.position_measure, defined.torque_measure), strict=True
        ):
            expected = measure(kinematics, [first, second])
            assert found[first, second] == pytest.approx(expected, abs=EXACT)
            assert found[second, first] == pytest.approx(expected, abs=EXACT)
            assert (found[first, second] == 0.0) == (expected == 0.0)


def assert_as_defined(state):
    kinematics, mechanism = state.present, state.rows.mechanism
    position, torque = single_measures(kinematics)
    for few in (16, 0):  # by minors, and as for many actuators
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(many_measures, '_FEW', few)
            assert_pairs_as_defined(kinematics, pair_measures(kinematics))
    driving = np.flatnonzero(kinematics.active).tolist()
    for index in range(len(mechanism.actuators)):
        if index not in driving:
            assert np.isnan(position[index]) and np.isnan(torque[index])
            continue
        expected = defined.position_measure(kinematics, [index])
        assert position[index] == pytest.approx(expected, abs=EXACT)
        assert (position[index] == 0.0) == (expected == 0.0)
        expected = defined.torque_measure(kinematics, [index])
        assert torque[index] == pytest.approx(expected, abs=EXACT)
        assert (torque[index] == 0.0) == (expected == 0.0)
    hard = hard_measures(state.rows, state.failures, kinematics)
    for place, name in enumerate(mechanism.strut_names):
        if name in state.failures.lost:
            assert np.isnan(hard[place])
            continue
        further = state.failures.and_also(mechanism, Failure(FailureMode.HARD, name))
        after = differential_kinematics(state.rows, further)
        expected = defined.hard_measure(kinematics, after)
        assert hard[place] == pytest.approx(expected, rel=EXACT, abs=EXACT)
        assert (hard[place] == 0.0) == (expected == 0.0)


@pytest.mark.parametrize('name', cases.NAMES)
def test_as_defined_with_anything_failed(name):
    for configuration in configurations(name):
        for failures in cases.failure_lists(configuration.mechanism, 4):
            assert_as_defined(cases.state(configuration, failures))


@given(
    count=st.integers(3, 12),
    lean=st.floats(-0.05, 0.05),
    failed=st.lists(st.tuples(st.sampled_from(['torque', 'hard', 'position']),
                              st.integers(0, 11)), max_size=4),
)
@settings(max_examples=25, deadline=None)
def test_mirrors_of_any_number_of_struts(count, lean, failed):
    mirror = evenly_spaced_mirror(count, first_angle=lean)
    names = {'hard': mirror.strut_names}
    failures = [
        (mode, names.get(mode, mirror.actuator_names)[place % count]) for mode, place in failed
    ]
    assert_as_defined(cases.state(home_configuration(mirror), failures))


def test_given_by_numbers_there_is_no_hard_measure():
    state = cases.state(home_configuration(made(by_numbers())))
    assert_as_defined(state)
    assert hard_measures(state.rows, state.failures, state.present).size == 0


def with_mapping(name, mapping):
    kinematics = cases.state(cases.home(name)).nominal
    basis, _ = np.linalg.qr(np.asarray(mapping, dtype=float))
    return replace(kinematics, mapping=basis, active=np.ones(len(basis), dtype=bool))


@pytest.mark.parametrize('apart', [0.0, 1e-13, 1e-10, 1e-8, 1e-6, 1e-4, 1e-3])
def test_drives_that_are_nearly_the_same(apart):
    """Where the closed forms cancel, and where it has to be decided what is dependent."""
    rows = np.random.default_rng(4).normal(size=(7, 6))
    rows[1] = rows[0] + apart * rows[1]
    rows[6] *= 1e-5
    kinematics = with_mapping('gough_stewart_6', rows)
    position, torque = pair_measures(kinematics)
    for pair in combinations(range(7), 2):
        expected = defined.position_measure(kinematics, pair)
        # The direction between two rows so near is known no better than this.
        known = 1e-15 / apart if apart > 1e-9 else 0.0
        assert position[pair] == pytest.approx(expected, abs=EXACT + 10.0 * known)
        assert torque[pair] == pytest.approx(defined.torque_measure(kinematics, pair), abs=EXACT)


@pytest.mark.parametrize('small', [0.0, 1e-12, 1e-8, 1e-5, 1e-3])
def test_measures_that_are_nearly_zero(small):
    """One drive that is nearly alone with a motion: 1 less its share has no digits left."""
    rows = np.zeros((8, 6))
    rows[:6] = np.eye(6)
    rows[6, 0] = small
    rows[7, 1:] = 1.0
    kinematics = with_mapping('gough_stewart_6', rows)
    _, torque = single_measures(kinematics)
    expected = defined.torque_measure(kinematics, [0])
    assert torque[0] == pytest.approx(expected, rel=1e-6, abs=1e-15)
    assert (torque[0] == 0.0) == (expected == 0.0)
    assert expected == pytest.approx(small / np.hypot(1.0, small), rel=1e-6, abs=2e-9)


def test_all_at_once_or_one_by_one():
    kinematics = cases.state(cases.home('hexapod_8')).nominal
    for size in (1, 2, 3):
        sets = np.array(list(combinations(range(8), size)))
        for many, one in (
            (position_measures, defined.position_measure),
            (torque_measures, defined.torque_measure),
        ):
            expected = [one(kinematics, chosen) for chosen in sets.tolist()]
            np.testing.assert_allclose(many(kinematics, sets), expected, atol=1e-12)


def test_a_thousand_struts_in_bounded_memory():
    """499 500 pairs: a list of them alone would not fit into this."""
    state = cases.state(home_configuration(evenly_spaced_mirror(1000)))
    tracemalloc.start()
    try:
        position, torque = pair_measures(state.present)
        ahead = defined.next_failure(state)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 100e6
    np.testing.assert_allclose(ahead.position, 1.0 / np.sqrt(3.0), atol=1e-12)
    np.testing.assert_allclose(ahead.torque, np.sqrt(0.997), atol=1e-12)
    for pair in [(0, 1), (0, 2), (3, 503), (17, 900), (998, 999)]:
        for found, measure in (
            (position, defined.position_measure), (torque, defined.torque_measure)
        ):
            expected = measure(state.present, pair)
            assert found[pair] == pytest.approx(expected, abs=EXACT)
    for place in (0, 1, 499, 999):
        name = state.rows.mechanism.strut_names[place]
        further = state.failures.and_also(state.rows.mechanism, Failure(FailureMode.HARD, name))
        after = differential_kinematics(state.rows, further)
        expected = defined.hard_measure(state.present, after)
        assert ahead.hard[place] == pytest.approx(expected, abs=EXACT)
