# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The measure t is also that of what can be noticed: docs/detection.md, section 2."""

from functools import cache

import numpy as np
import pytest
from core.cases import away, home
from core.mechanisms import made, random_machine
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.detection.hypotheses import HEALTHY, Hypothesis, Symptom
from fault_tolerance.detection.responses import relative_stiffness, responses
from fault_tolerance.detection.separation import self_stress, separations, task_motions
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named

PLACES = {
    (name, where): (home if where == 'home' else away)(name)
    for name in ('mirror_overactuated', 'hexapod_8', 'planar_4rpr', 'guided_mirror')
    for where in ('home', 'away')
}


@cache
def usable_seeds():
    """Return random machines whose drives move the platform, with some to spare."""
    found = []
    for seed in range(80):
        rows = home_rows(made(random_machine(seed)))
        present = reconfigured(rows, FailureSet()).present
        count, mobility = present.mapping.shape
        if present.stable and 0 < mobility < count:
            found.append(seed)
    return found


def area(pair):
    """Return t_ij: the root of Gram's determinant of two rows of W^T."""
    sigma = np.linalg.svd(pair, compute_uv=False)
    return sigma[0] * sigma[1] if pair.shape[1] > 1 else 0.0


def check(rows):
    mechanism, none = rows.mechanism, FailureSet()
    nominal = reconfigured(rows, none)
    present = nominal.present
    strains, motions = self_stress(rows, present), task_motions(rows, present)
    count = len(mechanism.actuators)
    np.testing.assert_allclose(strains.T @ strains, np.eye(strains.shape[1]), atol=1e-9)
    np.testing.assert_allclose(motions.T @ strains, 0.0, atol=1e-9)
    shown = np.linalg.norm(strains, axis=1)

    # A reading that jumps is contradicted by the others as far as t_i says.
    checked = np.eye(count) - motions @ motions.T
    np.testing.assert_allclose(np.linalg.norm(checked, axis=0), shown, atol=1e-9)
    for i in range(count):
        for j in range(i):
            seen = np.linalg.svd(checked[:, [i, j]], compute_uv=False)
            assert area(strains[[i, j]]) == pytest.approx(seen[0] * seen[1], abs=1e-9)
    if mechanism.has_uniform_rate_scale:
        np.testing.assert_allclose(nominal.next_failure.torque, shown, atol=1e-6)
    return strains, shown


@pytest.mark.parametrize(('name', 'where'), PLACES)
def test_an_encoder_is_checked_as_far_as_its_drive_may_go_limp(name, where):
    check(strut_rows(PLACES[name, where]))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_the_same_for_random_machines(number):
    seeds = usable_seeds()
    assert len(seeds) >= 10
    check(home_rows(made(random_machine(seeds[number % len(seeds)]))))


@pytest.mark.parametrize(('name', 'where'), [
    (name, where) for name, where in PLACES if name in ('hexapod_8', 'planar_4rpr')
])
def test_what_a_probe_shows_of_equal_springs(name, where):
    """Stuck: -K0 e_i u_i; free: the same over t_i^2; lost pairs apart iff t_ij > 0."""
    configuration = PLACES[name, where]
    rows, mechanism = strut_rows(configuration), configuration.mechanism
    assert set(relative_stiffness(mechanism)) == {1.0}
    strains, shown = check(rows)
    names = mechanism.actuator_names
    suspects = [
        HEALTHY, *(Hypothesis(Symptom.STUCK, one) for one in names),
        *(Hypothesis(Symptom.FREE, one) for one in names),
        *(Hypothesis(Symptom.LOST, one) for one in mechanism.strut_names),
    ]
    found = responses(rows, FailureSet(), suspects)
    count = len(names)
    still = np.eye(count) - strains @ strains.T
    np.testing.assert_allclose(found.matrices[0, :count] @ strains, 0.0, atol=1e-9)
    for i in range(count):
        unit = np.zeros((count, count))
        unit[:, i] = still[:, i]
        stuck, free = found.matrices[[1 + i, 1 + count + i], :count] @ strains
        np.testing.assert_allclose(stuck, -unit @ strains, atol=1e-8)
        if shown[i] > 1e-6:
            np.testing.assert_allclose(free, stuck / shown[i] ** 2, atol=1e-7)
    lost = slice(1 + 2 * count, None)
    separation = separations(found, strains)[lost, lost]
    for i in range(count):
        for j in range(i):
            apart = area(strains[[i, j]]) > 1e-6
            assert (separation[i, j] > 1e-6) == apart, (names[i], names[j])


def test_the_groups_of_lost_legs_are_the_pairs_whose_loss_is_fatal():
    mechanism = mechanism_named('gough_stewart_8')
    rows = home_rows(mechanism)
    strains = self_stress(rows, reconfigured(rows, FailureSet()).present)
    suspects = [Hypothesis(Symptom.LOST, one) for one in mechanism.strut_names]
    separation = separations(responses(rows, FailureSet(), suspects), strains)
    fatal = {
        (i, j) for i in range(8) for j in range(i)
        if not reconfigured(rows, FailureSet(
            (), (), (mechanism.strut_names[i], mechanism.strut_names[j]))).verdict.tolerable
    }
    alike = {(i, j) for i in range(8) for j in range(i) if separation[i, j] < 1e-9}
    assert alike == fatal
