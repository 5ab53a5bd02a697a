# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""J, T, J_xi, verdict and measures against the loop-closure model, derived again each time."""

import numpy as np
import pytest
from core import cases, reference
from core.mechanisms import made, random_machine
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.kinematics.measures import next_failure, present_measures
from fault_tolerance.mechanism.configuration import home_configuration

SAME = 1e-9
SIX = ('wx', 'wy', 'wz', 'vx', 'vy', 'vz')
# The smallest singular value of J_m over the largest: between these it is neither clearly zero
# nor clearly not, and two ways of computing it may judge differently.
DOUBT = (1e-11, 1e-6)

PLACES = [(name, place) for name in cases.NAMES for place in ('home', 'away')
          if place == 'home' or name in cases.RIGID]
everywhere = pytest.mark.parametrize(('name', 'place'), PLACES)


def configuration_of(name, place):
    return {'home': cases.home, 'away': cases.away}[place](name)


def determined(unactuated, mechanism):
    """Return the projection on the twists (scaled) that the drives determine."""
    basis, _ = np.linalg.qr(unactuated * reference.twist_scale(mechanism)[:, None])
    return np.eye(6) - basis @ basis.T


def in_doubt(*models):
    """Tell whether a major coordinate is nearly lost in one of the models."""
    for model in models:
        sizes = np.linalg.svd(model.major, compute_uv=False)
        if len(sizes) == len(model.major) and sizes[0] > 0.0:
            if DOUBT[0] < sizes[-1] / sizes[0] < DOUBT[1]:
                return True
    return False


def assert_same(found, expected, tolerance=SAME):
    """Compare everything that is unique about J, T and J_xi."""
    mechanism = expected.mechanism
    assert found.mapping.shape == expected.mapping.shape
    assert found.unactuated.shape == expected.unactuated.shape
    size = max(1.0, np.abs(expected.jacobian).max(initial=0.0))
    projection = determined(expected.unactuated, mechanism)
    scaled = reference.twist_scale(mechanism)[:, None] * found.twist_jacobian / size
    pairs = [
        (found.mapping @ found.mapping.T, expected.mapping @ expected.mapping.T),
        (determined(found.unactuated, mechanism), projection),
        (found.twist_jacobian / size @ found.mapping.T,
         expected.shortest / size @ expected.mapping.T),
        # The paper's own J differs from that only by motions that no drive determines.
        (projection @ scaled @ found.mapping.T,
         projection @ (reference.twist_scale(mechanism)[:, None] * expected.jacobian / size)
         @ expected.mapping.T),
    ]
    for ours, theirs in pairs:
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=tolerance)
    np.testing.assert_array_equal(found.jacobian, found.twist_jacobian[mechanism.task.rows])


@everywhere
def test_model_and_verdict(name, place):
    configuration = configuration_of(name, place)
    mechanism, values = configuration.mechanism, cases.joint_values(configuration)
    nominal = reference.model(mechanism, values)
    task = mechanism.task.by_priority
    order = [*task, *(coordinate for coordinate in SIX if coordinate not in task)]
    before = reference.independent_coordinates(nominal, order)
    for failures in cases.failure_lists(mechanism):
        state = cases.state(configuration, failures)
        expected = reference.model(mechanism, values, failures)
        assert_same(state.present, expected)
        verdict = state.verdict
        assert (verdict.stable, verdict.mobility) == (expected.stable, expected.mapping.shape[1])
        if in_doubt(expected):
            continue
        after = reference.independent_coordinates(expected, order)
        lost = tuple(each for each in task if each in before and each not in after)
        gained = tuple(each for each in order if each in after and each not in before)
        judged = (verdict.tolerable, verdict.lost, verdict.gained)
        assert judged == (expected.tolerable, lost, gained), failures


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None, derandomize=True)  # some are nearly singular
def test_random_machines(seed):
    """Whatever somebody may write in a file, sensible or not."""
    mechanism = made(random_machine(seed))
    configuration = home_configuration(mechanism)
    values = np.zeros(sum(len(strut.joints) for strut in mechanism.struts))
    for failures in cases.failure_lists(mechanism, most=6)[:: 3]:
        state = cases.state(configuration, failures)
        expected = reference.model(mechanism, values, failures)
        assert_same(state.present, expected, tolerance=1e-7)
        assert state.verdict.stable == expected.stable
        if not in_doubt(expected):
            assert state.verdict.tolerable == expected.tolerable
        ahead = next_failure(state)
        measures = np.concatenate([ahead.position, ahead.torque, ahead.hard])
        assert ((measures >= 0.0) & (measures <= 1.0 + 1e-6) | np.isnan(measures)).all()


@everywhere
def test_present_measures(name, place):
    configuration = configuration_of(name, place)
    mechanism, values = configuration.mechanism, cases.joint_values(configuration)
    nominal = reference.model(mechanism, values)
    order = len(nominal.major)
    for failures in cases.failure_lists(mechanism, most=20):
        stuck = [failure for failure in failures if failure[0] == 'position']
        free = [failure for failure in failures if failure[0] == 'torque']
        locked = reference.model(mechanism, values, stuck)
        freed = reference.model(mechanism, values, stuck + free)
        broken = reference.model(mechanism, values, failures)
        if in_doubt(locked, freed, broken):
            continue
        found = present_measures(cases.state(configuration, failures))
        places = [mechanism.actuator_index(actuator) for _, actuator in free]
        retained = 0.0
        if broken.tolerable:
            retained = reference.largest_product(broken.major, order)
            retained /= reference.largest_product(nominal.major, order)
        sizes = np.linalg.svd(broken.major, compute_uv=False)
        expected = (
            reference.position_measure(nominal, locked),
            reference.torque_measure(locked, places),
            reference.hard_measure(freed, broken) if broken is not freed else 1.0,
            retained,
            sizes[-1] if len(sizes) == order else 0.0,
        )
        if not any(failure[0] == 'hard' for failure in failures):
            expected = (*expected[:2], 1.0, *expected[3:])
        measured = (found.position, found.torque, found.hard, found.retained_manipulability,
                    found.smallest_singular_value)
        assert measured == pytest.approx(expected, abs=1e-7, rel=1e-7), failures


@everywhere
def test_next_failure(name, place):
    configuration = configuration_of(name, place)
    mechanism, values = configuration.mechanism, cases.joint_values(configuration)
    singles = cases.single_failures(mechanism)
    for present in ([], *([single] for single in singles[:: max(1, len(singles) // 2)])):
        before = reference.model(mechanism, values, present)
        if not before.stable:
            continue
        found = next_failure(cases.state(configuration, present))
        of_mode = {
            'position': dict(zip(mechanism.actuator_names, found.position, strict=True)),
            'torque': dict(zip(mechanism.actuator_names, found.torque, strict=True)),
            'hard': dict(zip(mechanism.strut_names, found.hard, strict=True)),
        }
        for mode, failed in singles:
            measure = of_mode[mode][failed]
            if has_failed(mechanism, present, mode, failed):
                assert np.isnan(measure), (present, mode, failed)
                continue
            after = reference.model(mechanism, values, [*present, (mode, failed)])
            if in_doubt(before, after):
                continue
            if mode == 'position':
                expected = reference.position_measure(before, after)
            elif mode == 'torque':
                place = mechanism.actuator_index(failed)
                expected = reference.torque_measure(before, [place])
            else:
                expected = reference.hard_measure(before, after)
            assert measure == pytest.approx(expected, abs=1e-7), (present, mode, failed)


def has_failed(mechanism, present, mode, name):
    lost = {failed for kind, failed in present if kind == 'hard'}
    if mode == 'hard':
        return name in lost
    return ('position', name) in present or ('torque', name) in present \
        or mechanism.strut_of(name) in lost


@pytest.mark.parametrize('tilt', [(0.0, 0.0), (0.02, 0.0), (0.0, 0.03), (0.02, 0.03)])
def test_with_compliance(tilt):
    configuration = cases.tilted('fsm_4_strut', *tilt)
    mechanism, values = configuration.mechanism, cases.joint_values(configuration)
    origin = configuration.pose[:3, 3]
    for failures in cases.failure_lists(mechanism):
        lost = [failed for mode, failed in failures if mode == 'hard']
        if len(lost) == len(mechanism.struts):
            continue
        found = cases.state(configuration, failures).present
        expected = reference.absorbing_model(mechanism, values, origin, failures)
        assert found.mapping.shape == expected.mapping.shape
        assert found.stable == expected.stable
        np.testing.assert_allclose(
            found.mapping @ found.mapping.T, expected.mapping @ expected.mapping.T, atol=1e-8
        )
        projection = determined(expected.unactuated, mechanism)
        scale = reference.twist_scale(mechanism)[:, None]
        np.testing.assert_allclose(determined(found.unactuated, mechanism), projection, atol=1e-8)
        np.testing.assert_allclose(
            projection @ (scale * found.twist_jacobian) @ found.mapping.T,
            projection @ (scale * expected.jacobian) @ expected.mapping.T,
            atol=1e-8,
        )
