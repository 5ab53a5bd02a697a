# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller's inputs: what is refused, what a silence does, and that it comes back."""

from dataclasses import replace

import numpy as np
import pytest
from core.control.control_cases import failing, fed, feed, report
from core.mechanisms import by_numbers, made
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import MOST_ERRORS, Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path
from fault_tolerance.mechanism.files import mechanism_from_text

FSM = mechanism_named('fsm_4_strut')
ASKED = [0.01, 0.02, 0.0]


def at_rest(output) -> bool:
    return not output.rates.any() and not output.achieved.any()


def test_without_joint_states_it_waits_with_zeros():
    supervisor = Supervisor(FSM)
    supervisor.task_velocity(np.array(ASKED), 0.0)
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    output = supervisor.step(0.0)

    assert output.state is State.WAITING
    assert output.reason == 'no joint state yet; theta_4 stuck'
    assert at_rest(output)
    assert not output.estimate.located
    assert output.input_lost


def test_without_a_task_velocity_it_is_nominal_at_rest():
    output = fed(FSM).step(0.0)

    assert output.state is State.NOMINAL
    assert 'no task velocity yet' in output.reason
    assert at_rest(output)
    assert not output.input_lost


def test_a_task_velocity_becomes_a_command():
    output = fed(FSM, velocity=ASKED).step(0.0)

    assert output.state is State.NOMINAL
    np.testing.assert_allclose(
        output.rates, np.array([1, -2, -1, 2]) * 0.01 / np.sqrt(2), atol=1e-15
    )
    np.testing.assert_allclose(output.achieved, [0.01, 0.02, 0, 0, 0, 0], atol=1e-15)
    np.testing.assert_allclose(output.residual, 0.0, atol=1e-15)


def test_a_task_velocity_that_ceases_becomes_zeros_and_comes_back():
    supervisor = fed(FSM, velocity=ASKED, command_timeout=0.1)
    feed(supervisor, 0.1)
    assert supervisor.step(0.1).rates.any()

    feed(supervisor, 0.11)
    resting = supervisor.step(0.11)
    assert resting.state is State.NOMINAL
    assert resting.reason == 'no failure; no task velocity for 0.1 s'
    assert at_rest(resting)
    assert not resting.input_lost
    feed(supervisor, 0.2, ASKED)
    assert supervisor.step(0.2).rates.any()


def test_joint_states_that_cease_become_zeros_and_come_back():
    supervisor = fed(FSM, velocity=ASKED, joint_state_timeout=0.1)
    supervisor.task_velocity(np.array(ASKED), 0.15)
    held = supervisor.step(0.15)

    assert held.state is State.HOLD
    assert held.reason == 'no usable joint state for 0.1 s'
    assert at_rest(held)
    assert held.input_lost
    feed(supervisor, 0.2, ASKED)
    assert supervisor.step(0.2).state is State.NOMINAL


@pytest.mark.parametrize('bad', [np.nan, np.inf, -np.inf])
def test_a_bad_reading_is_left_aside_and_the_last_good_one_stands(bad):
    supervisor = fed(FSM, velocity=ASKED)
    before = supervisor.step(0.0)
    notice = supervisor.joint_reading(np.array([0.0, bad, 0.0, 0.0]), 0.05)
    after = supervisor.step(0.05)

    assert notice.reason == 'not_finite'
    assert 'theta_2' in notice.text
    np.testing.assert_array_equal(after.rates, before.rates)
    supervisor.task_velocity(np.array(ASKED), 0.12)
    assert supervisor.step(0.12).state is State.HOLD


def test_old_readings_do_not_refresh():
    supervisor = fed(FSM, now=1.0, velocity=ASKED)

    assert supervisor.joint_reading(np.zeros(4), 1.05, 0.99).reason == 'old_joint_state'
    assert supervisor.joint_reading(np.zeros(4), 1.2, 1.05).reason == 'stale_joint_state'
    assert supervisor.step(1.2).state is State.HOLD


def test_joints_of_a_lost_strut_need_no_reading():
    supervisor = fed(FSM, velocity=ASKED)
    values = np.array([0.0, 0.0, 0.0, np.nan])
    assert supervisor.joint_reading(values, 0.0).reason == 'not_finite'

    supervisor.reports([report('lost', 'strut_4')], 0.0)
    assert supervisor.joint_reading(values, 0.0) is None
    output = supervisor.step(0.0)
    assert output.state is State.DEGRADED
    np.testing.assert_allclose(
        output.rates, np.array([1, -2, -1, 0]) * 0.01 / np.sqrt(2), atol=1e-12
    )


@pytest.mark.parametrize(
    ('velocity', 'reason'),
    [
        ([np.nan, 0.0, 0.0], 'not_finite'),
        ([0.0, np.inf, 0.0], 'not_finite'),
        ([0.0, 0.0], 'length'),
        ([[0.0, 0.0, 0.0]], 'length'),
    ],
)
def test_a_bad_task_velocity_is_left_aside(velocity, reason):
    supervisor = fed(FSM, velocity=ASKED)
    before = supervisor.step(0.0)

    assert supervisor.task_velocity(np.array(velocity), 0.01).reason == reason
    np.testing.assert_array_equal(supervisor.step(0.01).rates, before.rates)


def test_a_task_velocity_that_is_old_on_arrival_is_left_aside_with_its_age():
    supervisor = fed(FSM, now=1.0)
    notice = supervisor.task_velocity(np.array(ASKED), 1.0, 0.75)

    assert notice.reason == 'stale_task_velocity'
    assert '0.250 s old' in notice.text
    assert at_rest(supervisor.step(1.0))


def test_the_last_of_several_task_velocities_wins():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.task_velocity(np.array([0.0, 0.0, 0.5]), 0.0)

    np.testing.assert_allclose(supervisor.step(0.0).rates, 0.5, atol=1e-12)


@pytest.mark.parametrize('size', [1e10, 1e300, 1.7e308])
def test_a_huge_task_velocity_keeps_its_direction(size):
    for name in ('fsm_4_strut', 'mirror_4_strut'):
        supervisor = fed(mechanism_named(name), velocity=size * np.array([1.0, -0.5, 0.0]))
        output = supervisor.step(0.0)

        assert np.isfinite(output.rates).all()
        assert np.isfinite(output.residual).all()
        assert output.saturation
        direction = output.achieved / output.achieved[0]
        np.testing.assert_allclose(direction, [1.0, -0.5, 0, 0, 0, 0], atol=1e-9)
        limits = supervisor.mechanism.velocity_limits
        assert (np.abs(output.rates) <= limits * (1 + 1e-9)).all()


def test_pausing_holds_until_it_is_undone():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.pause(True, 0.0)
    held = supervisor.step(0.0)
    supervisor.pause(False, 0.0)

    assert (held.state, held.reason) == (State.HOLD, 'paused')
    assert at_rest(held)
    assert not held.input_lost
    assert supervisor.step(0.01).rates.any()


def test_a_failure_while_held_is_named_and_a_stop_wins():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.pause(True, 0.0)
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    assert supervisor.step(0.0).reason == 'paused; theta_4 stuck'

    supervisor.reports([report('stuck', 'theta_1')], 0.0)
    assert supervisor.step(0.0).state is State.STOPPED


def test_a_clock_set_back_holds_until_the_next_readings():
    supervisor = fed(FSM, now=1000.0, velocity=ASKED)
    assert supervisor.step(1000.0).rates.any()

    held = supervisor.step(3.0)
    assert held.state is State.HOLD
    assert held.reason == 'waiting for a joint state after the clock was set back'
    feed(supervisor, 3.01)
    resting = supervisor.step(3.01)
    assert resting.reason.endswith('waiting for a task velocity after the clock was set back')
    feed(supervisor, 3.02, ASKED)
    assert supervisor.step(3.02).rates.any()
    assert supervisor.step(9.0).reason == 'no usable joint state for 0.1 s'


def test_told_to_forget_times_it_holds_until_the_next_readings():
    supervisor = fed(FSM, velocity=ASKED)
    assert supervisor.step(0.0).rates.any()

    supervisor.restart_clock(0.0)

    assert supervisor.step(0.0).state is State.HOLD
    feed(supervisor, 0.01, ASKED)
    assert supervisor.step(0.01).rates.any()


def test_a_clock_set_forward_holds_until_the_next_readings():
    supervisor = fed(FSM, velocity=ASKED)

    assert supervisor.step(3600.0).state is State.HOLD
    feed(supervisor, 3600.01, ASKED)
    assert supervisor.step(3600.01).rates.any()


def test_joint_values_beyond_any_assembly_hold_with_the_reason():
    supervisor = fed(FSM, velocity=ASKED)
    where = np.radians([90.0, 0.0, 270.0, 180.0])
    tilted = np.sqrt(0.5) * 0.1 * (np.sin(where) - np.cos(where))
    feed(supervisor, 0.01, ASKED, tilted)
    held = supervisor.step(0.01)

    assert held.state is State.HOLD
    assert 'loops do not close' in held.reason
    feed(supervisor, 0.02, ASKED)
    assert supervisor.step(0.02).state is State.NOMINAL


def test_the_first_joint_values_may_be_beyond_any_assembly_too():
    supervisor = Supervisor(FSM)
    where = np.radians([90.0, 0.0, 270.0, 180.0])
    feed(supervisor, 0.0, ASKED, np.sqrt(0.5) * 0.2 * (np.sin(where) - np.cos(where)))

    assert 'loops do not close' in supervisor.step(0.0).reason
    feed(supervisor, 0.0, ASKED)
    assert supervisor.step(0.0).state is State.NOMINAL


def test_internal_errors_give_zeros_at_once_and_stop_in_the_end():
    supervisor = fed(FSM, velocity=ASKED)
    sound = supervisor.kernel
    failing(supervisor, 'command')
    outputs = [supervisor.step(0.0) for _ in range(MOST_ERRORS)]
    supervisor.kernel = sound
    after = supervisor.step(0.0)

    assert all(at_rest(output) for output in outputs)
    assert [output.state for output in outputs] == [State.HOLD, State.HOLD, State.STOPPED]
    assert all('internal error: RuntimeError: a?fault' in output.reason for output in outputs)
    assert after.state is State.STOPPED
    assert supervisor.clear(0.0).success
    assert supervisor.step(0.01).rates.any()


def test_a_reading_that_ends_in_an_internal_error_is_refused_with_a_notice():
    """Encoders that wrap are estimated in several turns where they are taken."""
    text = mechanism_path('planar_4rpr').read_text()
    mechanism = mechanism_from_text(
        text.replace('velocity: 0.5', 'velocity: 0.5, period: 0.2'))
    supervisor = fed(mechanism, velocity=[0.01, 0.0, 0.0])
    assert supervisor.step(0.0).rates.any()
    sound = supervisor.kernel
    failing(supervisor, 'estimate')
    supervisor.pause(False, 0.0)  # what comes now is looked for in all turns
    notice = supervisor.joint_reading(np.zeros(4), 0.01)
    assert (notice.reason, notice.rejected) == ('internal_error', True)
    assert 'RuntimeError: a?fault' in notice.text
    supervisor.kernel = sound
    assert supervisor.step(0.02).state is State.NOMINAL
    assert supervisor.step(0.2).state is State.HOLD
    feed(supervisor, 0.3, [0.01, 0.0, 0.0])
    assert supervisor.step(0.3).rates.any()


def test_internal_errors_that_pass_are_forgotten():
    supervisor = fed(FSM, velocity=ASKED)
    sound = supervisor.kernel
    for _ in range(2 * MOST_ERRORS):
        failing(supervisor, 'command')
        assert supervisor.step(0.0).state is State.HOLD
        supervisor.kernel = sound
        assert supervisor.step(0.0).state is State.NOMINAL


def test_a_failure_reported_during_internal_errors_is_not_lost():
    supervisor = fed(FSM, velocity=ASKED)
    sound = supervisor.kernel
    failing(supervisor, 'estimate')
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    assert at_rest(supervisor.step(0.0))
    supervisor.kernel = sound
    output = supervisor.step(0.0)

    assert output.state is State.DEGRADED
    assert output.rates[3] == 0.0


def test_a_command_that_is_not_finite_never_leaves():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.kernel = replace(
        supervisor.kernel, command=lambda *given: given[-2].fill(float('nan'))
    )
    output = supervisor.step(0.0)

    assert at_rest(output)
    assert 'the command is not finite' in output.reason


def test_what_is_moved_beside_the_task_ends_unless_it_is_asked_for_again():
    """A probe whose evaluation raises must not leave the drives to push against each other."""
    supervisor, beside = fed(FSM, 0.0), 1e-4 * np.array([1.0, -1.0, 1.0, -1.0])
    supervisor.task_velocity(np.zeros(3), 0.0)
    found = []
    supervisor.add_probe_rates(beside)
    for now in (0.0, 0.01, 0.02):
        feed(supervisor, now)
        found.append(supervisor.step(now).rates.copy())
        if now == 0.0:
            supervisor.add_probe_rates(beside)
            assert supervisor.step(now).rates.any()  # no answer to a reading
    np.testing.assert_array_equal(found, [beside, beside, np.zeros(4)])
    for wrong in (np.nan, np.inf):
        supervisor.add_probe_rates(wrong * beside)
        assert not supervisor.step(0.02).rates.any()
    # Rounding moves no stuck drive.
    supervisor.reports([report('stuck', 'theta_4')], 0.02)
    supervisor.step(0.02)
    supervisor.add_probe_rates(np.array([1e-4, -2e-4, 1e-4, 1e-23]))
    assert supervisor.step(0.02).rates.tolist() == [1e-4, -2e-4, 1e-4, 0.0]


def test_a_mechanism_given_by_numbers_is_controlled_too():
    mechanism = made(by_numbers())
    supervisor = fed(mechanism, velocity=ASKED)
    np.testing.assert_allclose(
        supervisor.step(0.0).rates, np.array([1, -2, -1, 2]) * 0.01 / np.sqrt(2), atol=1e-12
    )

    refused = supervisor.reports([report('lost', 'theta_4')], 0.0)
    assert not refused
    assert [notice.reason for notice in refused.notices] == ['refused_mode']
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    np.testing.assert_allclose(
        supervisor.step(0.0).rates, np.array([-1, -4, -3, 0]) * 0.01 / np.sqrt(2), atol=1e-12
    )


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('joint_state_timeout', 0.0),
        ('command_timeout', float('nan')),
        ('report_timeout', -1.0),
        ('stroke_gain', float('inf')),
        ('tolerance_threshold', 1.5),
        ('hold_below', 0.5),
        ('unknown_mode', 'panic'),
    ],
)
def test_bad_settings_are_named(name, value):
    with pytest.raises(ValueError, match=name):
        Settings(**{name: value})


NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
EVENTS = st.one_of(
    st.tuples(st.just('velocity'), st.lists(NUMBERS, min_size=3, max_size=3)),
    st.tuples(st.just('values'), st.lists(NUMBERS, min_size=4, max_size=4)),
    st.tuples(st.just('values'), st.lists(st.floats(-0.04, 0.04), min_size=4, max_size=4)),
    st.tuples(
        st.just('report'),
        st.tuples(
            st.sampled_from(['stuck', 'free', 'lost', 'none', 'jammed', '']),
            st.sampled_from([*FSM.actuator_names, *FSM.strut_names, None]),
        ),
    ),
    st.tuples(st.just('clear'), st.none()),
    st.tuples(st.just('pause'), st.booleans()),
    st.tuples(st.just('time'), st.floats(-5.0, 5.0)),
)


@settings(deadline=None, max_examples=60)
@given(st.lists(EVENTS, max_size=25))
def test_nothing_that_may_come_in_raises_or_gives_anything_but_finite_numbers(events):
    supervisor = Supervisor(mechanism_named('mirror_4_strut'))
    now = 0.0
    for kind, value in [('values', [0.0] * 4), ('velocity', ASKED), *events]:
        if kind == 'velocity':
            supervisor.task_velocity(np.array(value), now)
        elif kind == 'values':
            supervisor.joint_reading(np.array(value), now)
        elif kind == 'report':
            supervisor.reports([report(*value)], now)
        elif kind == 'clear':
            supervisor.clear(now)
        elif kind == 'pause':
            supervisor.pause(value, now)
        else:
            now += value
        output = supervisor.step(now)

        assert output.rates.shape == (4,)
        for array in (output.rates, output.achieved, output.residual):
            assert np.isfinite(array).all()
        assert 'internal error' not in output.reason
        assert output.reason
        moving = output.state in (State.NOMINAL, State.DEGRADED)
        assert moving or not output.rates.any()
        limits = supervisor.mechanism.velocity_limits
        assert (np.abs(output.rates) <= limits * (1 + 1e-9)).all()


def test_a_contradiction_is_remembered_while_loops_do_not_close():
    mirror = mechanism_named('mirror_4_strut')
    limit = 5e-3 * mirror.characteristic_length
    against = np.array([1.0, -1.0, 1.0, -1.0])
    supervisor = fed(mirror, velocity=[1e-3, 0.0, 0.0])
    for now, values, reason in (
        (0.01, 1.1 * limit * against, 'contradict'), (0.02, [1e3, 0.0, 0.0, 0.0], 'do not close'),
        (0.03, 0.9 * limit * against, 'contradict'), (0.04, 0.7 * limit * against, ''),
    ):
        feed(supervisor, now, [1e-3, 0.0, 0.0], values=np.array(values))
        output = supervisor.step(now)
        assert (output.state is State.HOLD) is bool(reason), output
        assert reason in output.reason
