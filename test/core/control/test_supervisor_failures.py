# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller and failures: at once, right, in any order, and back again."""

import itertools

import numpy as np
import pytest
from core.control.control_cases import counted, fed, feed, report
from core.mechanisms import made, one_drive
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.control.failure_reports import ERROR, OK, STALE
from fault_tolerance.control.state_machine import State
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.kinematics.verdict import tolerance_margins
from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names

FSM = mechanism_named('fsm_4_strut')
ASKED = [0.01, 0.02, 0.0]
RECOVERED = np.array([-1, -4, -3, 0]) * 0.01 / np.sqrt(2)


def test_the_step_after_a_report_gives_the_new_kinematics():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.step(0.0)

    assert supervisor.reports([report('stuck', 'theta_4')], 0.001)
    output = supervisor.step(0.001)
    assert output.state is State.DEGRADED
    assert output.reason == 'theta_4 stuck; wx, wy retained, vz coupled'
    np.testing.assert_allclose(output.rates, RECOVERED, atol=1e-15)
    assert output.rates[3] == 0.0
    np.testing.assert_allclose(output.residual, [0, 0, 0.02 / np.sqrt(2)], atol=1e-15)
    assert output.failures == FailureSet(stuck=('theta_4',))
    assert output.estimate.post.failures == output.failures


def singles(name):
    mechanism = mechanism_named(name)
    for mode, parts in (
        ('position', mechanism.actuator_names),
        ('torque', mechanism.actuator_names),
        ('hard', mechanism.strut_names),
        ('hard', mechanism.actuator_names),
        ('position', mechanism.strut_names),
        ('torque', mechanism.strut_names),
    ):
        for part in parts:
            yield mode, part


def _free_of_bases(post):
    present = post.present
    return present.mapping @ present.mapping.T, present.jacobian @ present.mapping.T


@pytest.mark.parametrize('name', shipped_names())
def test_every_single_failure_is_judged_and_commanded_as_the_theory_says(name):
    mechanism = mechanism_named(name)
    rows = home_rows(mechanism)
    rng = np.random.default_rng(1)
    major = mechanism.task.major_rows
    for mode, part in singles(name):
        asked = 1e-3 * rng.standard_normal(len(mechanism.task.coordinates))
        supervisor = fed(mechanism, velocity=asked)
        supervisor.step(0.0)
        supervisor.reports([report(mode, part)], 0.0)
        output = supervisor.step(0.0)
        failures = failure_set(mechanism, [(mode, part)])
        post = reconfigured(rows, failures)

        assert output.failures == failures
        assert output.estimate.post.verdict == post.verdict
        # J and T are unique up to an orthogonal matrix.
        given = _free_of_bases(output.estimate.post)
        for found, wanted in zip(given, _free_of_bases(post), strict=True):
            size = max(1.0, float(np.abs(wanted).max()))
            np.testing.assert_allclose(found, wanted, atol=1e-12 * size)
        if post.verdict.tolerable:
            assert output.state is State.DEGRADED, (mode, part)
            np.testing.assert_allclose(output.residual[major], 0.0, atol=1e-12)
            for index, actuator in enumerate(mechanism.actuator_names):
                if failures.mode_of(mechanism, actuator).value in ('position', 'hard'):
                    assert output.rates[index] == 0.0
        else:
            assert output.state is State.STOPPED, (mode, part)
            assert not output.rates.any()
            assert output.reason.startswith(post.verdict.reason)


@pytest.mark.parametrize('order', list(itertools.permutations(range(3))))
def test_several_failures_at_once_or_one_by_one_are_the_same(order):
    reports = [
        report('stuck', 'theta_1'),
        report('free', 'theta_3'),
        report('none', 'theta_2', level=OK),
    ]
    one_by_one, at_once = fed(FSM, velocity=ASKED), fed(FSM, velocity=ASKED)
    for index in order:
        one_by_one.reports([reports[index]], 0.0)
        one_by_one.step(0.0)
    at_once.reports(reports, 0.0)

    first, second = one_by_one.step(0.0), at_once.step(0.0)
    assert first.state is second.state is State.DEGRADED
    np.testing.assert_array_equal(first.rates, second.rates)


def test_several_failures_at_once_take_one_reconfiguration():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.step(0.0)
    calls = counted(supervisor, 'estimate')
    supervisor.reports([report('stuck', 'theta_1'), report('free', 'theta_3')], 0.0)
    supervisor.step(0.0)
    assert len(calls) == 1

    # Reports are noted as they come; a step estimates once, whatever has been reported.
    for _ in range(30):
        assert not supervisor.reports([report('stuck', 'theta_1'), report('free', 'theta_3')], 0.0)
    assert len(calls) == 1
    supervisor.step(0.0)
    assert len(calls) == 2


@pytest.mark.parametrize('pair', list(itertools.combinations(FSM.actuator_names, 2)))
@pytest.mark.parametrize('mode', ['stuck', 'free'])
def test_two_stuck_or_two_free_stop_it_with_the_measure(mode, pair):
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.reports([report(mode, name) for name in pair], 0.0)
    output = supervisor.step(0.0)

    assert output.state is State.STOPPED
    assert not output.rates.any()
    assert 'measure 0)' in output.reason
    assert ('zero velocity does not hold' in output.reason) is (mode == 'free')


@pytest.mark.parametrize('pair', list(itertools.permutations(FSM.actuator_names, 2)))
def test_one_stuck_and_another_free_is_tolerated(pair):
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.reports([report('stuck', pair[0]), report('free', pair[1])], 0.0)
    output = supervisor.step(0.0)

    assert output.state is State.DEGRADED
    np.testing.assert_allclose(output.achieved[:2], ASKED[:2], atol=1e-12)


@pytest.mark.parametrize(
    ('mode', 'part', 'value'),
    [
        ('stuck', 'theta_4', 1 / np.sqrt(3)),
        ('free', 'theta_4', 0.5),
        ('lost', 'strut_4', 0.5),
    ],
)
def test_the_tolerance_threshold_decides_on_both_sides(mode, part, value):
    for threshold, state in ((value - 1e-9, State.DEGRADED), (value + 1e-9, State.STOPPED)):
        supervisor = fed(FSM, velocity=ASKED, tolerance_threshold=threshold)
        supervisor.reports([report(mode, part)], 0.0)
        output = supervisor.step(0.0)

        assert output.state is state
        assert output.rates.any() == (state is State.DEGRADED)
        assert (f'{value:.3g}' in output.reason) is (state is State.STOPPED)


@pytest.mark.parametrize('mode', ['stuck', 'free', 'lost'])
@pytest.mark.parametrize('name', shipped_names())
def test_everything_failed_is_a_stop_like_any_other(mode, name):
    mechanism = mechanism_named(name)
    supervisor = fed(mechanism, velocity=np.ones(len(mechanism.task.coordinates)))
    supervisor.reports([report(mode, part) for part in mechanism.actuator_names], 0.0)
    output = supervisor.step(0.0)

    assert output.state is State.STOPPED
    assert 'internal error' not in output.reason
    assert not output.rates.any()
    assert supervisor.metrics().state == 'stopped'


@pytest.mark.parametrize('mode', ['stuck', 'free', 'lost'])
def test_the_only_actuator_failed_is_a_stop_like_any_other(mode):
    mechanism = made(one_drive())
    supervisor = fed(mechanism, velocity=[0.1])
    assert supervisor.step(0.0).rates.any()
    supervisor.reports([report(mode, mechanism.actuator_names[0])], 0.0)
    output = supervisor.step(0.0)

    assert output.state is State.STOPPED
    assert 'internal error' not in output.reason


def test_a_stop_is_latched_until_it_is_cleared():
    supervisor = fed(FSM, velocity=ASKED, auto_clear=True)
    supervisor.reports([report('stuck', 'theta_1'), report('stuck', 'theta_4')], 0.0)
    supervisor.step(0.0)
    supervisor.reports([report('ok', 'theta_1', level=OK)], 0.0)
    output = supervisor.step(0.0)

    assert output.failures == FailureSet(stuck=('theta_4',))
    assert output.state is State.STOPPED
    assert not output.rates.any()
    outcome = supervisor.clear(0.0)
    assert outcome.success
    assert outcome.message == 'still reported: theta_4 (position); now degraded'
    np.testing.assert_allclose(supervisor.step(0.01).rates, RECOVERED, atol=1e-15)


def test_clearing_releases_what_is_not_reported_any_more_and_judges_the_rest():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.reports([report('stuck', 'theta_1'), report('stuck', 'theta_4')], 0.0)
    assert supervisor.step(0.0).state is State.STOPPED
    supervisor.reports([report('stuck', 'theta_4')], 5.0)
    feed(supervisor, 5.0, ASKED)
    outcome = supervisor.clear(5.0)

    assert outcome.success
    assert outcome.message == (
        'released theta_1 (position); still reported: theta_4 (position); now degraded'
    )
    np.testing.assert_allclose(supervisor.step(5.0).rates, RECOVERED, atol=1e-15)


def test_a_clear_that_releases_nothing_fails_and_says_why():
    supervisor = fed(FSM, velocity=ASKED)
    assert supervisor.clear(0.0).message == 'nothing to release; now nominal'
    assert not supervisor.clear(0.0).success

    supervisor.reports([report('stuck', 'theta_1'), report('stuck', 'theta_4')], 0.0)
    outcome = supervisor.clear(0.0)
    assert not outcome.success
    assert outcome.message == (
        'still reported: theta_1 (position), theta_4 (position); now stopped'
    )


def test_a_failure_that_persists_comes_back_after_a_clear():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    feed(supervisor, 10.0, ASKED)
    assert supervisor.clear(10.0).success
    supervisor.reports([report('stuck', 'theta_4', stamp=9.9)], 10.5)
    feed(supervisor, 10.5, ASKED)
    assert supervisor.step(10.5).state is State.NOMINAL

    supervisor.reports([report('stuck', 'theta_4', stamp=9.9)], 11.6)
    feed(supervisor, 11.6, ASKED)
    assert supervisor.step(11.6).state is State.DEGRADED


@pytest.mark.parametrize('name', shipped_names())
def test_clearing_gives_the_nominal_kinematics_back_to_the_last_bit(name):
    mechanism = mechanism_named(name)
    asked = np.ones(len(mechanism.task.coordinates))
    supervisor = fed(mechanism, velocity=asked, max_acceleration=1e9)
    before = supervisor.step(0.0)
    supervisor.reports([report('stuck', mechanism.actuator_names[0])], 0.0)
    supervisor.step(0.0)
    supervisor.reports([report('free', mechanism.actuator_names[-1])], 0.0)
    supervisor.step(0.0)
    supervisor.clear(10.0)
    feed(supervisor, 10.01, asked)
    after = supervisor.step(10.01)

    now, then = after.estimate.post.present, before.estimate.post.present
    np.testing.assert_array_equal(now.jacobian, then.jacobian)
    np.testing.assert_array_equal(now.mapping, then.mapping)
    np.testing.assert_array_equal(after.rates, before.rates)
    assert after.state is State.NOMINAL


def test_an_unknown_mode_stops_it_or_is_ignored():
    for unknown_mode, state in (('stop', State.STOPPED), ('ignore', State.NOMINAL)):
        supervisor = fed(FSM, velocity=ASKED, unknown_mode=unknown_mode)
        update = supervisor.reports([report('jammed', 'theta_4')], 0.0)
        output = supervisor.step(0.0)

        assert [notice.reason for notice in update.notices] == ['unknown_mode']
        assert output.state is state
        assert output.rates.any() == (state is State.NOMINAL)
    supervisor = fed(FSM)
    supervisor.reports([report('jammed', 'theta_4')], 0.0)
    assert 'theta_4 (jammed)' in supervisor.step(0.0).reason


@pytest.mark.parametrize(
    'harmless',
    [
        report('stuck', None),
        report('stuck', 'theta_4', level=STALE),
        report('none', 'theta_4', level=OK),
        report('jammed', 'theta_4', level=OK),
    ],
)
def test_what_is_no_failure_changes_nothing(harmless):
    supervisor = fed(FSM, velocity=ASKED)
    before = supervisor.step(0.0)

    assert not supervisor.reports([harmless], 0.0)
    assert supervisor.step(0.0).state is State.NOMINAL
    np.testing.assert_array_equal(supervisor.step(0.0).rates, before.rates)


def test_without_recovery_it_commands_as_if_nothing_had_failed_but_still_stops():
    supervisor = fed(FSM, velocity=ASKED, recovery=False)
    before = supervisor.step(0.0)
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    output = supervisor.step(0.0)

    assert output.state is State.DEGRADED
    np.testing.assert_array_equal(output.rates, before.rates)
    assert output.estimate.post.verdict.mobility == 2
    assert supervisor.metrics().position_measure == pytest.approx(1 / np.sqrt(3))
    supervisor.reports([report('stuck', 'theta_1')], 0.0)
    assert supervisor.step(0.0).state is State.STOPPED


def test_the_time_of_a_recovery_runs_from_the_report_to_the_command():
    ticks = iter(range(100))
    supervisor = fed(FSM, velocity=ASKED, clock=lambda: float(next(ticks)))
    assert supervisor.step(0.0).reconfiguration_time == 0.0
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    assert supervisor.step(0.0).reconfiguration_time == 1.0
    assert next(ticks) == 2

    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    assert supervisor.step(0.0).reconfiguration_time == 1.0


def test_a_failure_away_from_home_is_judged_there():
    supervisor = fed(FSM)
    tilt = 0.02 * np.array([1.0, 0.0, -1.0, 0.0])
    feed(supervisor, 0.0, ASKED, tilt)
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    output = supervisor.step(0.0)

    assert output.estimate.configuration.pose[2, 1] == pytest.approx(0.02 * np.sqrt(2), rel=1e-3)
    np.testing.assert_allclose(output.estimate.configuration.actuator_values, tilt, atol=1e-7)
    np.testing.assert_allclose(output.achieved[:2], ASKED[:2], atol=1e-12)
    assert np.abs(output.rates - RECOVERED).max() > 1e-6


PARTS = (*FSM.actuator_names, *FSM.strut_names)


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.tuples(st.sampled_from(['stuck', 'free', 'lost']), st.sampled_from(PARTS)),
        max_size=4,
        unique_by=lambda pair: pair[1],
    )
)
def test_any_mixture_of_failures_gives_the_verdict_of_the_whole_set(pairs):
    supervisor = fed(FSM, velocity=ASKED)
    for mode, part in pairs:
        supervisor.reports([report(mode, part, level=ERROR)], 0.0)
        supervisor.step(0.0)
    output = supervisor.step(0.0)
    failures = failure_set(FSM, pairs)
    expected = reconfigured(home_rows(FSM), failures)

    assert output.failures == failures
    assert output.estimate.post.verdict == expected.verdict
    if not failures:
        assert output.state is State.NOMINAL
    elif not expected.verdict.tolerable:
        assert output.state is State.STOPPED
    if output.rates.any():
        np.testing.assert_allclose(output.achieved[:2], ASKED[:2], atol=1e-12)


AXIS, STRUT = report('stuck', 'theta_5'), report('lost', 'strut_2')


@pytest.mark.parametrize('name', ['fsm_overactuated', 'mirror_overactuated'])
def test_a_strut_that_is_lost_gives_back_what_a_stuck_axis_has_barred(name):
    """Tolerance is decided on the system after all failures, whatever their order."""
    mechanism, asked = mechanism_named(name), [1e-3, 2e-3, 0.0]
    alone = fed(mechanism, velocity=asked)
    alone.reports([AXIS], 0.0)
    output = alone.step(0.0)
    assert output.state is State.STOPPED
    assert not output.rates.any()

    for messages in ([[AXIS, STRUT]], [[STRUT, AXIS]], [[STRUT], [AXIS]]):
        supervisor = fed(mechanism, velocity=asked)
        supervisor.step(0.0)
        for message in messages:
            supervisor.reports(message, 0.0)
            output = supervisor.step(0.0)
            assert output.state is State.DEGRADED, messages
        np.testing.assert_allclose(output.achieved[:2], asked[:2], atol=1e-12)
        assert tolerance_margins(output.estimate.post).motion == pytest.approx(2.36, abs=5e-3)


def test_after_a_clearing_nothing_moves_until_the_joints_of_the_lost_strut_are_read():
    platform = mechanism_named('gough_stewart_8')
    supervisor = fed(platform, velocity=np.full(6, 1e-3))
    assert supervisor.reports([report('hard', 'strut_4')], 0.0)
    values = np.zeros(8)
    values[platform.actuator_index('leg_4')] = np.nan
    assert supervisor.joint_reading(values, 0.01) is None
    assert supervisor.step(0.01).rates.any()
    supervisor.reports([report('none', 'strut_4', stamp=0.02, level=OK)], 0.02)
    assert supervisor.clear(0.03).success
    output = supervisor.step(0.03)
    assert output.state is State.HOLD and not output.rates.any()
    assert 'leg_4' in output.reason
    feed(supervisor, 0.04)
    assert supervisor.step(0.04).rates.any()
