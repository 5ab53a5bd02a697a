# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Closed forms and Theorems 2 and 4 against the definitions, where their conditions hold."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from core import cases
from core.mechanisms import even_mirror, made, planar_4rpr, scaled

from fault_tolerance.kinematics.closed_form import closed_form_measures, single_measures
from fault_tolerance.kinematics.measures import position_measure, torque_measure
from fault_tolerance.kinematics.shortcuts import (
    position_measure_by_theorem_2,
    torque_measure_by_theorem_4,
)
from fault_tolerance.kinematics.subspaces import manipulability, singular_values
from fault_tolerance.mechanism.configuration import home_configuration
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

EXACT = 1e-9

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
def test_closed_forms_of_every_single_failure_and_pair(name, place):
    for kinematics in states(name, place):
        closed = closed_form_measures(kinematics)
        active = driving(kinematics)
        for measure in (closed.position, closed.torque):
            np.testing.assert_array_equal(np.isnan(measure), ~kinematics.active)
        for first, second in [*((one, one) for one in active), *combinations(active, 2)]:
            failed = [first] if first == second else [first, second]
            # Closed forms subtract from 1, so that squares are what can be compared.
            assert closed.torque_pairs[first, second] ** 2 == pytest.approx(
                torque_measure(kinematics, failed) ** 2, abs=EXACT)
            assert closed.torque_pairs[second, first] == closed.torque_pairs[first, second]
            if has_full_major_rank(kinematics):
                assert closed.position_pairs[first, second] ** 2 == pytest.approx(
                    position_measure(kinematics, failed) ** 2, abs=EXACT)


@everywhere
def test_theorems_2_and_4_for_any_subset(name, place):
    rng = np.random.default_rng(0)
    for kinematics in states(name, place):
        active = driving(kinematics)
        for size in range(1, min(4, len(active)) + 1):
            failed = [int(index) for index in rng.choice(active, size, replace=False)]
            assert torque_measure_by_theorem_4(kinematics.mapping, failed) == pytest.approx(
                torque_measure(kinematics, failed), abs=EXACT)
            if has_full_major_rank(kinematics):
                by_theorem = position_measure_by_theorem_2(
                    kinematics.major, kinematics.mapping, failed)
                expected = position_measure(kinematics, failed)
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
    assert torque_measure(state.nominal, [1]) == pytest.approx(0.5)

    # The one row of the task does not see what the free drive costs in the others.
    state = cases.state(of_one_coordinate, freed)
    ratio = manipulability(state.nominal.jacobian, 1) / manipulability(state.present.jacobian, 1)
    assert ratio == pytest.approx(3.0**-0.5)
    assert torque_measure(state.nominal, [1]) == pytest.approx(0.5)


def test_p_of_dependent_failures_counts_their_rank():
    # Opposite struts of the plane: both rows of T alone would make a quotient of zeros.
    kinematics = cases.state(home_configuration(evenly_spaced_mirror(4))).nominal
    doubled = replace(
        kinematics,
        mapping=kinematics.mapping[[0, 0, 1, 2, 3]] * np.sqrt([[0.5], [0.5], [1], [1], [1]]),
        active=np.ones(5, dtype=bool),
    )
    expected = position_measure(doubled, [0])
    assert expected > 0.5
    assert position_measure(doubled, [0, 1]) == pytest.approx(expected)
    assert position_measure_by_theorem_2(doubled.major, doubled.mapping, [0, 1]) == pytest.approx(
        expected)
    assert closed_form_measures(doubled).position_pairs[0, 1] == pytest.approx(expected)


@pytest.mark.parametrize('factors', [(3.0, 3.0), (1e-3, 1e-3), (0.2, 7.0)])
def test_scaling_the_rows_of_j_leaves_p(factors):
    for name in ('fsm_4_strut', 'planar_4rpr', 'serial_3r'):
        kinematics = cases.state(cases.home(name)).nominal
        factor = np.ones(len(kinematics.jacobian))
        factor[kinematics.task.major_rows] = factors
        other = replace(kinematics, jacobian=factor[:, None] * kinematics.jacobian)
        for failed in ([0], [1], [0, 1]):
            assert position_measure(other, failed) == pytest.approx(
                position_measure(kinematics, failed), abs=1e-12)


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
    np.testing.assert_allclose(torque, np.sqrt((count - 3) / count), atol=1e-7)


def test_a_thousand_struts():
    kinematics = cases.state(home_configuration(evenly_spaced_mirror(1000))).nominal
    position, torque = single_measures(kinematics)
    np.testing.assert_allclose(position, 1.0 / np.sqrt(3.0), atol=1e-12)
    np.testing.assert_allclose(torque, np.sqrt(0.997), atol=1e-12)
    pairs = closed_form_measures(kinematics)
    assert pairs.torque_pairs.shape == (1000, 1000)
    # Neighbours are almost the same drive, so the quotient is that of two small numbers: rounding
    # of 1e-16 over a determinant of 4e-5, under a root.
    expected = position_measure(kinematics, [0, 1])
    assert pairs.position_pairs[0, 1] == pytest.approx(expected, abs=1e-5)
