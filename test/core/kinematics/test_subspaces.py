# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Ranks, bases and manipulability, at every shape a matrix can have."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.kinematics.subspaces import (
    adds_rank,
    manipulability,
    null_space,
    range_basis,
    rank,
    rank_of,
    singular_values,
)


@st.composite
def matrices(draw):
    """Return a matrix of known rank, of any shape, possibly empty."""
    rows, columns = draw(st.integers(0, 7)), draw(st.integers(0, 7))
    order = draw(st.integers(0, min(rows, columns)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    size = 10.0 ** draw(st.integers(-12, 12))
    left = np.linalg.qr(rng.normal(size=(rows, order)))[0] if order else np.zeros((rows, 0))
    right = np.linalg.qr(rng.normal(size=(columns, order)))[0] if order else np.zeros((columns, 0))
    sizes = rng.uniform(0.1, 1.0, order)
    return size * (left * sizes) @ right.T, order, size * np.sort(sizes)[::-1]


@given(matrices())
@settings(max_examples=100, deadline=None)
def test_against_the_construction(case):
    matrix, order, sizes = case
    assert rank(matrix) == order
    np.testing.assert_allclose(
        singular_values(matrix)[:order], sizes, rtol=1e-9)
    nothing = null_space(matrix)
    assert nothing.shape == (matrix.shape[1], matrix.shape[1] - order)
    np.testing.assert_allclose(nothing.T @ nothing, np.eye(nothing.shape[1]), atol=1e-12)
    largest = np.abs(matrix).max(initial=0.0)
    np.testing.assert_allclose(matrix @ nothing, 0.0, atol=1e-12 * largest)
    basis = range_basis(matrix)
    assert basis.shape == (matrix.shape[0], order)
    np.testing.assert_allclose(basis @ (basis.T @ matrix), matrix, atol=1e-12 * largest)
    assert manipulability(matrix, order) == pytest.approx(float(np.prod(sizes)), rel=1e-8)
    assert manipulability(matrix, order + 1) == 0.0
    assert sum(adds_rank(matrix)) == order


def test_adds_rank_names_the_first_of_dependent_rows():
    matrix = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [1.0, 0.0], [0.0, 1.0]])
    assert adds_rank(matrix) == (False, True, False, True, False)
    assert adds_rank(np.zeros((3, 0))) == (False, False, False)
    assert adds_rank(np.zeros((0, 3))) == ()


def test_ranks_by_a_yardstick():
    sigma = np.array([1e-3, 1e-8])
    assert rank_of(sigma) == 2
    assert rank_of(sigma, 10.0) == 1
    assert rank_of(sigma, 1e7) == 0
    assert rank_of(np.zeros(3)) == 0
    assert rank_of(np.zeros(0)) == 0
    # What is only noise beside what could be there counts as nothing.
    assert rank(np.array([[1e-12, 0.0], [0.0, 1e-13]]), 1.0) == 0
    assert null_space(np.array([[1e-12, 0.0]]), 1.0).shape == (2, 2)
