# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""How many more can fail, and when losing a strut is as freeing its drives."""

from itertools import combinations

import numpy as np
import pytest
from core import cases

from fault_tolerance.kinematics.failure_budget import (
    FailureBudget,
    failure_budget,
    hard_torque_equivalence,
)
from fault_tolerance.kinematics.failures import Failure, FailureMode, failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import strut_rows

POSITION, TORQUE, HARD = FailureMode.POSITION, FailureMode.TORQUE, FailureMode.HARD


def counted(state, mode):
    """Return how many more failures any, and some, set may have: every set is tried."""
    mechanism = state.rows.mechanism
    names = mechanism.strut_names
    if mode is not HARD:
        names = [name for name, drives in zip(
            mechanism.actuator_names, state.present.active, strict=True) if drives]
    names = [name for name in names if name not in state.failures.lost]
    guaranteed, best_case = [], []
    for size in range(len(names) + 1):
        verdicts = [
            reconfigured(state.rows, state.failures.and_also(
                mechanism, *(Failure(mode, name) for name in chosen))).verdict.tolerable
            for chosen in combinations(names, size)
        ]
        guaranteed.append(all(verdicts))
        best_case.append(any(verdicts))
    first = [*guaranteed, False].index(False), [*best_case, False].index(False)
    return max(first[0] - 1, 0), max(first[1] - 1, 0)


@pytest.mark.parametrize(('name', 'mode', 'guaranteed', 'best_case'), [
    ('fsm_3_strut', POSITION, 1, 1),
    ('fsm_3_strut', TORQUE, 0, 0),
    ('fsm_3_strut', HARD, 0, 0),
    ('fsm_4_strut', POSITION, 1, 1),
    ('fsm_4_strut', TORQUE, 1, 1),
    ('fsm_4_strut', HARD, 1, 1),
    ('fsm_overactuated', POSITION, 0, 1),
    ('fsm_overactuated', TORQUE, 1, 2),
    ('fsm_overactuated', HARD, 0, 1),
    ('gough_stewart_6', POSITION, 1, 1),
    ('gough_stewart_6', TORQUE, 0, 0),
])
def test_the_papers_mirrors_and_a_hexapod(name, mode, guaranteed, best_case):
    state = cases.state(cases.home(name))
    assert failure_budget(state, mode) == FailureBudget(guaranteed, best_case, True)


@pytest.mark.parametrize('mode', [POSITION, TORQUE, HARD])
@pytest.mark.parametrize('name', [
    'fsm_overactuated', 'fsm_4_strut', 'planar_4rpr', 'serial_3r', 'uneven_mirror',
    'guided_mirror', 'two_stage_mirror', 'bennett'])
def test_every_set_counted(name, mode):
    configuration = cases.home(name) if name == 'fsm_4_strut' else cases.away(name)
    for failures in cases.failure_lists(configuration.mechanism, 6):
        state = cases.state(configuration, failures)
        found = failure_budget(state, mode)
        assert found.complete
        if not state.verdict.tolerable:
            assert (found.guaranteed, found.best_case) == (0, 0)
            continue
        assert (found.guaranteed, found.best_case) == counted(state, mode), failures


def test_an_unfinished_count_says_so():
    state = cases.state(cases.home('hexapod_8'))
    whole = failure_budget(state, TORQUE)
    assert whole.complete
    assert whole.guaranteed >= 1
    assert failure_budget(state, TORQUE, 3) == FailureBudget(0, 0, False)
    some = failure_budget(state, TORQUE, 8)
    assert some == FailureBudget(1, 1, False)


def same_kinematics(first, second):
    """Tell whether two models are the same up to the choice of columns."""
    if first.mobility != second.mobility or first.stable != second.stable:
        return False
    if not first.stable:
        return first.unactuated.shape == second.unactuated.shape
    pairs = [
        (first.mapping @ first.mapping.T, second.mapping @ second.mapping.T),
        (first.jacobian @ first.mapping.T, second.jacobian @ second.mapping.T),
    ]
    return all(np.allclose(one, other, rtol=1e-7, atol=1e-7) for one, other in pairs)


PLACES = [(name, place) for name in cases.NAMES for place in ('home', 'away')
          if place == 'home' or name in cases.RIGID]


@pytest.mark.parametrize(('name', 'place'), PLACES)
def test_equivalence_is_the_same_kinematics(name, place):
    configuration = {'home': cases.home, 'away': cases.away}[place](name)
    mechanism = configuration.mechanism
    for entry in hard_torque_equivalence(strut_rows(configuration)):
        lost = cases.state(configuration, [('hard', entry.strut)])
        free = cases.state(
            configuration,
            [('torque', name) for name in mechanism.actuators_of(entry.strut)])
        same = same_kinematics(lost.present, free.present)
        if entry.equivalent:
            assert same, entry
        elif lost.verdict.stable:
            assert not same, entry


@pytest.mark.parametrize(('name', 'place', 'reason'), [
    ('gough_stewart_6', 'home', 'its end has full manipulability'),
    ('hexapod_8', 'away', 'its end has full manipulability'),
    ('fsm_4_strut', 'home', 'what it bars is barred by the others too'),
    ('planar_4rpr', 'away', 'what it bars is barred by the others too'),
])
def test_where_it_holds_and_why(name, place, reason):
    configuration = {'home': cases.home, 'away': cases.away}[place](name)
    found = hard_torque_equivalence(strut_rows(configuration))
    assert [entry.strut for entry in found] == list(configuration.mechanism.strut_names)
    assert {(entry.equivalent, entry.reason) for entry in found} == {(True, reason)}


def test_where_it_does_not_hold():
    found = hard_torque_equivalence(strut_rows(cases.home('fsm_overactuated')))
    assert {entry.reason for entry in found} == {
        'without it the structure allows 1 more degree of freedom'}
    assert not any(entry.equivalent for entry in found)


def test_with_a_strut_lost_the_others_bar_what_is_left():
    # At home any three hinges of four bar three directions; of three, each bars its own.
    configuration = cases.home('fsm_4_strut')
    lost = failure_set(configuration.mechanism, [('hard', 'strut_2')])
    found = hard_torque_equivalence(strut_rows(configuration), lost)
    assert [entry.strut for entry in found] == ['strut_1', 'strut_3', 'strut_4']
    assert not any(entry.equivalent for entry in found)


def test_off_home_a_rigid_four_strut_mirror_has_no_equivalence():
    rows = strut_rows(cases.tilted('fsm_4_strut', 0.02, 0.02))
    assert all(entry.equivalent for entry in hard_torque_equivalence(rows))
    rigid = hard_torque_equivalence(rows.with_compliance(0.0))
    assert not any(entry.equivalent for entry in rigid)
