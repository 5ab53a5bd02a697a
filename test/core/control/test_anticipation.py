# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The table of post-failure kinematics gives what the live path gives, or gives way to it."""

from __future__ import annotations

import numpy as np
import pytest
from core.control.control_cases import place, report
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.control import anticipation
from fault_tolerance.control.anticipation import REACH, RENEWAL, further_sets
from fault_tolerance.control.recovery import State
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.mechanism.catalogue import mechanism_named

SHIPPED = (
    'fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated', 'mirror_4_strut', 'gough_stewart_6',
    'gough_stewart_8', 'planar_4rpr', 'serial_3r',
)
FSM = mechanism_named('fsm_4_strut')
ASKED = np.array([0.01, 0.02, 0.0])
PATIENT = {'joint_state_timeout': 100.0, 'command_timeout': 100.0}


def started(name: str, values, **more) -> Supervisor:
    """Return a supervisor that is asked to move, at joint values."""
    mechanism = mechanism_named(name)
    supervisor = Supervisor(mechanism, Settings(**PATIENT, **more))
    count = len(mechanism.task.coordinates)
    supervisor.task_velocity(0.01 * np.arange(1.0, count + 1.0), 0.0)
    supervisor.joint_reading(values, 0.0)
    supervisor.step(0.0)
    return supervisor


def filled(supervisor: Supervisor) -> Supervisor:
    """Give a supervisor all the idle time it wants."""
    for _ in range(1000):
        if not supervisor.anticipate():
            return supervisor
    raise AssertionError('there is no end to it')


def failing(supervisor: Supervisor, mode: str, *names: str, now: float = 0.1):
    """Report failures in one message; return the output of the step that follows."""
    update = supervisor.reports([report(mode, name) for name in names], now)
    assert update.changed
    return supervisor.step(now)


def singles(name: str) -> list[tuple[str, str]]:
    mechanism = mechanism_named(name)
    actuators, struts = mechanism.actuator_names, mechanism.strut_names
    return [
        *(('position', actuator) for actuator in actuators),
        *(('torque', actuator) for actuator in actuators),
        *(('hard', strut) for strut in struts),
    ]


def assert_same(found, live):
    assert found.state is live.state
    assert found.reason == live.reason
    assert found.failures == live.failures
    np.testing.assert_allclose(found.rates, live.rates, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.achieved, live.achieved, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.residual, live.residual, rtol=0, atol=1e-9)
    for matrix in ('jacobian', 'mapping', 'rate_map'):
        np.testing.assert_allclose(
            getattr(found.post.present, matrix), getattr(live.post.present, matrix),
            rtol=0, atol=1e-9,
        )
    np.testing.assert_allclose(found.configuration.pose, live.configuration.pose, atol=1e-9)


@given(
    name=st.sampled_from(SHIPPED), seed=st.integers(0, 5),
    chosen=st.lists(st.integers(0, 1000), min_size=1, max_size=2),
)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_an_entry_is_what_the_live_path_gives(name, seed, chosen):
    values = place(name, seed)
    table, live = started(name, values), started(name, values, anticipate=False)
    for number, choice in enumerate(chosen, 1):
        mode, part = singles(name)[choice % len(singles(name))]
        stopped, now = table.output.state is State.STOPPED, 0.1 * number
        expected = set() if stopped else set(further_sets(table.mechanism, table.failures))
        filled(table)
        for one in (table, live):
            one.reports([report(mode, part)], now)
        assert_same(table.step(now), live.step(now))
        assert not live.anticipate()
        assert live.assessed_by == 'derived'
        if table.failures in expected:
            assert table.assessed_by == 'anticipated'


@pytest.mark.parametrize('name', ['fsm_4_strut', 'gough_stewart_6'])
def test_every_single_failure_is_anticipated(name):
    values = place(name, 0)
    for mode, part in singles(name):
        supervisor = filled(started(name, values))
        output = failing(supervisor, mode, part)
        assert supervisor.assessed_by == 'anticipated', (mode, part)
        if mode == 'position' and output.state is State.DEGRADED:
            place_ = supervisor.mechanism.actuator_index(part)
            assert output.rates[place_] == 0.0
            assert output.rates.any()


def test_with_an_entry_no_kinematics_are_derived_on_a_report(monkeypatch):
    supervisor = filled(started('fsm_4_strut', place('fsm_4_strut', 0)))

    def fail(*_args, **_kwargs):
        raise AssertionError('derived')

    for target in (
        'control.judgement.reconfigured', 'control.assessment.fitted_configuration',
        'control.assessment.present_measures', 'control.command.RateResolver.inverse',
    ):
        monkeypatch.setattr(f'fault_tolerance.{target}', fail)
    output = failing(supervisor, 'position', 'theta_4')
    assert output.state is State.DEGRADED
    assert output.rates[3] == 0.0
    assert output.rates[:3].all()


def test_what_is_intolerable_stops_at_once_from_its_entry():
    supervisor = started('fsm_4_strut', place('fsm_4_strut', 0))
    failing(supervisor, 'position', 'theta_1')
    filled(supervisor)
    output = failing(supervisor, 'position', 'theta_2', now=0.2)
    assert supervisor.assessed_by == 'anticipated'
    assert output.state is State.STOPPED
    assert not output.rates.any()


def test_entries_follow_the_mechanism():
    supervisor = started('fsm_4_strut', place('fsm_4_strut', 0))
    sets = len(set(further_sets(FSM, FailureSet())))
    assert sets == 12
    assert [supervisor.anticipate() for _ in range(sets + 2)] == [True] * sets + [False] * 2
    for share, wanted in ((0.5, 0), (1.5, sets)):
        step = share * RENEWAL * REACH * FSM.characteristic_length
        values = place('fsm_4_strut', 0) + step * np.array([1.0, 0.0, -1.0, 0.0])
        assert supervisor.joint_reading(values, 0.01) is None
        supervisor.step(0.01)
        made = 0
        while supervisor.anticipate():
            made += 1
        assert made == wanted, share


@pytest.mark.parametrize('name', ['fsm_4_strut', 'fsm_overactuated', 'gough_stewart_8'])
def test_an_entry_serves_a_little_way_off_for_one_command(name):
    for mode, part in (('position', singles(name)[1][1]), ('torque', singles(name)[2][1])):
        values, mechanism = place(name, 0), mechanism_named(name)
        supervisor = filled(started(name, values))
        step = place(name, 1) - values
        step *= 0.9 * REACH * mechanism.characteristic_length / np.abs(step).max()
        live = started(name, values, anticipate=False)
        for one in (supervisor, live):
            assert one.joint_reading(values + step, 0.05) is None
            one.step(0.05)
        found, derived = failing(supervisor, mode, part), failing(live, mode, part)
        assert supervisor.assessed_by == 'anticipated'
        size = np.abs(derived.rates).max()
        error = np.abs(found.rates - derived.rates).max()
        assert 0.0 < error <= 20.0 * REACH * size
        # The next step derives everything at the present joint values, whatever calls for it.
        found, derived = supervisor.step(0.11), live.step(0.11)
        assert supervisor.assessed_by == 'derived'
        np.testing.assert_allclose(
            found.post.present.jacobian, derived.post.present.jacobian, atol=1e-9
        )


def test_too_far_from_its_entry_a_failure_is_judged_live():
    values = place('fsm_4_strut', 0)
    supervisor = filled(started('fsm_4_strut', values))
    away = 1.1 * REACH * FSM.characteristic_length * np.array([1.0, 0.0, -1.0, 0.0])
    live = started('fsm_4_strut', values, anticipate=False)
    for one in (supervisor, live):
        one.joint_reading(values + away, 0.05)
        one.step(0.05)
    found, derived = (failing(one, 'torque', 'theta_2') for one in (supervisor, live))
    assert supervisor.assessed_by == 'derived'
    assert_same(found, derived)


def test_the_table_never_stops_from_a_little_way_off():
    supervisor = started('fsm_4_strut', place('fsm_4_strut', 0))
    failing(supervisor, 'position', 'theta_1')
    filled(supervisor)
    values = place('fsm_4_strut', 0) + 1e-6 * np.array([0.0, 1.0, 0.0, -1.0])
    supervisor.joint_reading(values, 0.15)
    supervisor.step(0.15)
    assert failing(supervisor, 'position', 'theta_2', now=0.2).state is State.STOPPED
    assert supervisor.assessed_by == 'derived'


def test_a_measure_close_to_the_threshold_is_judged_live():
    # One free strut leaves t = 0.5: safe from a threshold far below, not from one beside it.
    for threshold, by in ((0.01, 'anticipated'), (0.46, 'derived')):
        values = place('fsm_4_strut', 0)
        supervisor = filled(started('fsm_4_strut', values, tolerance_threshold=threshold))
        supervisor.joint_reading(values + 1e-4 * np.array([1.0, 0.0, -1.0, 0.0]), 0.05)
        supervisor.step(0.05)
        assert failing(supervisor, 'torque', 'theta_2').state is State.DEGRADED
        assert supervisor.assessed_by == by


def test_what_is_not_in_the_table_is_judged_live():
    values = place('fsm_4_strut', 0)
    for mode, names in (('torque', ('theta_1', 'theta_2')), ('hard', ('strut_1', 'strut_3'))):
        supervisor = filled(started('fsm_4_strut', values))
        live = started('fsm_4_strut', values, anticipate=False)
        assert_same(failing(supervisor, mode, *names), failing(live, mode, *names))
        assert supervisor.assessed_by == 'derived'


def test_what_cannot_be_worked_out_in_advance_is_left_to_the_live_path(monkeypatch):
    supervisor = started('fsm_4_strut', place('fsm_4_strut', 0))

    def fail(*_args, **_kwargs):
        raise np.linalg.LinAlgError('SVD did not converge')

    with monkeypatch.context() as patch:
        patch.setattr(supervisor._situation._assessor, 'foreseen', fail)
        filled(supervisor)
    assert failing(supervisor, 'position', 'theta_4').state is State.DEGRADED
    assert supervisor.assessed_by == 'derived'


def test_nothing_is_anticipated_without_joint_values_or_once_stopped():
    assert not Supervisor(FSM, Settings(**PATIENT)).anticipate()
    supervisor = started('fsm_4_strut', place('fsm_4_strut', 0))
    assert failing(supervisor, 'position', 'theta_1', 'theta_2').state is State.STOPPED
    assert not supervisor.anticipate()


def test_further_sets_are_all_single_failures_beyond_the_present_ones(monkeypatch):
    present = failure_set(FSM, [('stuck', 'theta_1')])
    found = list(further_sets(FSM, present))
    assert len(found) == len(set(found)) == 3 + 3 + 4
    assert all(len(one) == 2 or one.lost == ('strut_1',) for one in found)
    monkeypatch.setattr(anticipation, 'CAPACITY', 11)
    assert list(further_sets(FSM, present)) == []
