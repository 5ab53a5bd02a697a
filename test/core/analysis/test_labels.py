# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Placing names: none over another, inside the sheet, and off the lines where there is room."""

import numpy as np
import pytest

from fault_tolerance.analysis.labels import placed_labels

SHEET = (0.0, 0.0, 600.0, 400.0)
NO_LINES = np.zeros((0, 5)), np.zeros(0)
SIZE = np.array([50.0, 12.0])


def overlap(first, second):
    return bool((np.abs(first - second) < SIZE - 1e-9).all())


@pytest.mark.parametrize('seed', range(5))
def test_names_of_crowded_points(seed):
    rng = np.random.default_rng(seed)
    anchors = rng.uniform([150, 100], [450, 300], (25, 2))
    centres = placed_labels(anchors, np.tile(SIZE, (25, 1)), *NO_LINES, SHEET)
    for index, centre in enumerate(centres):
        assert (centre - SIZE / 2 >= 0.0).all()
        assert (centre + SIZE / 2 <= SHEET[2:]).all()
        assert not any(overlap(centre, other) for other in centres[:index])


def test_a_lone_name_is_close_and_off_the_line():
    anchor = np.array([[300.0, 200.0]])
    line = np.array([[300.0, 0.0, 300.0, 400.0, 4.0]])
    [centre] = placed_labels(anchor, SIZE[None], line, np.ones(1), SHEET)
    assert abs(centre[0] - 300.0) >= SIZE[0] / 2 + 4.0
    assert np.linalg.norm(centre - anchor[0]) < 60.0


def test_at_the_edge_it_stays_on_the_sheet():
    anchors = np.array([[1.0, 1.0], [599.0, 399.0]])
    centres = placed_labels(anchors, np.tile(SIZE, (2, 1)), *NO_LINES, SHEET)
    assert (centres >= SIZE / 2).all()
    assert (centres <= np.array(SHEET[2:]) - SIZE / 2).all()


def test_the_same_every_time():
    anchors = np.random.default_rng(0).uniform(100, 300, (10, 2))
    first, second = (
        placed_labels(anchors, np.tile(SIZE, (10, 1)), *NO_LINES, SHEET) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_no_names():
    assert placed_labels(np.zeros((0, 2)), np.zeros((0, 2)), *NO_LINES, SHEET).shape == (0, 2)
