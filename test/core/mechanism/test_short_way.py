# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The short way (inverted struts, chord steps) comes to what the definitions come to."""

from dataclasses import replace

import numpy as np
import pytest
from core import cases
from core.control.control_cases import fed
from core.mechanisms import even_mirror, made, random_machine
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.control.reports import ERROR, Report
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism import state as state_module
from fault_tolerance.mechanism import tracking
from fault_tolerance.mechanism.attachment import attachment_of
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.closure import Closure
from fault_tolerance.mechanism.configuration import fitted_configuration, home_configuration
from fault_tolerance.mechanism.generators import evenly_spaced_mirror
from fault_tolerance.mechanism.regular import RegularStruts
from fault_tolerance.mechanism.screws import displaced, displaced_by
from fault_tolerance.mechanism.state import evaluated, state_by_definition
from fault_tolerance.tolerances import CLOSURE_TOLERANCE

SHIPPED = ('fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated', 'mirror_4_strut',
           'mirror_overactuated', 'gough_stewart_6', 'gough_stewart_8', 'planar_4rpr')
CERTAIN = 0.01
"""Motions up to this size bring no strut near its own singularity, from where the definition is
taken; larger ones may (0.03 sometimes does with a strut of ``rooted_hexapod``)."""
REGULAR = (*SHIPPED, 'uneven_mirror', 'hexapod_8', 'guided_mirror', 'rooted_hexapod',
           'tipped_platform', 'one_drive', 'bennett')
ELSEWHERE = ('spinning_hexapod', 'serial_7r', 'two_stage_mirror', 'two_stage_hexapod')


def moved_state(mechanism, rng, size, closed):
    """Return chains, pose and joint values somewhere, with loops closed or quite open."""
    chains = chains_of(mechanism)
    length = mechanism.characteristic_length
    if closed:
        start = home_configuration(mechanism)
        readings = start.actuator_values + size * rng.normal(size=len(mechanism.actuators)) * (
            mechanism.rate_scale if (mechanism.rate_scale != 1.0).all() else length
        )
        found = fitted_configuration(mechanism, readings)
        return chains, np.array(found.pose), np.array(found.joint_values)
    twist = size * rng.normal(size=6) * [1, 1, 1, length, length, length]
    values = size * length * rng.normal(size=chains.real.shape) * chains.real
    return chains, displaced(np.array(chains.home), twist), values


def by_projection(rows, struts, count):
    """Return what rows of each strut span, (s, 6, 6)."""
    result = np.zeros((count, 6, 6))
    np.add.at(result, struts, rows[:, :, None] * rows[:, None, :])
    return result


def assert_the_same(chains, pose, values, atol=1e-9, certain=True):
    mechanism_length = chains.length
    exact = state_by_definition(chains, pose, values)
    found = evaluated(chains, pose, values, chains.regular)
    assert found.constraints.inverses is not None or not certain
    np.testing.assert_allclose(found.openings, exact.openings, atol=1e-12 * max(
        1.0, mechanism_length, float(np.abs(exact.openings).max())))
    np.testing.assert_array_equal(
        found.constraints.structure_strut, exact.constraints.structure_strut)
    spans = [
        by_projection(each.constraints.structure, each.constraints.structure_strut, len(values))
        for each in (found, exact)
    ]
    np.testing.assert_allclose(*spans, atol=atol)
    rows = [each.constraints.actuator_rows for each in (found, exact)]
    assert (rows[0] is None) == (rows[1] is None)
    if rows[1] is not None:
        np.testing.assert_allclose(*rows, atol=atol * max(1.0, float(np.abs(rows[1]).max())))
    return found, exact


@given(
    name=st.sampled_from(REGULAR),
    seed=st.integers(0, 2**32 - 1),
    size=st.sampled_from([0.0, 1e-8, 1e-6, 1e-3, 0.03, 0.2]),
    closed=st.booleans(),
)
@settings(max_examples=150, deadline=None)
def test_rows_as_defined(name, seed, size, closed):
    mechanism = cases.named(name)
    state = moved_state(mechanism, np.random.default_rng(seed), size, closed)
    assert_the_same(*state, certain=size < CERTAIN)


@pytest.mark.parametrize('name', ELSEWHERE)
def test_other_struts_are_left_to_the_definition(name):
    mechanism = cases.named(name)
    assert chains_of(mechanism).regular is None
    assert home_configuration(mechanism).constraints.inverses is None


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_random_machines_take_it_only_where_it_is_right(seed):
    mechanism = made(random_machine(seed))
    chains = chains_of(mechanism)
    pose, values = np.array(chains.home), np.zeros(chains.real.shape)
    exact = state_by_definition(chains, pose, values)
    found = evaluated(chains, pose, values, chains.regular)
    if found.constraints.inverses is None:
        return
    spans = [
        by_projection(each.constraints.structure, each.constraints.structure_strut, len(values))
        for each in (found, exact)
    ]
    np.testing.assert_allclose(*spans, atol=1e-9)
    rows = found.constraints.actuator_rows, exact.constraints.actuator_rows
    assert rows[1] is not None
    np.testing.assert_allclose(*rows, rtol=1e-9, atol=1e-9 * np.abs(rows[1]).max())


@pytest.mark.parametrize('name', REGULAR)
def test_kinematics_as_defined_with_anything_failed(name):
    """J and T by what is unique in them, whichever rows they come from."""
    mechanism = cases.named(name)
    chains, pose, values = moved_state(mechanism, np.random.default_rng(5), 0.02, True)
    found, exact = assert_the_same(chains, pose, values)
    home = strut_rows(home_configuration(mechanism))
    for failures in cases.failure_lists(mechanism, 6):
        failed = failure_set(mechanism, failures)
        one, other = (
            differential_kinematics(replace(home, constraints=each.constraints), failed)
            for each in (found, exact)
        )
        assert one.mobility == other.mobility and one.absorbed == other.absorbed
        assert one.unactuated.shape == other.unactuated.shape
        assert one.weakest_kept == pytest.approx(other.weakest_kept, abs=1e-9)
        np.testing.assert_allclose(
            one.mapping @ one.mapping.T, other.mapping @ other.mapping.T, atol=1e-9)
        size = max(1.0, float(np.abs(other.twist_jacobian).max(initial=0.0)))
        np.testing.assert_allclose(
            one.twist_jacobian @ one.mapping.T, other.twist_jacobian @ other.mapping.T,
            atol=1e-9 * size)


@given(
    name=st.sampled_from(sorted({*REGULAR} - {'fsm_4_strut', 'mirror_4_strut'})),
    seed=st.integers(0, 2**32 - 1),
    step=st.sampled_from([0.0, 1e-7, 1e-5, 1e-3, 1e-2]),
    losses=st.integers(0, 1),
)
@settings(max_examples=100, deadline=None)
def test_chord_steps_lead_where_newton_steps_lead(name, seed, step, losses):
    mechanism, rng = cases.named(name), np.random.default_rng(seed)
    start = cases.away(name)
    lost = list(rng.choice(mechanism.strut_names, losses, replace=False))
    size = step * mechanism.characteristic_length
    target = start.actuator_values + size * rng.normal(size=len(mechanism.actuators))
    attachment = attachment_of(mechanism, lost)
    closed = tracking.tracked(start.state, target, attachment, mechanism.compliance, 1e-7)
    slow = Closure(mechanism, lost).solved(start.state, target, nearest_home=False)
    for _ in range(5):  # readings in contradiction are approached slowly
        slow = Closure(mechanism, lost).solved(slow.state, target, nearest_home=False)
    if closed is None or not slow.converged:
        return  # left to the long way
    assert closed.closes and closed.open[0] <= CLOSURE_TOLERANCE
    misfit = np.abs(target - slow.state.actuator_values)[attachment.held].max(initial=0.0)
    # Steps get shorter by a factor only where readings contradict each other: where they end,
    # at 1e-7 here, there is as much left again, or a little more.
    agreed = misfit <= 1e-9
    np.testing.assert_allclose(
        closed.state.pose, slow.state.pose, atol=2e-7 if agreed else 1e-6)
    values = closed.state.actuator_values, slow.state.actuator_values
    np.testing.assert_allclose(
        *(each[attachment.held] for each in values), atol=1e-9 if agreed else 1e-6)
    # A lost strut's joints only follow the platform, a step behind.
    np.testing.assert_allclose(*values, atol=1e-5)
    certificate = Closure(mechanism, lost).certified(closed.state, True, 1)
    assert closed.open == certificate.open


@pytest.mark.parametrize('tilt', [0.0, 1e-6, 1e-3, 0.02, 0.049, 0.06, 0.074, 0.1])
def test_at_and_off_the_constraint_singularity(tilt):
    """The four-strut mirror: constraints come, are absorbed, and count again."""
    mechanism = mechanism_named('fsm_4_strut')
    radius = mechanism.characteristic_length
    target = radius * tilt * np.array([1.0, -1.0, -1.0, 1.0])
    start = fitted_configuration(mechanism, 0.98 * target)
    attachment = attachment_of(mechanism)
    closed = tracking.tracked(start.state, target, attachment, mechanism.compliance, 1e-4)
    slow = Closure(mechanism, ()).solved(start.state, target, nearest_home=False)
    if closed is not None:
        assert slow.converged
        assert closed.open[1] == pytest.approx(slow.open[1], abs=1e-9)
        np.testing.assert_allclose(closed.state.pose, slow.state.pose, atol=1e-8)
    found = fitted_configuration(mechanism, target, start=start)
    assert found.converged == slow.converged


def stretched_arms():
    """Return two arms of three hinges that hold a plate, one of them nearly straight."""
    joints = []
    for index, (x, bend) in enumerate([(-1.0, 0.4), (1.0, 1e-5)], start=1):
        points = [(x, 0.0, 0.0), (x + bend, 0.5, 0.0), (x, 1.0, 0.0)]
        joints.append({
            'name': f'arm_{index}',
            'joints': [
                {'name': f'hinge_{index}_{place}', 'type': 'revolute', 'axis': [0, 0, 1],
                 'point': list(point), 'actuated': place < 2}
                for place, point in enumerate(points)
            ],
        })
    return {
        'mechanism': 'stretched', 'platform': {'origin': [0, 1, 0]},
        'task': {'coordinates': ['vx', 'vy', 'wz']}, 'struts': joints,
    }


def test_struts_that_are_nearly_singular_are_left_to_the_definition():
    mechanism = made(stretched_arms())
    assert chains_of(mechanism).regular is None
    # A strut that becomes singular on the way is noticed there.
    sound = made(even_mirror(3))
    chains = chains_of(sound)
    values = np.zeros(chains.real.shape)
    values[0, 3] = np.pi / 2.0  # the ball's middle axis: gimbal lock
    assert evaluated(chains, np.array(chains.home), values, chains.regular).constraints.inverses \
        is None
    values[0, 3] -= 1e-2
    assert_the_same(chains, np.array(chains.home), values)


def test_what_fills_the_gap_is_made_anew_far_from_home():
    mechanism = mechanism_named('fsm_3_strut')
    chains = chains_of(mechanism)
    turned = displaced(np.array(chains.home), np.array([0.0, 0.0, np.pi / 2, 0.0, 0.0, 0.0]))
    values = np.zeros(chains.real.shape)
    values[:, 0] = np.pi / 2.0
    first = evaluated(chains, turned, values, chains.regular)
    if first.constraints.inverses is None:
        assert first.regular is not None and first.regular is not chains.regular
        again = evaluated(chains, turned, values, first.regular)
        assert again.constraints.inverses is not None
        np.testing.assert_allclose(
            by_projection(again.constraints.structure, again.constraints.structure_strut, 3),
            by_projection(first.constraints.structure, first.constraints.structure_strut, 3),
            atol=1e-9)
    else:
        assert_the_same(chains, turned, values)


def test_poses_stay_orthonormal():
    pose, rng = np.eye(4), np.random.default_rng(0)
    for _ in range(3000):
        pose = displaced_by(pose, 0.3 * rng.normal(size=6), 0.7)
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-15)
    np.testing.assert_array_equal(pose[3], [0, 0, 0, 1])


@given(st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
       st.sampled_from([0.0, 1e-9, 1e-4, 1e-3, 1.0, 3.0]), st.sampled_from([0.02, 1.0, 5.0]))
@settings(deadline=None)
def test_displaced_either_way(numbers, size, length):
    displacement = size * np.array(numbers)
    pose = displaced(np.eye(4), np.array([0.3, -0.2, 0.5, 1.0, 2.0, 3.0]))
    scaled = displacement * [length, length, length, 1, 1, 1]
    np.testing.assert_allclose(
        displaced_by(pose, scaled, length), displaced(pose, displacement), atol=1e-13)


class Calls:
    """Counts calls of functions while it lets them through."""

    def __init__(self, monkeypatch):
        self.numbers = {}
        self._monkeypatch = monkeypatch

    def of(self, owner, name):
        function, self.numbers[name] = getattr(owner, name), 0

        def counted(*args, **more):
            self.numbers[name] += 1
            return function(*args, **more)

        self._monkeypatch.setattr(owner, name, counted)


@pytest.mark.parametrize('failures', [(), [('position', 'theta_4')], [('torque', 'theta_2')],
                                      [('hard', 'strut_3')]])
def test_a_warm_cycle_evaluates_once(monkeypatch, failures):
    """Scanning slowly: one placement of the struts, one inversion, no definition."""
    supervisor = fed(mechanism_named('mirror_4_strut'), velocity=[1e-3, 0.0, 0.0])
    supervisor.reports([Report(('d', n), n, m, ERROR, None) for m, n in failures], 0.0)
    supervisor.step(0.0)
    calls = Calls(monkeypatch)
    calls.of(RegularStruts, 'placed')
    calls.of(RegularStruts, 'inverted')
    calls.of(state_module, 'strut_constraints')
    calls.of(Closure, 'solved')
    for tick in range(1, 21):
        tilt = 1e-5 * tick
        values = 0.02 * tilt * np.array([1.0, -1.0, -1.0, 1.0])
        assert supervisor.joint_reading(values, 1e-3 * tick) is None
        assert supervisor.task_velocity(np.array([1e-3, 0.0, 0.0]), 1e-3 * tick) is None
        assert supervisor.step(1e-3 * tick).rates.any()
    assert calls.numbers == {
        'placed': 20, 'inverted': 20, 'strut_constraints': 0, 'solved': 0
    }


def test_nothing_in_a_cycle_grows_with_the_square_of_the_struts():
    """Everything kept of a configuration of 256 struts is a few numbers a strut."""
    configuration = home_configuration(evenly_spaced_mirror(256))
    state = configuration.state
    found = fitted_configuration(configuration.mechanism, np.full(256, 1e-5), start=configuration)
    rows = strut_rows(found)
    kinematics = differential_kinematics(rows)
    arrays = [
        *(value for each in (state, found.state.constraints, found.state.constraints.inverses,
                             kinematics)
          for value in vars(each).values() if isinstance(value, np.ndarray))
    ]
    assert max(array.size for array in arrays) <= 256 * 64
