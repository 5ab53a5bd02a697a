# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Resolved rates: the major task exactly, the secondary as well as can be, never beyond reason."""

from dataclasses import replace

import numpy as np
import pytest
from core.mechanisms import DOCUMENTS, by_numbers, made
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.errors import ArrayError
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.task_priority import resolved_rate
from fault_tolerance.tolerances import POOR_BELOW, SINGULAR_BELOW

FSM = mechanism_named('fsm_4_strut')
ASKED = np.array([0.01, 0.02, 0.0])


def kinematics(mechanism, *failures):
    return differential_kinematics(home_rows(mechanism), failure_set(mechanism, failures))


def test_the_papers_mirror_healthy_and_with_strut_4_stuck():
    healthy = resolved_rate(kinematics(FSM), ASKED)
    stuck = resolved_rate(kinematics(FSM, ('position', 'theta_4')), ASKED)

    expected = np.array([1.0, -2.0, -1.0, 2.0]) * 0.01 / np.sqrt(2.0)
    np.testing.assert_allclose(healthy.rates, expected, atol=1e-15)
    np.testing.assert_allclose(healthy.residual, 0.0, atol=1e-15)
    recovered = np.array([-1.0, -4.0, -3.0, 0.0]) * 0.01 / np.sqrt(2.0)
    np.testing.assert_allclose(stuck.rates, recovered, atol=1e-15)
    assert stuck.rates[3] == 0.0
    np.testing.assert_allclose(stuck.achieved, [0.01, 0.02, -0.02 / np.sqrt(2.0)], atol=1e-15)
    np.testing.assert_allclose(stuck.residual, [0.0, 0.0, 0.02 / np.sqrt(2.0)], atol=1e-15)


def test_the_twist_is_the_whole_platforms():
    found = resolved_rate(kinematics(FSM), np.array([0.01, 0.02, 0.3]))
    np.testing.assert_allclose(found.twist, [0.01, 0.02, 0.0, 0.0, 0.0, 0.3], atol=1e-15)

    by_number = resolved_rate(kinematics(made(by_numbers())), np.array([0.01, 0.02, 0.3]))
    np.testing.assert_allclose(by_number.twist, [0.01, 0.02, 0.0, 0.0, 0.0, 0.3], atol=1e-15)


def test_a_free_actuator_follows_and_a_lost_one_rests():
    free = resolved_rate(kinematics(FSM, ('torque', 'theta_4')), ASKED)
    lost = resolved_rate(kinematics(FSM, ('hard', 'strut_4')), ASKED)
    healthy = resolved_rate(kinematics(FSM), ASKED)

    np.testing.assert_allclose(free.rates, healthy.rates, atol=1e-15)
    np.testing.assert_allclose(lost.rates[:3], healthy.rates[:3], atol=1e-15)
    assert lost.rates[3] == 0.0


def test_what_is_lost_is_met_by_least_squares():
    present = kinematics(FSM, ('position', 'theta_1'), ('position', 'theta_2'))
    found = resolved_rate(present, np.array([1.0, 0, 0]))

    assert found.rank == 1
    assert found.transmission == 0.0
    major = present.major
    best, *_ = np.linalg.lstsq(major, np.array([1.0, 0.0]), rcond=None)
    np.testing.assert_allclose(found.achieved[:2], major @ best, atol=1e-12)


@pytest.mark.parametrize('failed', [('position', 'all'), ('hard', 'all')], ids=str)
def test_with_everything_failed_nothing_moves(failed):
    names = FSM.actuator_names if failed[0] == 'position' else FSM.strut_names
    found = resolved_rate(kinematics(FSM, *((failed[0], name) for name in names)), ASKED)

    assert found.rank == 0
    np.testing.assert_array_equal(found.rates, np.zeros(4))
    np.testing.assert_array_equal(found.residual, ASKED)


def test_the_certificate_is_of_the_major_jacobian():
    found = resolved_rate(kinematics(FSM, ('position', 'theta_4')), ASKED)

    assert found.rank == 2
    assert found.transmission == pytest.approx(1.0 / np.sqrt(3.0), abs=1e-12)


@pytest.mark.parametrize('factor', [1e300, 1.7e308, 1e-300, 5e-324])
def test_the_size_of_a_velocity_neither_overflows_nor_turns_it(factor):
    asked = np.array([factor, -factor, 0.0])
    found = resolved_rate(kinematics(FSM), asked)

    assert np.isfinite(found.rates).all()
    assert np.isfinite(found.twist).all()
    direction = found.achieved / np.max(np.abs(found.achieved))
    np.testing.assert_allclose(direction, [1.0, -1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize('bad', [[1.0, 2.0], [0.0, np.nan, 0.0], [np.inf, 0.0, 0.0]])
def test_a_velocity_that_cannot_be_meant_is_refused(bad):
    with pytest.raises(ArrayError, match='task velocity'):
        resolved_rate(kinematics(FSM), np.array(bad))


def near_singular(smallest: float, secondary: float = 1.0):
    """Return kinematics whose second major direction has the transmission ``smallest``."""
    whole = kinematics(made(by_numbers()))
    squeeze = np.diag([1.0, smallest, secondary])
    return replace(
        whole, jacobian=squeeze @ whole.jacobian, twist_jacobian=squeeze @ whole.twist_jacobian
    )


@pytest.mark.parametrize('transmission', [10.0, 2.0, 1.999, 1.5, 1.001, 0.999, 0.0])
def test_a_poor_secondary_direction_fades_out_and_the_major_task_stays(transmission):
    gain = transmission * POOR_BELOW
    found = resolved_rate(near_singular(1.0, 2.0 * gain), np.array([0.01, 0.02, 0.03]))

    share = min(max(transmission - 1.0, 0.0), 1.0)
    np.testing.assert_allclose(found.residual, [0.0, 0.0, 0.03 * (1.0 - share)], atol=1e-15)
    major = resolved_rate(near_singular(1.0, 2.0 * gain), np.array([0.01, 0.02, 0.0]))
    assert np.linalg.norm(found.rates - major.rates) <= 1.0001 * 0.03 / POOR_BELOW


def test_a_tiny_singular_value_is_never_inverted():
    above = resolved_rate(near_singular(1.01 * SINGULAR_BELOW), np.array([0.0, 1.0, 0.0]))
    below = resolved_rate(near_singular(0.99 * SINGULAR_BELOW), np.array([1.0, 1.0, 0.0]))

    assert above.rank == 2
    np.testing.assert_allclose(above.achieved, [0.0, 1.0, 0.0], atol=1e-12)
    assert below.rank == 1
    assert below.transmission == pytest.approx(0.99 * SINGULAR_BELOW)
    assert above.transmission == pytest.approx(1.01 * SINGULAR_BELOW)
    np.testing.assert_allclose(below.achieved, [1.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(below.residual[1], 1.0, atol=1e-6)
    assert np.abs(below.rates).max() < 1.0


def test_transmission_does_not_depend_on_the_units_of_the_drives():
    """A mirror that is twenty times smaller, with rotary drives too, is no nearer singularity."""
    found = []
    for name in ('fsm_overactuated', 'mirror_overactuated'):
        mechanism = mechanism_named(name)
        rows = home_rows(mechanism)
        found.append(
            resolved_rate(
                differential_kinematics(rows),
                np.zeros(3),
                characteristic_length=mechanism.characteristic_length,
                rate_scale=rows.rate_scale,
            ).transmission
        )

    assert found[0] == pytest.approx(found[1], rel=1e-6)


MECHANISMS = {name: made(document()) for name, document in DOCUMENTS.items()}


def single_failures(mechanism):
    yield ()
    for mode in ('position', 'torque'):
        for name in mechanism.actuator_names:
            yield ((mode, name),)
    for name in mechanism.strut_names:
        yield (('hard', name),)


@pytest.mark.parametrize('name', sorted(DOCUMENTS))
def test_priorities_hold_for_every_tolerated_single_failure(name):
    mechanism = MECHANISMS[name]
    rows = home_rows(mechanism)
    task = mechanism.task
    rng = np.random.default_rng(3)
    checked = 0
    for failures in single_failures(mechanism):
        post = reconfigured(rows, failure_set(mechanism, failures))
        if not post.verdict.tolerable:
            continue
        checked += 1
        asked = rng.standard_normal(len(task.coordinates))
        found = resolved_rate(
            post.present,
            asked,
            characteristic_length=mechanism.characteristic_length,
            rate_scale=rows.rate_scale,
        )
        present = post.present
        # The major task is met, whatever the secondary part asks for.
        np.testing.assert_allclose(found.residual[task.major_rows], 0.0, atol=1e-9)
        # The drives that are left move within range(T).
        active = found.rates[present.active]
        mapping = present.mapping[present.active]
        inside = mapping @ (mapping.T @ active)
        np.testing.assert_allclose(active, inside, atol=1e-12 * max(1.0, np.abs(active).max()))
        # No motion in the null space of the major task would serve the secondary part better.
        _, sigma, right = np.linalg.svd(present.major)
        free = right[int((sigma > 1e-9).sum()) :].T
        scale = rows.twist_scale[rows.task_rows][task.secondary_rows, None]
        _, gains, ways = np.linalg.svd(present.secondary @ free * scale)
        best = np.linalg.svd(rows.twist_scale[rows.task_rows][task.major_rows, None]
                             * present.major)[1].max()
        # Of those, that is, that are not poor.
        rich = free @ ways[: len(gains)][gains > 2.0 * POOR_BELOW * best].T
        slope = (present.secondary @ rich * scale).T @ (
            scale[:, 0] * found.residual[task.secondary_rows]
        )
        np.testing.assert_allclose(slope, 0.0, atol=1e-9)
    assert checked


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3),
    st.floats(0.0, 1.0),
    st.sampled_from([(), (('position', 'theta_1'),), (('hard', 'strut_2'),)]),
)
def test_rates_are_linear_in_the_velocity_and_give_what_they_say(asked, share, failures):
    present = kinematics(FSM, *failures)
    whole = resolved_rate(present, np.array(asked))
    part = resolved_rate(present, share * np.array(asked))

    np.testing.assert_allclose(part.rates, share * whole.rates, atol=1e-9)
    np.testing.assert_allclose(whole.residual, np.array(asked) - whole.achieved, atol=1e-12)
    reduced = np.linalg.pinv(present.rate_map) @ whole.rates
    np.testing.assert_allclose(present.jacobian @ reduced, whole.achieved, atol=1e-9)


def test_scales_of_the_wrong_length_are_refused():
    with pytest.raises(ArrayError, match='rate_scale'):
        resolved_rate(kinematics(FSM), ASKED, rate_scale=np.ones(3))


def test_results_cannot_be_changed():
    found = resolved_rate(kinematics(FSM), ASKED)

    for array in (found.velocity, found.rates, found.achieved, found.twist, found.residual):
        with pytest.raises(ValueError, match='read-only'):
            array[0] = 1.0
