# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Reference figures: shape, exact rates, and refusal of what makes no sense."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.errors import ArrayError
from fault_tolerance.simulation.reference import (
    REFERENCE_KINDS,
    Circle,
    Lissajous,
    Raster,
    Step,
    reference,
)

STEP = 1e-6
angles = st.floats(-0.03, 0.03)
frequencies = st.floats(0.1, 20.0)
times = st.floats(-100.0, 100.0)


def slope(figure, t):
    return (figure.angle(t + STEP) - figure.angle(t - STEP)) / (2.0 * STEP)


@settings(deadline=None)
@given(angles, frequencies, times)
def test_the_rate_of_a_circle_is_the_derivative_of_its_angle(radius, frequency, t):
    figure = Circle(radius, frequency)
    assert np.allclose(figure.rate(t), slope(figure, t), rtol=0.0, atol=1e-6)
    assert np.hypot(*figure.angle(t)) == pytest.approx(abs(radius), abs=1e-12)


@settings(deadline=None)
@given(angles, angles, frequencies, frequencies, st.floats(-4.0, 4.0), times)
def test_the_rate_of_a_lissajous_figure_is_the_derivative_of_its_angle(a, b, f, g, phase, t):
    figure = Lissajous((a, b), (f, g), phase)
    assert np.allclose(figure.rate(t), slope(figure, t), rtol=0.0, atol=1e-6)
    assert (np.abs(figure.angle(t)) <= np.abs([a, b])).all()


def test_a_route_goes_straight_from_place_to_place_and_rests_at_its_ends():
    route = reference('route', times=(0.0, 2.0, 3.0), angles=((0, 1), (4, 1), (4, -1)))
    for t, angle, rate in (
        (-1.0, (0, 1), (0, 0)), (0.0, (0, 1), (2, 0)), (1.0, (2, 1), (2, 0)),
        (2.0, (4, 1), (0, -2)), (2.5, (4, 0), (0, -2)), (3.0, (4, -1), (0, 0)),
        (9.0, (4, -1), (0, 0)),
    ):
        np.testing.assert_allclose(route.angle(t), angle)
        np.testing.assert_allclose(route.rate(t), rate)


@settings(deadline=None)
@given(angles, angles, frequencies, st.integers(1, 20), times)
def test_the_rate_of_a_raster_is_the_derivative_between_its_turns(a, b, frequency, lines, t):
    figure = Raster((a, b), frequency, lines)
    before, after = figure.rate(t - 2.0 * STEP), figure.rate(t + 2.0 * STEP)
    if (before == after).all():
        assert np.allclose(figure.rate(t), slope(figure, t), rtol=0.0, atol=1e-6)
    assert (np.abs(figure.angle(t)) <= np.abs([a, b])).all()


def test_a_circle_starts_on_the_x_axis_and_turns_towards_y():
    figure = Circle(2e-3, 4.0)
    assert figure.angle(0.0).tolist() == [2e-3, 0.0]
    assert np.allclose(figure.angle(1.0 / 16.0), [0.0, 2e-3], atol=1e-15)
    assert np.allclose(figure.rate(0.0), [0.0, 2e-3 * 8.0 * math.pi])


def test_a_raster_has_the_lines_asked_for_between_bottom_and_top():
    figure = Raster((1e-3, 2e-3), 5.0, 10)
    line = 0.1
    top = 10 * line / 2
    assert figure.angle(0.0).tolist() == [0.0, 0.0]
    assert np.allclose(figure.angle(line / 2)[0], 1e-3)
    assert np.allclose(figure.angle(3 * line / 2)[0], -1e-3)
    assert np.allclose(figure.angle(top)[1], 2e-3)
    assert np.allclose(figure.angle(top + 10 * line)[1], -2e-3)
    assert np.allclose(figure.rate(0.01), [2e-2, 4e-3])


def test_a_step_jumps_once_and_feeds_nothing_forward():
    figure = Step((1e-3, -2e-3), 0.5)
    assert figure.angle(0.499).tolist() == [0.0, 0.0]
    assert figure.angle(0.5).tolist() == [1e-3, -2e-3]
    assert figure.rate(0.5).tolist() == [0.0, 0.0]


@pytest.mark.parametrize('kind', REFERENCE_KINDS)
def test_every_kind_is_made_by_name(kind):
    figure = reference(kind)
    assert type(figure).__name__.lower() == kind
    assert figure.angle(0.3).shape == figure.rate(0.3).shape == (2,)


def test_parameters_reach_the_figure_as_lists_or_tuples():
    assert reference('circle', amplitude=2e-3, frequency=3.0) == Circle(2e-3, 3.0)
    assert reference('raster', amplitude=[1, 2], lines=3) == Raster((1.0, 2.0), 1.0, 3)
    assert reference('step', amplitude=np.array([1.0, 2.0])) == Step((1.0, 2.0))


@pytest.mark.parametrize(
    ('kind', 'parameters', 'message'),
    [
        ('spiral', {}, "'spiral' is not one of step circle raster lissajous route"),
        ('circle', {'radius': 1.0}, 'radius: is no parameter of circle'),
        ('circle', {'amplitude': math.nan}, 'amplitude: nan is not a finite number'),
        ('circle', {'frequency': '1'}, "frequency: '1' is not a finite number"),
        ('step', {'amplitude': 1.0}, 'amplitude: 1.0 is not a pair'),
        ('step', {'start': math.inf}, 'start: inf is not a finite number'),
        ('raster', {'amplitude': (1.0, 2.0, 3.0)}, 'is not a pair'),
        ('raster', {'lines': 0}, 'lines: 0 is not a positive whole number'),
        ('raster', {'lines': 2.5}, 'lines: 2.5 is not a positive whole number'),
        ('lissajous', {'frequency': (1.0, math.inf)}, 'frequency: inf is not a finite number'),
        ('route', {'times': (0.0, 0.0), 'angles': ((0, 0), (0, 1))}, 'times: do not rise'),
        ('route', {'times': (0.0,), 'angles': ()}, 'times: 1 times for 0 angles'),
        ('route', {'times': (math.nan,), 'angles': ((0, 0),)}, 'times: nan is not a finite'),
        ('lissajous', {'phase': True}, 'phase: True is not a finite number'),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(kind, parameters, message):
    with pytest.raises(ArrayError, match=message):
        reference(kind, **parameters)
