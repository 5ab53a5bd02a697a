# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's shortcuts (6), (7), (11), (12) against the moved rows."""

import numpy as np
import pytest
from core import cases

from fault_tolerance.kinematics.actuator_measures import position_measure, torque_measure
from fault_tolerance.kinematics.paper_formulas import after_position_failure, after_torque_failure

PLACES = [(name, place) for name in cases.NAMES for place in ('home', 'away')
          if place == 'home' or name in cases.RIGID]
everywhere = pytest.mark.parametrize(('name', 'place'), PLACES)
# What J and T have that does not depend on the choice of their columns.
SAME = {'rtol': 0.0, 'atol': 1e-9}


def configuration_of(name, place):
    return {'home': cases.home, 'away': cases.away}[place](name)


def subsets(count, rng, most=12):
    """Return all single places and some pairs and triples."""
    chosen = [[index] for index in range(count)]
    for size in (2, 3):
        if size < count:
            chosen += [sorted(rng.choice(count, size, replace=False).tolist())
                       for _ in range(most)]
    return chosen


@everywhere
def test_stuck_actuators(name, place):
    configuration = configuration_of(name, place)
    names = configuration.mechanism.actuator_names
    nominal = cases.state(configuration).nominal
    for stuck in subsets(len(names), np.random.default_rng(1)):
        jacobian, mapping = after_position_failure(nominal.jacobian, nominal.mapping, stuck)
        present = cases.state(
            configuration, [('position', names[index]) for index in stuck]).present
        np.testing.assert_allclose(mapping[stuck], 0.0, atol=1e-9)
        np.testing.assert_allclose(
            mapping @ mapping.T, present.mapping @ present.mapping.T, **SAME)
        if nominal.stable:
            size = max(1.0, np.abs(nominal.jacobian).max(initial=0.0))
            np.testing.assert_allclose(
                jacobian @ mapping.T / size, present.jacobian @ present.mapping.T / size, **SAME)
        np.testing.assert_allclose(mapping.T @ mapping, np.eye(mapping.shape[1]), **SAME)


@everywhere
def test_free_actuators_while_the_platform_is_held(name, place):
    configuration = configuration_of(name, place)
    names = configuration.mechanism.actuator_names
    nominal = cases.state(configuration).nominal
    for free in subsets(len(names), np.random.default_rng(2)):
        if torque_measure(nominal, free) < 1e-3:  # (12) needs T_r of full column rank
            continue
        jacobian, mapping = after_torque_failure(nominal.jacobian, nominal.mapping, free)
        present = cases.state(
            configuration, [('torque', names[index]) for index in free]).present
        active = present.mapping[present.active]
        size = max(1.0, np.abs(jacobian).max())
        np.testing.assert_allclose(mapping @ mapping.T, active @ active.T, **SAME)
        np.testing.assert_allclose(
            jacobian @ mapping.T / size, present.jacobian @ active.T / size, **SAME)


def test_a_mixture_is_one_after_the_other():
    configuration = cases.home('fsm_4_strut')
    nominal = cases.state(configuration).nominal
    jacobian, mapping = after_position_failure(nominal.jacobian, nominal.mapping, [3])
    jacobian, mapping = after_torque_failure(jacobian, mapping, [1, 3])
    state = cases.state(configuration, [('torque', 'theta_2'), ('position', 'theta_4')])
    active = state.present.mapping[state.present.active]
    np.testing.assert_allclose(mapping @ mapping.T, active @ active.T, atol=1e-12)
    np.testing.assert_allclose(
        jacobian @ mapping.T, state.present.jacobian @ active.T, atol=1e-12)


def test_what_the_remaining_drives_do_not_hold_has_no_column():
    nominal = cases.state(cases.home('fsm_3_strut')).nominal
    jacobian, mapping = after_torque_failure(nominal.jacobian, nominal.mapping, [0])
    assert jacobian.shape == (3, 2)
    assert mapping.shape == (2, 2)


def test_the_worked_example_of_the_paper():
    # Section IV: theta_4 stuck, theta_4 free.
    nominal = cases.state(cases.home('fsm_4_strut')).nominal
    _, mapping = after_position_failure(nominal.jacobian, nominal.mapping, [3])
    expected = np.array([[2, 1, -1, 0], [1, 2, 1, 0], [-1, 1, 2, 0], [0, 0, 0, 0]]) / 3.0
    np.testing.assert_allclose(mapping @ mapping.T, expected, atol=1e-12)
    assert position_measure(nominal, [3]) == pytest.approx(3.0**-0.5)
    _, mapping = after_torque_failure(nominal.jacobian, nominal.mapping, [3])
    np.testing.assert_allclose(mapping @ mapping.T, np.eye(3), atol=1e-12)
    assert torque_measure(nominal, [3]) == pytest.approx(0.5)
