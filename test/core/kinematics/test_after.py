# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""One call from a mechanism to what failures leave: the same as step by step."""

import numpy as np
import pytest
from core import cases

from fault_tolerance.errors import ClosureError, FailureError, FaultToleranceError
from fault_tolerance.kinematics.actuator_measures import pair_measures
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet, failure_set
from fault_tolerance.kinematics.measures import next_failure, present_measures
from fault_tolerance.kinematics.reconfiguration import after, reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.configuration import posed_configuration, solved_configuration

MIRROR = cases.named('fsm_4_strut')
BROKEN = FailureSet(stuck=('theta_4',), lost=('strut_1',))


@pytest.mark.parametrize('failures', [
    BROKEN,
    ['stuck:theta_4', 'lost:strut_1'],
    [('stuck', 'theta_4'), (FailureMode.HARD, 'strut_1')],
    [Failure(FailureMode.POSITION, 'theta_4'), 'hard:theta_1'],
    iter(['hard:strut_1', ('locked', 'theta_4')]),
])
def test_failures_in_any_form(failures):
    assert after(MIRROR, failures).failures == BROKEN


@pytest.mark.parametrize(('place', 'solved'), [
    ({}, solved_configuration),
    ({'at': {'theta_1': 0.01}}, solved_configuration),
    ({'pose': {'wx': 0.01}}, posed_configuration),
])
def test_it_is_the_same_step_by_step(place, solved):
    post = after(MIRROR, ['stuck:theta_4'], **place)
    given = next(iter(place.values()), {})
    rows = strut_rows(solved(MIRROR, given))
    expected = reconfigured(rows, failure_set(MIRROR, [('stuck', 'theta_4')]))
    np.testing.assert_array_equal(post.jacobian, expected.present.jacobian)
    np.testing.assert_array_equal(post.mapping, expected.present.mapping)
    np.testing.assert_array_equal(post.configuration.pose, rows.configuration.pose)
    assert post.mechanism is MIRROR
    assert post.verdict == expected.verdict
    assert post.measures == present_measures(expected)
    np.testing.assert_array_equal(post.next_failure.torque, next_failure(expected).torque)
    pairs = pair_measures(expected.present)
    np.testing.assert_array_equal(post.pair_measures.position, pairs.position)


def test_a_lost_strut_may_be_out_of_reach():
    """Where the loops do not close with a strut, they may without it."""
    mechanism = cases.named('fsm_4_strut')
    at = {'theta_1': 0.1, 'theta_2': 0.1, 'theta_3': 0.1, 'theta_4': 0.2}
    with pytest.raises(ClosureError):
        after(mechanism, at=at)
    post = after(mechanism, ['lost:strut_4'], at=at)
    assert post.configuration.converged


@pytest.mark.parametrize(('failures', 'reason'), [
    (['stuck'], 'a failure is written MODE:NAME'),
    (['stuck:'], 'a failure is written MODE:NAME'),
    (['jammed:theta_1'], 'unknown failure mode'),
    (['stuck:theta_9'], 'neither an actuator nor a strut'),
    ('stuck:theta_1', 'one text, expected several failures'),
])
def test_failures_that_cannot_be(failures, reason):
    with pytest.raises(FailureError, match=reason):
        after(MIRROR, failures)


def test_one_place_at_a_time():
    with pytest.raises(FaultToleranceError, match='not both'):
        after(MIRROR, at={'theta_1': 0.0}, pose={'wx': 0.0})
