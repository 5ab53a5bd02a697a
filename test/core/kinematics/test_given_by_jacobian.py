# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A mechanism of which only J and T are known does as the same one with struts."""

import numpy as np
import pytest
from core import cases
from core.mechanisms import by_numbers, made

from fault_tolerance.kinematics.measures import next_failure, present_measures
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.configuration import home_configuration

FAILURES = [
    [],
    [('stuck', 'theta_4')],
    [('free', 'theta_2')],
    [('stuck', 'theta_1'), ('free', 'theta_3')],
    [('stuck', 'theta_1'), ('stuck', 'theta_4')],
    [('free', 'theta_1'), ('free', 'theta_2')],
    [('stuck', name) for name in ('theta_1', 'theta_2', 'theta_3', 'theta_4')],
    [('free', name) for name in ('theta_1', 'theta_2', 'theta_3', 'theta_4')],
]


def numbers(scale=1.0):
    document = by_numbers()
    document['jacobian'] = [[scale * value for value in row] for row in document['jacobian']]
    return home_configuration(made(document))


@pytest.mark.parametrize('failures', FAILURES)
def test_as_the_mirror_it_stands_for(failures):
    ours = cases.state(numbers(), failures)
    struts = cases.state(cases.home('fsm_4_strut'), failures)
    assert (ours.verdict.stable, ours.verdict.tolerable) == (
        struts.verdict.stable, struts.verdict.tolerable)
    np.testing.assert_allclose(
        ours.present.mapping @ ours.present.mapping.T,
        struts.present.mapping @ struts.present.mapping.T, atol=1e-12)
    np.testing.assert_allclose(
        ours.present.jacobian @ ours.present.mapping.T,
        struts.present.jacobian @ struts.present.mapping.T, atol=1e-12)
    assert ours.verdict.lost == struts.verdict.lost
    found, expected = present_measures(ours), present_measures(struts)
    for name in ('position', 'torque', 'retained_manipulability', 'smallest_singular_value'):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=1e-12)
    ahead = next_failure(ours)
    assert ahead.hard.shape == (0,)
    np.testing.assert_allclose(ahead.position, next_failure(struts).position, atol=1e-12)
    np.testing.assert_allclose(ahead.torque, next_failure(struts).torque, atol=1e-12)


@pytest.mark.parametrize('scale', [1e-12, 1e-3, 1e6, 1e10])
@pytest.mark.parametrize('failures', FAILURES[:6])
def test_whatever_the_units_of_the_task(scale, failures):
    """Microradians per metre as well as radians per millimetre."""
    plain, scaled = cases.state(numbers(), failures), cases.state(numbers(scale), failures)
    assert scaled.verdict == plain.verdict
    if not plain.verdict.stable:
        return  # what nobody drives is then chosen by length, and lengths go by the unit
    np.testing.assert_allclose(
        scaled.present.jacobian @ scaled.present.mapping.T / scale,
        plain.present.jacobian @ plain.present.mapping.T, atol=1e-12)
    assert present_measures(scaled).position == pytest.approx(
        present_measures(plain).position, abs=1e-12)
    np.testing.assert_allclose(
        next_failure(scaled).position, next_failure(plain).position, atol=1e-12)


def test_more_reduced_rates_than_task_coordinates():
    """Self-motion: three joints, one coordinate."""
    mechanism = made({
        'mechanism': 'arm', 'task': {'coordinates': ['vx']}, 'actuators': ['a', 'b', 'c'],
        'jacobian': [[1, 2, 2]], 'mapping': np.eye(3).tolist(),
    })
    home = home_configuration(mechanism)
    assert cases.state(home).verdict.mobility == 3
    np.testing.assert_allclose(
        next_failure(cases.state(home)).position, np.sqrt([8, 5, 5]) / 3.0, atol=1e-12)
    two = cases.state(home, [('stuck', 'a'), ('stuck', 'b')])
    assert two.verdict.tolerable
    assert present_measures(two).position == pytest.approx(2.0 / 3.0)
    assert not cases.state(home, [('stuck', name) for name in 'abc']).verdict.tolerable


def test_a_jacobian_that_says_nothing():
    mechanism = made({
        'mechanism': 'idle', 'task': {'coordinates': ['vx']}, 'actuators': ['a', 'b'],
        'jacobian': [[0]], 'mapping': [[1], [1]],
    })
    state = cases.state(home_configuration(mechanism))
    assert state.verdict.stable and not state.verdict.tolerable
    assert state.verdict.mobility == 1
    assert np.isfinite(next_failure(state).position).all()


def test_one_drive():
    mechanism = made({
        'mechanism': 'one', 'task': {'coordinates': ['vx']}, 'actuators': ['a'],
        'jacobian': [[2]], 'mapping': [[5]],
    })
    home = home_configuration(mechanism)
    assert np.abs(cases.state(home).nominal.jacobian) == pytest.approx(2.0 / 5.0)
    assert not cases.state(home, [('stuck', 'a')]).verdict.tolerable
    free = cases.state(home, [('free', 'a')])
    assert (free.verdict.stable, free.verdict.drifting) == (False, ('vx',))


def test_rows_say_what_the_numbers_say():
    mechanism = made(by_numbers())
    rows, point = home_rows(mechanism), mechanism.working_point
    assert rows.structure.shape == (0, 3)
    twists, rates = rows.given
    np.testing.assert_allclose(twists / rows.twist_scale[:, None], point.jacobian, atol=1e-15)
    np.testing.assert_allclose(rates, point.mapping, atol=1e-15)
