# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The compiled path comes to what the definitions come to, at every configuration."""

from contextlib import contextmanager

import numpy as np
import pytest
from core.cases import named
from core.mechanism.test_short_way import ELSEWHERE, REGULAR

from fault_tolerance.compiled.activation import Active
from fault_tolerance.control.resolved_rate import RateResolver
from fault_tolerance.control.transition import Transition
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.mechanism import tracking
from fault_tolerance.mechanism.configuration import fitted_configuration

pytestmark = pytest.mark.needs_numba


@contextmanager
def compiled(kernels):
    before, Active.kernels = Active.kernels, kernels
    try:
        yield
    finally:
        Active.kernels = before


def path(mechanism, size=0.02, count=6):
    """Return readings along a way from home, some of them in contradiction."""
    home = reconfigured(home_rows(mechanism)).present
    rng = np.random.default_rng(4)
    ways = home.mapping @ rng.normal(size=(home.mobility, 2))
    farthest = np.abs(ways * mechanism.rate_scale[:, None]).max()
    ways *= size * mechanism.characteristic_length / farthest
    turns = np.linspace(0.0, 2.0, count)
    exact = [ways @ [np.sin(turn), 1.0 - np.cos(turn)] for turn in turns]
    noise = 1e-7 * mechanism.characteristic_length / mechanism.rate_scale
    return [values + noise * rng.normal(size=len(values)) for values in exact]


def failures_of(mechanism):
    name = mechanism.actuator_names[-1]
    words = ['position', 'torque', *(['hard'] if len(mechanism.struts) > 1 else [])]
    single = [failure_set(mechanism, [(word, name)]) for word in words]
    return [failure_set(mechanism, []), *single]


def invariants(configuration, failures):
    """Return what does not depend on the choice of bases."""
    rows = strut_rows(configuration)
    present = reconfigured(rows, failures).present
    mechanism = configuration.mechanism
    state = configuration.state
    inverse = None
    if mechanism.rates_alike:
        weights = np.ones(len(mechanism.task.coordinates))
        found = RateResolver(
            mechanism.task, twist_scale=weights, rate_scale=mechanism.rate_scale
        ).inverse(present)
        inverse = [
            present.rate_map @ found.major, present.rate_map @ found.secondary,
            found.transmission, found.rank,
        ]
    return [
        configuration.pose, configuration.joint_values, configuration.misfit,
        configuration.closure_residual, configuration.flexure_strain, configuration.converged,
        rows.structure.T @ rows.structure, rows.actuator_rows, state.openings,
        present.mobility, present.jacobian @ present.mapping.T,
        present.mapping @ present.mapping.T,
        present.rate_map @ present.mapping.T, present.twist_jacobian @ present.mapping.T,
        present.unactuated @ present.unactuated.T, present.absorbed, present.weakest_kept,
        *(inverse or []),
    ]


def same(one, other):
    if one is None or other is None:
        assert one is other
        return
    one, other = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    finite = np.isfinite(other)
    np.testing.assert_array_equal(np.isfinite(one), finite)
    scale = max(1.0, float(np.abs(other[finite]).max(initial=0.0)))
    np.testing.assert_allclose(one[finite], other[finite], atol=1e-9 * scale, rtol=0.0)


@pytest.mark.parametrize('name', [*REGULAR, *ELSEWHERE])
def test_it_comes_to_the_same(kernels, name):
    mechanism = named(name)
    for failures in failures_of(mechanism):
        last = None
        for values in path(mechanism):
            definition = fitted_configuration(mechanism, values, failures.lost, last)
            expected = invariants(definition, failures)
            with compiled(kernels):
                found = fitted_configuration(mechanism, values, failures.lost, last)
                for one, other in zip(invariants(found, failures), expected, strict=True):
                    same(one, other)
            last = found if found.converged else None


@pytest.mark.parametrize('name', REGULAR)
def test_where_struts_are_regular_it_is_really_taken(kernels, name, monkeypatch):
    """Otherwise the test above would compare the definition with itself."""
    mechanism = named(name)
    taken = []
    real = tracking.followed
    monkeypatch.setattr(
        tracking, 'followed', lambda *given: taken.append(real(*given)) or taken[-1]
    )
    last = None
    with compiled(kernels):
        for values in path(mechanism, size=0.005):
            last = fitted_configuration(mechanism, values, start=last)
    assert sum(one is not None for one in taken) >= 4


@pytest.mark.filterwarnings('ignore::RuntimeWarning')
@pytest.mark.parametrize('name', ['mirror_4_strut', 'gough_stewart_8'])
def test_far_away_or_with_nonsense_it_declines(kernels, name):
    mechanism = named(name)
    start = fitted_configuration(mechanism, np.zeros(len(mechanism.actuators)))
    values = path(mechanism)[1]
    for bad in (np.full_like(values, np.nan), np.full_like(values, 1e300), values + 50.0,
                np.full_like(values, np.inf)):
        definition = fitted_configuration(mechanism, bad, start=start)
        with compiled(kernels):
            found = fitted_configuration(mechanism, bad, start=start)
        assert found.converged == definition.converged
        if found.converged:
            same(found.pose, definition.pose)


def test_nothing_is_left_to_be_compiled(kernels):
    """A call that has to be compiled takes seconds; a type that does not fit is an error."""
    for name in ('mirror_4_strut', 'gough_stewart_8'):
        mechanism = named(name)
        with compiled(kernels):
            for failures in failures_of(mechanism):
                last = None
                for values in path(mechanism):
                    last = fitted_configuration(mechanism, values, failures.lost, last)
                    invariants(last, failures)
    for kernel in vars(kernels).values():
        assert len(kernel.signatures) == 1


def test_the_transition_takes_note_of_what_it_has_not_made():
    mechanism = named('mirror_4_strut')
    count = len(mechanism.actuators)
    transition = Transition(
        mechanism.task, np.ones(len(mechanism.task.coordinates)), np.ones(count), 1.0
    )
    assert transition.sent is None
    assert transition.allowed(1.0) == 0.0
    nothing = failure_set(mechanism, [])
    transition.passed(
        np.zeros(count), np.zeros(len(mechanism.task.coordinates)), nothing, 1.0, moves=True
    )
    assert transition.allowed(1.5) == 0.5
