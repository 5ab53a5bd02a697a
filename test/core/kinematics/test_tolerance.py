# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Tolerance is decided on the system after all failures, never on a chain of measures."""

import numpy as np
import pytest
from core import cases, reference
from core.mechanisms import made, serial_3r

from fault_tolerance.campaign.cases import double_failures, is_tolerable, single_failures
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.measures import present_measures
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.kinematics.verdict import intolerance, tolerance_margins
from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names
from fault_tolerance.mechanism.configuration import solved_configuration

THRESHOLD = 0.01


def post_of(name, *failures):
    return cases.state(cases.home(name), failures)


@pytest.mark.parametrize('name', shipped_names())
def test_exactly_what_rank_and_stability_of_the_final_system_say(name):
    mechanism = mechanism_named(name)
    rows = home_rows(mechanism)
    values = np.zeros(sum(len(strut.joints) for strut in mechanism.struts))
    for failures in (*single_failures(mechanism), *double_failures(mechanism)):
        post = reconfigured(rows, failures)
        pairs = [(failure.mode.value, failure.name) for failure in failures.failures]
        expected = reference.model(mechanism, values, pairs).tolerable
        assert (intolerance(post, THRESHOLD) == '') == expected, failures
        assert post.verdict.tolerable == expected, failures
        assert is_tolerable(mechanism, failures) == expected, failures


@pytest.mark.parametrize('name', ['fsm_overactuated', 'mirror_overactuated'])
@pytest.mark.parametrize('strut', ['strut_2', 'strut_3'])
def test_a_lost_strut_makes_a_stuck_drive_tolerable(name, strut):
    stuck, lost = ('position', 'theta_5'), ('hard', strut)
    assert 'position measure 0' in intolerance(post_of(name, stuck), THRESHOLD)
    assert present_measures(post_of(name, stuck, lost)).position == 0.0
    for failures in ((stuck, lost), (lost, stuck)):
        post = post_of(name, *failures)
        assert intolerance(post, THRESHOLD) == ''
        assert tolerance_margins(post).motion > 1.0


def test_the_value_of_the_motion_margin():
    post = post_of('fsm_overactuated', ('position', 'theta_5'), ('hard', 'strut_2'))
    assert tolerance_margins(post).motion == pytest.approx(2.36, abs=0.005)
    # In this mirror a radian counts as much as a metre.
    retained = present_measures(post).retained_manipulability
    assert tolerance_margins(post).motion == pytest.approx(retained)


@pytest.mark.parametrize('name', ['fsm_4_strut', 'gough_stewart_8', 'planar_4rpr', 'serial_3r'])
def test_motion_is_p_while_all_failures_are_position_failures(name):
    for failures in cases.failure_lists(cases.named(name), 30):
        post = post_of(name, *failures)
        margins, measures = tolerance_margins(post), present_measures(post)
        assert (margins.torque, margins.hard) == (measures.torque, measures.hard)
        if all(mode == 'position' for mode, _ in failures):
            assert margins.motion == pytest.approx(measures.position, abs=1e-12)
        if not post.verdict.tolerable:
            assert min(margins.motion, margins.torque, margins.hard) == 0.0, failures


@pytest.mark.parametrize(('failure', 'word', 'value'), [
    (('position', 'theta_4'), 'position', 1 / np.sqrt(3)),
    (('torque', 'theta_4'), 'torque', 0.5),
    (('hard', 'strut_4'), 'hard', 0.5),
])
def test_a_margin_below_the_threshold_is_not_tolerated(failure, word, value):
    post = post_of('fsm_4_strut', failure)
    assert intolerance(post, value - 1e-9) == ''
    assert f'{word} measure {value:.3g} is below the tolerance threshold' in intolerance(
        post, value + 1e-9)


def test_nearly_lost_is_said_with_what_is_hardly_moved_or_held():
    mechanism = made(serial_3r())
    stretched = solved_configuration(
        mechanism, {'joint_1': 0.0, 'joint_2': -np.arctan2(0.9, 0.5), 'joint_3': -0.2})
    post = cases.state(stretched, [('position', 'joint_2')])
    value = tolerance_margins(post).motion
    assert 'joint_2 stuck: position measure' in intolerance(post, 2.0 * value)
    platform = solved_configuration(mechanism_named('gough_stewart_8'), {'leg_2': 0.001})
    post = cases.state(platform, [('torque', 'leg_1'), ('torque', 'leg_3')])
    assert post.verdict.tolerable
    assert intolerance(post, THRESHOLD).endswith('hardly held: wy, wz, vy')


def test_units_do_not_decide():
    """Drives of both kinds: margins count radians by the characteristic length."""
    post = post_of('mirror_overactuated', ('torque', 'theta_4'))
    assert present_measures(post).torque != pytest.approx(tolerance_margins(post).torque)
    assert tolerance_margins(post) == tolerance_margins(post.in_metres())


def test_no_failure_is_tolerated():
    for name in cases.NAMES:
        post = reconfigured(home_rows(cases.named(name)), FailureSet())
        margins = tolerance_margins(post)
        assert (margins.torque, margins.hard) == (1.0, 1.0)
        assert margins.motion == pytest.approx(1.0)
        assert (intolerance(post, THRESHOLD) == '') == post.verdict.tolerable
