# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Measures of many failures at once are what the definitions say, one by one; Theorems 2 and 4."""

import tracemalloc
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from core import cases
from core.mechanisms import by_numbers, even_mirror, made, planar_4rpr, scaled
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.kinematics import measures as defined
from fault_tolerance.kinematics.actuator_measures import (
    pair_measures,
    position_measures,
    single_measures,
    torque_measures,
)
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import Failure, FailureMode
from fault_tolerance.kinematics.measures import hard_measures
from fault_tolerance.kinematics.paper_formulas import (
    position_measure_by_theorem_2,
    torque_measure_by_theorem_4,
)
from fault_tolerance.kinematics.subspaces import manipulability, singular_values
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
            assert found[first, second] == pytest.approx(expected, rel=EXACT, abs=1e-14)
            assert found[second, first] == found[first, second]
            assert (found[first, second] == 0.0) == (expected == 0.0)


def assert_as_defined(state):
    kinematics, mechanism = state.present, state.rows.mechanism
    position, torque = single_measures(kinematics)
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
    hard = hard_measures(state)
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


def test_given_by_its_jacobian_there_is_no_hard_measure():
    state = cases.state(home_configuration(made(by_numbers())))
    assert_as_defined(state)
    assert hard_measures(state).size == 0


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


SMALL = (0.0, 1e-13, 1e-11, 1e-8, 3e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.3)


def near_degenerate(name, mobility, count, rng):
    """Return random kinematics in which much nearly vanishes, and the condition number of J_m."""
    rows = rng.normal(size=(count, mobility))
    few = np.concatenate([SMALL, np.ones(12)])
    rows *= rng.choice(few, size=count)[:, None]
    if rng.random() < 0.5:  # two drives that do nearly the same
        one, other = rng.choice(count, 2, replace=False)
        rows[one] = rng.choice([-1.0, 0.4]) * rows[other] + rng.choice(SMALL) * rows[one]
    if rng.random() < 0.5:  # one that is nearly alone with a motion
        rows[:, 0] *= rng.choice(SMALL)
        rows[rng.integers(count), 0] = 1.0
    mapping, _ = np.linalg.qr(rows)
    base = cases.state(cases.home(name)).nominal
    jacobian = rng.normal(size=(len(base.jacobian), mobility))
    major = jacobian[base.task.major_rows]
    if rng.random() < 0.5:  # a drive that the task needs
        major[0] = mapping[rng.integers(count)] + rng.choice(SMALL) * major[0]
    if rng.random() < 0.5:  # two
        major[-1] = mapping[rng.integers(count)] + rng.choice(SMALL) * major[-1]
    if rng.random() < 0.2:
        major[0] = major[-1] + rng.choice(SMALL) * major[0]
    jacobian[base.task.major_rows] = major
    active = np.ones(count, dtype=bool)
    sigma = singular_values(major)
    condition = sigma[0] / max(sigma[-1], 1e-9 * sigma[0]) if len(sigma) else 1.0
    return replace(base, mapping=mapping, jacobian=jacobian, active=active), condition


def sharpness(kinematics, chosen):
    """Return the smallest singular value that counts of the rows of T that are chosen."""
    sigma = singular_values(kinematics.mapping[list(chosen)])
    return min(sigma[sigma > 1e-9], default=1.0)


@pytest.mark.parametrize('name', ['fsm_4_strut', 'gough_stewart_8'])
@pytest.mark.parametrize('beyond', [0, 1, 2, 3])
@pytest.mark.parametrize('redundant', [0, 1, 2, 3])
def test_next_to_zero_as_defined(name, beyond, redundant):
    """All kinds of redundancy, of drives and of freedom; measures down to 1e-8 and below."""
    rng = np.random.default_rng([beyond, redundant])
    mobility = len(cases.named(name).task.major) + beyond
    for _ in range(25):
        kinematics, condition = near_degenerate(name, mobility, mobility + redundant, rng)
        pairs = pair_measures(kinematics)
        for values, single in zip(pairs, single_measures(kinematics), strict=True):
            np.testing.assert_array_equal(values, values.T)
            np.testing.assert_array_equal(values.diagonal(), single)
        places = range(len(kinematics.active))
        for chosen in (*((place, place) for place in places), *combinations(places, 2)):
            failed = sorted(set(chosen))
            expected = defined.torque_measure(kinematics, failed)
            assert pairs.torque[chosen] == pytest.approx(expected, rel=EXACT, abs=1e-14)
            assert (pairs.torque[chosen] == 0.0) == (expected == 0.0)
            expected = defined.position_measure(kinematics, failed)
            # Directions are known no better than this, by whatever formula.
            known = 1e-14 * condition / sharpness(kinematics, failed)
            assert pairs.position[chosen] == pytest.approx(expected, rel=EXACT, abs=known)
            assert (pairs.position[chosen] == 0.0) == (expected == 0.0)


def test_a_drive_that_moves_nothing_and_one_that_has_failed():
    kinematics, _ = near_degenerate('gough_stewart_8', 7, 8, np.random.default_rng(1))
    mapping = np.vstack([np.zeros((2, 7)), kinematics.mapping])
    active = np.arange(10) > 0
    kinematics = replace(kinematics, mapping=mapping, active=active)
    position, torque = pair_measures(kinematics)
    assert position[1, 1] == torque[1, 1] == 1.0
    assert_pairs_as_defined(kinematics, (position, torque))


def test_nothing_is_tolerable_where_j_is_singular():
    kinematics, _ = near_degenerate('gough_stewart_8', 4, 6, np.random.default_rng(1))
    np.testing.assert_array_equal(pair_measures(kinematics).position, 0.0)


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


PLACES = [(name, place) for name in cases.NAMES for place in ('home', 'away')
          if place == 'home' or name in cases.RIGID]
everywhere = pytest.mark.parametrize(('name', 'place'), PLACES)


def states(name, place, most=12):
    """Yield the kinematics with no failure, and with some."""
    configuration = {'home': cases.home, 'away': cases.away}[place](name)
    for failures in cases.failure_lists(configuration.mechanism, most):
        yield cases.state(configuration, failures).present


def has_full_major_rank(kinematics):
    """Tell whether J_m has rank m, beyond any doubt; eq. 17 and the p of eq. 21 need it."""
    sizes = singular_values(kinematics.major)
    return len(sizes) == len(kinematics.major) and sizes[-1] > 1e-3 * sizes[0]


def driving(kinematics):
    return [int(index) for index in np.flatnonzero(kinematics.active)]


@everywhere
def test_theorems_2_and_4_for_any_subset(name, place):
    rng = np.random.default_rng(0)
    for kinematics in states(name, place):
        active = driving(kinematics)
        for size in range(1, min(4, len(active)) + 1):
            failed = [int(index) for index in rng.choice(active, size, replace=False)]
            assert torque_measure_by_theorem_4(kinematics.mapping, failed) == pytest.approx(
                defined.torque_measure(kinematics, failed), abs=EXACT)
            if has_full_major_rank(kinematics):
                by_theorem = position_measure_by_theorem_2(
                    kinematics.major, kinematics.mapping, failed)
                expected = defined.position_measure(kinematics, failed)
                assert by_theorem == pytest.approx(expected, abs=EXACT)


def test_the_cases_hold_every_relation_of_task_and_freedom():
    sizes = set()
    for name, place in PLACES:
        kinematics = next(states(name, place, 0))
        (task, freedom), major = kinematics.jacobian.shape, len(kinematics.major)
        sizes.add((np.sign(task - freedom), np.sign(task - major)))
    assert {(-1, 0), (-1, 1), (0, 0), (0, 1)} <= sizes  # l < n, m < l, and both not


def test_t_is_a_ratio_of_manipulabilities_only_while_j_has_full_column_rank():
    document = even_mirror(4)
    mirror = home_configuration(made(document))
    document['task'] = {'coordinates': ['wx']}
    of_one_coordinate = home_configuration(made(document))
    freed = [('torque', 'theta_2')]

    state = cases.state(mirror, freed)
    ratio = manipulability(state.nominal.jacobian, 3) / manipulability(state.present.jacobian, 3)
    assert ratio == pytest.approx(0.5)
    assert defined.torque_measure(state.nominal, [1]) == pytest.approx(0.5)

    # The one row of the task does not see what the free drive costs in the others.
    state = cases.state(of_one_coordinate, freed)
    ratio = manipulability(state.nominal.jacobian, 1) / manipulability(state.present.jacobian, 1)
    assert ratio == pytest.approx(3.0**-0.5)
    assert defined.torque_measure(state.nominal, [1]) == pytest.approx(0.5)


def test_p_of_dependent_failures_counts_their_rank():
    # Opposite struts of the plane: both rows of T alone would make a quotient of zeros.
    kinematics = cases.state(home_configuration(evenly_spaced_mirror(4))).nominal
    doubled = replace(
        kinematics,
        mapping=kinematics.mapping[[0, 0, 1, 2, 3]] * np.sqrt([[0.5], [0.5], [1], [1], [1]]),
        active=np.ones(5, dtype=bool),
    )
    expected = defined.position_measure(doubled, [0])
    assert expected > 0.5
    assert defined.position_measure(doubled, [0, 1]) == pytest.approx(expected)
    assert position_measure_by_theorem_2(doubled.major, doubled.mapping, [0, 1]) == pytest.approx(
        expected)
    assert pair_measures(doubled).position[0, 1] == pytest.approx(expected)


@pytest.mark.parametrize('factors', [(3.0, 3.0), (1e-3, 1e-3), (0.2, 7.0)])
def test_scaling_the_rows_of_j_leaves_p(factors):
    for name in ('fsm_4_strut', 'planar_4rpr', 'serial_3r'):
        kinematics = cases.state(cases.home(name)).nominal
        factor = np.ones(len(kinematics.jacobian))
        factor[kinematics.task.major_rows] = factors
        other = replace(kinematics, jacobian=factor[:, None] * kinematics.jacobian)
        for failed in ([0], [1], [0, 1]):
            assert defined.position_measure(other, failed) == pytest.approx(
                defined.position_measure(kinematics, failed), abs=1e-12)


@pytest.mark.parametrize('size', [1e-3, 250.0])
@pytest.mark.parametrize('document', [even_mirror(4), planar_4rpr()], ids=['mirror', 'planar'])
def test_the_size_of_the_machine_leaves_all_measures(document, size):
    measures = [
        single_measures(cases.state(home_configuration(made(each))).nominal)
        for each in (document, scaled(document, size))
    ]
    np.testing.assert_allclose(measures[0], measures[1], atol=1e-9)


@pytest.mark.parametrize('count', range(3, 41))
def test_evenly_spaced_mirrors(count):
    kinematics = cases.state(home_configuration(evenly_spaced_mirror(count))).nominal
    position, torque = single_measures(kinematics)
    np.testing.assert_allclose(position, 1.0 / np.sqrt(3.0), atol=1e-12)
    np.testing.assert_allclose(torque, np.sqrt((count - 3) / count), atol=1e-9)
