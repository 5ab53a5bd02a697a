# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Judgement: where failures stop being tolerated, in words, and without flicker."""

from dataclasses import replace

import numpy as np
import pytest
from core.mechanisms import made, serial_3r

from fault_tolerance.control.assessment import Assessor
from fault_tolerance.control.command import CommandLaw
from fault_tolerance.control.judgement import (
    COMPLIANCE_BAND,
    PostFailureModel,
    intolerance,
)
from fault_tolerance.control.settings import Settings
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.measures import present_measures
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import fitted_configuration

FSM = mechanism_named('fsm_4_strut')
HEALTHY = FailureSet()
STUCK_4 = FailureSet(stuck=('theta_4',))


def state(*failures, mechanism=FSM):
    return reconfigured(home_rows(mechanism), failure_set(mechanism, failures))


def tilted(angle: float) -> np.ndarray:
    """Return joint values of the mirror turned by ``angle`` about x and about y."""
    where = np.radians([90.0, 0.0, 270.0, 180.0])
    return np.sqrt(0.5) * angle * (np.sin(where) - np.cos(where))


@pytest.mark.parametrize(
    ('failures', 'name', 'value'),
    [
        ([('position', 'theta_4')], 'position', 1 / np.sqrt(3)),
        ([('torque', 'theta_4')], 'torque', 0.5),
        ([('hard', 'strut_4')], 'hard', 0.5),
    ],
)
def test_a_measure_below_the_threshold_is_not_tolerated(failures, name, value):
    post = state(*failures)
    measures = present_measures(post)

    assert intolerance(post, measures, value - 1e-9) == ''
    reason = intolerance(post, measures, value + 1e-9)
    assert f'{name} measure {value:.3g} is below the tolerance threshold' in reason


def test_what_is_not_tolerated_is_said_with_the_measure():
    post = state(('position', 'theta_1'), ('position', 'theta_4'))
    reason = intolerance(post, present_measures(post), 1e-3)

    assert reason.startswith(post.verdict.reason)
    assert reason.endswith('(position measure 0)')


def test_a_drifting_platform_is_said_not_to_be_held():
    post = state(('torque', 'theta_1'), ('torque', 'theta_4'))

    assert 'zero velocity does not hold' in intolerance(post, present_measures(post), 1e-3)


def crossing():
    """Return rows of a tilted mirror and the singular value of its weakest constraint."""
    rows = strut_rows(fitted_configuration(FSM, tilted(0.03)))
    strict = differential_kinematics(rows.with_compliance(0.0))
    assert strict.absorbed == 0
    return rows, strict.weakest_kept


@pytest.mark.parametrize('failures', [HEALTHY, STUCK_4], ids=['healthy', 'stuck'])
def test_a_verdict_does_not_flicker_across_the_compliance(failures):
    rows, sigma = crossing()
    model = PostFailureModel()

    def mobility(ratio):
        return model.at(rows.with_compliance(sigma / ratio), failures).nominal.mobility

    inside, band, outside = 0.95, 0.5 * (1.0 + COMPLIANCE_BAND), 1.05 * COMPLIANCE_BAND
    assert [mobility(ratio) for ratio in (band, inside, band, inside, band)] == [2, 3, 3, 3, 3]
    assert [mobility(ratio) for ratio in (outside, band, outside, band)] == [2, 2, 2, 2]
    assert mobility(inside) == 3


def test_a_failure_within_the_band_is_judged_like_the_healthy_mechanism_before():
    rows, sigma = crossing()
    model = PostFailureModel()
    model.at(rows.with_compliance(sigma / 0.95), HEALTHY)
    band = rows.with_compliance(sigma / 1.1)

    assert model.at(band, STUCK_4).verdict.tolerable
    assert not PostFailureModel().at(band, STUCK_4).verdict.tolerable
    assert model.at(band, HEALTHY).nominal.mobility == 3


def test_a_model_without_flicker_is_the_plain_one_everywhere_else():
    rows, _ = crossing()
    model = PostFailureModel()
    for failures in (HEALTHY, STUCK_4, HEALTHY):
        found, plain = model.at(rows, failures), reconfigured(rows, failures)
        np.testing.assert_array_equal(found.present.jacobian, plain.present.jacobian)
        np.testing.assert_array_equal(found.present.mapping, plain.present.mapping)


def test_loops_are_closed_across_the_compliance_and_the_verdict_changes_once():
    assessor = Assessor(FSM, 1e-3)
    angles = np.linspace(0.03, 0.065, 15)
    out = [assessor.assessed(tilted(angle), HEALTHY).post.verdict.tolerable for angle in angles]
    assert assessor.unclosed == ''
    back = [
        assessor.assessed(tilted(angle), HEALTHY).post.verdict.tolerable for angle in angles[::-1]
    ]

    assert np.count_nonzero(np.diff(out)) == 1
    assert np.count_nonzero(np.diff(back)) == 1
    assert out.count(True) > back.count(True)


def test_joint_values_that_no_loop_fits_are_not_assessed():
    assessor = Assessor(FSM, 1e-3)
    assert assessor.assessed(tilted(0.01), HEALTHY).post.verdict.tolerable
    before = assessor.assessed(tilted(0.01), HEALTHY).configuration

    found = assessor.assessed(tilted(0.1), STUCK_4)
    assert 'do not close' in assessor.unclosed
    assert found.post.failures == STUCK_4
    np.testing.assert_array_equal(found.configuration.pose, before.pose)
    assessor.assessed(tilted(0.01), STUCK_4)
    assert assessor.unclosed == ''


def test_readings_without_sense_do_not_leave_it_upside_down():
    mirror = mechanism_named('mirror_4_strut')
    assessor = Assessor(mirror, 1e-3)
    nonsense = [
        [0.0, -0.017, 0.035, 0.0], [-0.008, 0.0, 0.0, 0.0], [0.0, -0.147, 0.0, 0.169],
        [-41.0, 1.9, -22.0, 0.0], [0.0, 0.0, -0.12, 0.46], [1.4, 0.0, -7.4, -42.0],
    ]
    rng = np.random.default_rng(0)
    for _ in range(8):
        for place in rng.permutation(len(nonsense))[:4]:
            assessor.assessed(np.array(nonsense[place]), HEALTHY)
        found = assessor.assessed(np.zeros(4), HEALTHY)
        assert assessor.unclosed == ''
        assert found.configuration.largest_misfit < 1e-9
        np.testing.assert_allclose(found.configuration.pose[2, 2], 1.0)


def test_readings_of_a_lost_strut_are_not_looked_at():
    lost = FailureSet(lost=('strut_4',))
    poses = []
    for reading in (0.0, 0.3, np.nan):
        values = tilted(0.01)
        values[3] = reading
        poses.append(Assessor(FSM, 1e-3).assessed(values, lost).configuration.pose)

    np.testing.assert_array_equal(poses[0], poses[1])
    np.testing.assert_array_equal(poses[0], poses[2])


def arm_at(bend: float):
    """Return the resolved rate of a planar arm with its last two joints nearly stretched."""
    mechanism = made(serial_3r())
    law = CommandLaw(mechanism, Settings())
    # At home the three joints make a bend of these angles; undone, the arm is stretched.
    first = np.arctan2(0.9, 0.5)
    second = np.arctan2(0.2, 0.8) - first
    values = np.array([0.0, -first + bend, -second + bend])
    rows = strut_rows(fitted_configuration(mechanism, values))
    return law, law.resolved(differential_kinematics(rows), np.array([1.0, 0.0]))


def test_a_measure_nearly_lost_is_said_with_what_is_hardly_moved():
    mechanism = made(serial_3r())
    first = np.arctan2(0.9, 0.5)
    second = np.arctan2(0.2, 0.8) - first
    values = np.array([0.0, 0.0, -second + 1e-3])  # two links nearly in line
    rows = strut_rows(fitted_configuration(mechanism, values))
    post = reconfigured(rows, failure_set(mechanism, [('stuck', mechanism.actuator_names[0])]))

    assert post.verdict.tolerable
    assert intolerance(post, present_measures(post), 0.01).endswith(
        'is below the tolerance threshold 0.01; hardly moved: vx, vy'
    )


def test_near_a_singularity_the_command_slows_down_and_then_holds():
    scales = []
    for bend in (0.1, 1e-3, 6e-4, 3e-4):
        law, resolved = arm_at(bend)
        scales.append(law.limited(resolved, np.full(3, np.nan)).scale)
        assert law.obstacle(resolved) == ''
    assert scales[0] == 1.0
    assert 1.0 > scales[1] > scales[2] > scales[3] > 0.0

    law, resolved = arm_at(1e-5)
    assert law.limited(resolved, np.full(3, np.nan)).scale == 0.0
    assert 'near a singularity' in law.obstacle(resolved)


def test_a_hold_near_a_singularity_does_not_flicker():
    def at(transmission):
        return replace(arm_at(0.1)[1], transmission=transmission)

    law, _ = arm_at(0.1)
    limit = Settings().hold_below * law.resolved(
        differential_kinematics(home_rows(made(serial_3r()))), np.zeros(2)
    ).transmission
    sequence = [1.5, 0.9, 1.5, 0.9, 2.1, 1.5]
    assert [bool(law.obstacle(at(ratio * limit))) for ratio in sequence] == [
        False, True, True, True, False, False
    ]


def test_a_command_that_is_not_finite_is_never_given():
    law = CommandLaw(FSM, Settings())
    resolved = law.resolved(state().present, np.array([1.0, 0.0, 0.0]))
    broken = replace(resolved, major=np.array([np.nan, 0.0, 0.0]))

    with pytest.raises(ArithmeticError, match='not finite'):
        law.limited(broken, np.zeros(4))


@pytest.mark.parametrize(
    'failures',
    [
        [('torque', 'theta_4'), ('torque', 'theta_5')],
        [('torque', 'theta_1')],
        [('position', 'theta_1')],
        [('hard', 'strut_2')],
        [('position', 'theta_2'), ('torque', 'theta_1')],
    ],
)
def test_the_decision_does_not_depend_on_the_units_of_the_drives(failures):
    # The same mirror, once in radii and once in metres: drives that turn beside ones that slide.
    reasons = []
    for name in ('fsm_overactuated', 'mirror_overactuated'):
        post = state(*failures, mechanism=mechanism_named(name))
        reasons.append(intolerance(post, present_measures(post), 0.999))
        assert intolerance(post, present_measures(post), 0.1) == ''

    assert 'below the tolerance threshold' in reasons[0]
    assert reasons[0] == reasons[1]
