# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What holds exactly for every mechanism, tried on random ones."""

from itertools import combinations
from math import comb, sqrt

import numpy as np
import pytest
from core import cases
from core.mechanisms import made, ups_leg
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fault_tolerance.kinematics.actuator_measures import position_measure, torque_measure
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.measures import next_failure
from fault_tolerance.kinematics.paper_formulas import (
    after_position_failure,
    after_torque_failure,
    position_measure_by_theorem_2,
    torque_measure_by_theorem_4,
)
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.mechanism.configuration import home_configuration

COORDINATES = ['wx', 'wy', 'wz', 'vx', 'vy', 'vz']


def numbers(seed, serial=False):
    """Return a mechanism given by random J and T."""
    rng = np.random.default_rng(seed)
    mobility = int(rng.integers(1, 7))
    actuators = mobility if serial else mobility + int(rng.integers(0, 4))
    task = int(rng.integers(1, mobility + 1))
    major = int(rng.integers(1, task + 1))
    return made({
        'mechanism': 'random',
        'task': {'coordinates': COORDINATES[:task], 'major': COORDINATES[:major]},
        'actuators': [f'a{index}' for index in range(actuators)],
        'jacobian': rng.normal(size=(task, mobility)).tolist(),
        'mapping': np.linalg.qr(rng.normal(size=(actuators, mobility)))[0].tolist(),
    })


def platform(seed):
    """Return a platform on six to nine struts anywhere, two coordinates of its task secondary."""
    rng = np.random.default_rng(seed)
    struts = [
        ups_leg(index + 1, [*rng.uniform(-1, 1, 2), 0.0], [*rng.uniform(-0.7, 0.7, 2), 1.0])
        for index in range(int(rng.integers(6, 10)))
    ]
    return made({
        'mechanism': 'platform',
        'platform': {'origin': rng.uniform(-0.2, 0.2, 3).tolist()},
        'task': {'coordinates': COORDINATES, 'major': COORDINATES[2:]},
        'struts': struts,
    })


kinds = st.sampled_from([numbers, platform])
seeds = st.integers(0, 2**32 - 1)


def nominal_of(mechanism):
    return reconfigured(strut_rows(home_configuration(mechanism))).nominal


@given(kinds, seeds)
@settings(max_examples=40, deadline=None)
def test_sum_of_torque_measures(kind, seed):
    """Over all sets of f: the sum of t^2 is C(N - n, f), for every f (paper (15) at f = N - n)."""
    nominal = nominal_of(kind(seed))
    count, mobility = nominal.mapping.shape
    for size in range(1, count - mobility + 1):
        sets = list(combinations(range(count), size))
        measures = np.array([torque_measure(nominal, chosen) for chosen in sets])
        total = comb(count - mobility, size)
        assert np.sum(measures**2) == pytest.approx(total, rel=1e-9)
        assert measures.min() <= sqrt(total / len(sets)) + 1e-12
        assert ((measures >= 0.0) & (measures <= 1.0 + 1e-12)).all()


@given(kinds, seeds)
@settings(max_examples=40, deadline=None)
def test_sum_of_position_measures(kind, seed):
    """Weighted by the volume of their rows: C(n - m, f), and the volumes themselves C(n, f)."""
    nominal = nominal_of(kind(seed))
    count, mobility = nominal.mapping.shape
    spare = mobility - len(nominal.major)
    assume(np.linalg.matrix_rank(nominal.major, 1e-6) == len(nominal.major))
    for size in range(1, min(spare, 3) + 1):
        sets = list(combinations(range(count), size))
        volumes = np.array([
            sqrt(max(np.linalg.det(rows @ rows.T), 0.0))
            for rows in (nominal.mapping[list(chosen)] for chosen in sets)
        ])
        measures = np.array([position_measure(nominal, chosen) for chosen in sets])
        assert np.sum(volumes**2) == pytest.approx(comb(mobility, size), rel=1e-9)
        total = comb(spare, size)
        assert np.sum(volumes**2 * measures**2) == pytest.approx(total, rel=1e-7)
        assert measures.min() <= sqrt(total / comb(mobility, size)) + 1e-9
        assert ((measures >= 0.0) & (measures <= 1.0 + 1e-9)).all()


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_sum_of_position_measures_of_serial_arms(seed):
    """T = I: Ukidve, McInroy and Jafari (2008)."""
    nominal = nominal_of(numbers(seed, serial=True))
    mobility, major = nominal.mobility, len(nominal.major)
    for size in range(1, min(mobility - major, 3) + 1):
        measures = [
            position_measure(nominal, chosen) for chosen in combinations(range(mobility), size)
        ]
        assert np.sum(np.square(measures)) == pytest.approx(comb(mobility - major, size), rel=1e-7)


@given(kinds, seeds)
@settings(max_examples=25, deadline=None)
def test_bounds_of_the_next_failure(kind, seed):
    ahead = next_failure(reconfigured(strut_rows(home_configuration(kind(seed)))))
    assert ahead.position.min() <= ahead.position_bound + 1e-9
    assert ahead.torque.min() <= ahead.torque_bound + 1e-9
    everything = np.concatenate([ahead.position, ahead.torque, ahead.hard])
    assert ahead.worst_measure == pytest.approx(everything.min(), abs=1e-9)


@given(kinds, seeds)
@settings(max_examples=40, deadline=None)
def test_the_papers_shortcuts(kind, seed):
    """Eqs. (6), (7), (9), (11), (12), (14) from J and T alone equal what the rows give."""
    mechanism = kind(seed)
    rows = strut_rows(home_configuration(mechanism))
    nominal = reconfigured(rows).nominal
    names = mechanism.actuator_names
    count, mobility = nominal.mapping.shape
    rng = np.random.default_rng(seed)
    chosen = rng.permutation(count)[: rng.integers(1, 4)].tolist()
    failed = [names[index] for index in chosen]
    same = {'rtol': 0.0, 'atol': 1e-9 * max(1.0, np.abs(nominal.jacobian).max())}
    assume(np.linalg.cond(nominal.major) < 1e4)

    jacobian, mapping = after_position_failure(nominal.jacobian, nominal.mapping, chosen)
    stuck = reconfigured(rows, failure_set(mechanism, [('stuck', name) for name in failed]))
    np.testing.assert_allclose(
        mapping @ mapping.T, stuck.present.mapping @ stuck.present.mapping.T, **same)
    np.testing.assert_allclose(
        jacobian @ mapping.T, stuck.present.jacobian @ stuck.present.mapping.T, **same)
    theorem = position_measure_by_theorem_2(nominal.major, nominal.mapping, chosen)
    assert theorem == pytest.approx(position_measure(nominal, chosen), abs=1e-8)

    free = reconfigured(rows, failure_set(mechanism, [('free', name) for name in failed]))
    theorem = torque_measure_by_theorem_4(nominal.mapping, chosen)
    assert theorem == pytest.approx(torque_measure(nominal, chosen), abs=1e-12)
    assert (theorem == 0.0) == (not free.verdict.stable)
    if theorem < 1e-4:
        return
    jacobian, mapping = after_torque_failure(nominal.jacobian, nominal.mapping, chosen)
    others = np.delete(np.arange(count), chosen)
    found = free.present.mapping[others]
    size = 1e-9 / theorem
    np.testing.assert_allclose(mapping @ mapping.T, found @ found.T, rtol=0.0, atol=size)
    np.testing.assert_allclose(
        jacobian @ mapping.T, free.present.jacobian @ found.T,
        rtol=0.0, atol=size * max(1.0, np.abs(jacobian).max()))
    if len(nominal.jacobian) == mobility:
        # (13): what free actuators add in manipulability.
        volumes = [np.prod(np.linalg.svd(each, compute_uv=False))
                   for each in (nominal.jacobian, free.present.jacobian)]
        assert theorem == pytest.approx(volumes[0] / volumes[1], rel=1e-6)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_struts_with_full_manipulability_are_lost_as_free(seed):
    """Paper, section III-E: each strut ends in six freedoms."""
    mechanism = platform(seed)
    rows = home_rows(mechanism)
    strut = mechanism.strut_names[seed % len(mechanism.struts)]
    lost = reconfigured(rows, failure_set(mechanism, [('lost', strut)])).present
    free = reconfigured(rows, failure_set(mechanism, [('free', strut)])).present
    assert lost.stable == free.stable
    if lost.stable:
        np.testing.assert_allclose(
            lost.mapping @ lost.mapping.T, free.mapping @ free.mapping.T, atol=1e-7)


@given(seeds, st.permutations(range(4)))
@settings(max_examples=25, deadline=None)
def test_the_order_of_failures_does_not_matter(seed, order):
    mechanism = platform(seed)
    rows = home_rows(mechanism)
    singles = cases.single_failures(mechanism)
    rng = np.random.default_rng(seed)
    failures = [singles[index] for index in rng.integers(0, len(singles), 4)]
    first = failure_set(mechanism, failures)
    second = failure_set(mechanism, [failures[index] for index in order])
    assert first == second and hash(first) == hash(second)
    one, other = reconfigured(rows, first), reconfigured(rows, second)
    assert one.verdict == other.verdict
    for name in ('jacobian', 'mapping', 'rate_map', 'unactuated'):
        np.testing.assert_array_equal(getattr(one.present, name), getattr(other.present, name))


@pytest.mark.parametrize('name', cases.NAMES)
def test_clearing_is_exact_to_the_last_bit(name):
    """However many failures came and went: nothing is chained."""
    configuration = cases.home(name) if name not in cases.RIGID else cases.away(name)
    mechanism, rows = configuration.mechanism, strut_rows(configuration)
    before = reconfigured(rows)
    failed = failure_set(mechanism, cases.failure_lists(mechanism, most=10)[-1])
    reconfigured(rows, failed)
    after = reconfigured(rows, failure_set(mechanism, [('ok', mechanism.actuator_names[0])]))
    for each in ('jacobian', 'mapping', 'twist_jacobian', 'rate_map', 'unactuated'):
        np.testing.assert_array_equal(getattr(after.present, each), getattr(before.nominal, each))
        np.testing.assert_array_equal(getattr(after.nominal, each), getattr(before.nominal, each))
    assert after.verdict == before.verdict
    assert after.present is after.nominal
