# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Decompositions in plain loops against LAPACK's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

pytestmark = pytest.mark.needs_numba

SIZES = st.tuples(st.integers(0, 9), st.integers(0, 7))
ENTRIES = st.floats(-1e3, 1e3, allow_subnormal=False).map(lambda x: x if abs(x) > 1e-12 else 0.0)


def checked(matrix):
    from fault_tolerance.compiled.small_matrices import decomposition

    matrix = np.ascontiguousarray(matrix)
    left, sigma, right = decomposition(matrix)
    rows, columns = matrix.shape
    width = min(rows, columns)
    assert left.shape == (rows, width)
    assert sigma.shape == (width,)
    assert right.shape == (columns, columns)
    if not width:
        np.testing.assert_array_equal(right, np.eye(columns))
        return
    exact = np.linalg.svd(matrix, compute_uv=False)
    scale = max(float(exact[0]), 1e-300)
    np.testing.assert_allclose(sigma / scale, exact / scale, atol=2e-14)
    np.testing.assert_allclose(right @ right.T, np.eye(columns), atol=1e-14)
    np.testing.assert_allclose(left.T @ left, np.eye(width), atol=1e-14)
    np.testing.assert_allclose((left * sigma) @ right[:width] / scale, matrix / scale, atol=2e-14)


@given(SIZES.flatmap(lambda size: arrays(float, size, elements=ENTRIES)))
def test_any_matrix_is_decomposed(matrix):
    checked(matrix)


@pytest.mark.parametrize('seed', range(200))
def test_what_is_dependent_or_badly_scaled_is_decomposed(seed):
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(1, 9), rng.integers(1, 7)
    matrix = rng.normal(size=(rows, columns)) * 10.0 ** rng.uniform(-8, 3, size=columns)
    if seed % 2 and rows > 1:
        matrix[-1] = matrix[0]
    if seed % 3 == 0 and columns > 1:
        matrix[:, -1] = -2.0 * matrix[:, 0]
    if seed % 5 == 0:
        matrix[:, rng.integers(columns)] = 0.0
    checked(matrix)


def test_small_singular_values_keep_their_digits():
    """Those of a graded matrix are known relative to themselves, not to the largest."""
    from fault_tolerance.compiled.small_matrices import decomposition

    rng = np.random.default_rng(5)
    rotation = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    wanted = 10.0 ** -np.arange(6.0)
    _, sigma, _ = decomposition(np.ascontiguousarray(rotation * wanted))
    np.testing.assert_allclose(sigma, wanted, rtol=1e-13)


@pytest.mark.parametrize('seed', range(50))
def test_square_matrices_are_inverted(seed):
    from fault_tolerance.compiled.small_matrices import inverted

    matrix = np.random.default_rng(seed).normal(size=(6, 6))
    result = np.empty((6, 6))
    assert inverted(matrix.copy(), result)
    exact = np.linalg.inv(matrix)
    np.testing.assert_allclose(result, exact, atol=1e-12 * np.abs(exact).max() ** 2)


def test_a_matrix_without_an_inverse_is_refused():
    from fault_tolerance.compiled.small_matrices import inverted

    matrix = np.eye(6)
    matrix[3] = 0.0
    assert not inverted(matrix, np.empty((6, 6)))
