# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's remarks on Theorem 1: what each kind of manipulator is called."""

import pytest
from core import cases

from fault_tolerance.kinematics.classification import (
    KINEMATICALLY_REDUNDANT,
    OVER_CONSTRAINED,
    UNDER_CONSTRAINED,
    Redundancy,
    classification,
    redundancy,
)
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows


@pytest.mark.parametrize(('name', 'failures', 'expected'), [
    ('fsm_3_strut', [], ()),
    ('gough_stewart_6', [], ()),
    ('serial_3r', [], ()),
    ('fsm_4_strut', [], (KINEMATICALLY_REDUNDANT,)),
    ('fsm_overactuated', [], (KINEMATICALLY_REDUNDANT,)),
    ('fsm_3_strut', ['position:theta_1'], (OVER_CONSTRAINED,)),
    ('fsm_4_strut', ['position:theta_1'], (OVER_CONSTRAINED, KINEMATICALLY_REDUNDANT)),
    ('fsm_3_strut', ['torque:theta_1'], (UNDER_CONSTRAINED,)),
    ('fsm_3_strut', ['hard:strut_1'], (UNDER_CONSTRAINED,)),
    ('fsm_4_strut', ['torque:theta_1'], ()),
    ('fsm_4_strut', ['torque:theta_1', 'position:theta_2'], (OVER_CONSTRAINED,)),
    ('fsm_4_strut', ['hard:strut_1', 'torque:theta_2'], (UNDER_CONSTRAINED,)),
    ('serial_3r', ['position:joint_2'], (OVER_CONSTRAINED,)),
    ('serial_3r', ['torque:joint_2'], (UNDER_CONSTRAINED,)),
    # Gaining a freedom that the drives control is nothing bad.
    ('fsm_overactuated', ['hard:strut_2'], ()),
])
def test_names(name, failures, expected):
    pairs = [failure.split(':') for failure in failures]
    assert classification(cases.state(cases.home(name), pairs)) == expected


@pytest.mark.parametrize('name', cases.NAMES)
def test_names_agree_with_the_kinematics_they_describe(name):
    configuration = cases.home(name)
    for failures in cases.failure_lists(configuration.mechanism):
        state = cases.state(configuration, failures)
        names = classification(state)
        assert (UNDER_CONSTRAINED in names) is not state.verdict.stable
        spare = int(state.present.active.sum()) - state.present.mobility
        assert (KINEMATICALLY_REDUNDANT in names) is (spare > 0)
        if not any(mode == 'position' for mode, _ in failures):
            assert OVER_CONSTRAINED not in names


def test_off_home_a_rigid_four_strut_mirror_has_fewer_freedoms_than_at_home():
    mechanism = cases.named('fsm_4_strut')
    home = differential_kinematics(home_rows(mechanism).with_compliance(0.0))
    rows = strut_rows(cases.tilted('fsm_4_strut', 0.02, 0.02))
    rigid = reconfigured(rows.with_compliance(0.0))
    assert OVER_CONSTRAINED in classification(rigid, home)
    assert OVER_CONSTRAINED not in classification(rigid)
    assert OVER_CONSTRAINED not in classification(reconfigured(rows), home)


def struts(*numbers):
    return tuple(f'strut_{number}' for number in numbers)


@pytest.mark.parametrize(('name', 'failures', 'expected'), [
    ('fsm_3_strut', [], Redundancy(0, 1, (), ())),
    ('fsm_4_strut', [], Redundancy(1, 1, struts(1, 2, 3, 4), ())),
    ('fsm_4_strut', ['hard:strut_2'], Redundancy(0, 1, (), ())),
    ('fsm_4_strut', ['position:theta_1'], Redundancy(1, 0, struts(2, 3, 4), ())),
    ('fsm_4_strut', ['position:theta_1', 'position:theta_2'],
     Redundancy(1, -1, struts(3, 4), ())),
    ('fsm_overactuated', [],
     Redundancy(2, 1, (), ('theta_1', 'theta_2', 'theta_3', 'theta_4', 'theta_5'))),
    ('fsm_overactuated', ['torque:theta_4', 'torque:theta_5'], Redundancy(0, 1, (), ())),
    ('gough_stewart_6', [], Redundancy(0, 1, (), ())),
    ('planar_4rpr', [], Redundancy(1, 1, struts(1, 2, 3, 4), ())),
    ('serial_7r', [], Redundancy(0, 4, (), ())),
])
def test_redundant_struts_and_overactuation(name, failures, expected):
    pairs = [failure.split(':') for failure in failures]
    assert redundancy(cases.state(cases.home(name), pairs)) == expected
