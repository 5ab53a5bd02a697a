# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Scratch memory: one preallocated array, used as a stack.

Arrays that numba makes are reference counted, which took more than half of a step and most of the
machine code. ``work[0]`` is the index of the first free number: whoever sets it back frees
everything given out since. What is given out is not cleared (`set_zero`, `set_identity`).
"""

from fault_tolerance.mechanism.arrays import FloatArray


def vector(work: FloatArray, count: int) -> FloatArray:
    """Return the next ``count`` numbers."""
    begin = int(work[0])
    work[0] = begin + count
    return work[begin : begin + count]


def matrix(work: FloatArray, rows: int, columns: int) -> FloatArray:
    """Return the next ``rows`` times ``columns`` numbers as a matrix."""
    begin = int(work[0])
    end = begin + rows * columns
    work[0] = end
    return work[begin:end].reshape((rows, columns))


def set_zero(out: FloatArray) -> FloatArray:
    """Set all of a vector (k,) to zero; return ``out``."""
    for i in range(len(out)):
        out[i] = 0.0
    return out


def set_identity(out: FloatArray) -> None:
    """Set ``out`` (r, c) to one on the diagonal and zero elsewhere."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 1.0 if i == j else 0.0
