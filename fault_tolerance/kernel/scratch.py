# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Room for what the kernel computes on the way: one array, given out from its beginning.

The kernel makes no arrays. Counting the references to arrays that numba has made took more than
half of a step, and most of its machine code. ``work[0]`` is the place of the first free number:
whoever sets it back gives all later parts free. What is given out is not cleared.
"""

from __future__ import annotations

from fault_tolerance.mechanism.arrays import FloatArray


def vector(work: FloatArray, count: int) -> FloatArray:
    """Return the next ``count`` numbers of the workspace ``work``."""
    begin = int(work[0])
    work[0] = begin + count
    return work[begin : begin + count]


def matrix(work: FloatArray, rows: int, columns: int) -> FloatArray:
    """Return a matrix (``rows``, ``columns``) from the workspace ``work``."""
    begin = int(work[0])
    end = begin + rows * columns
    work[0] = end
    return work[begin:end].reshape((rows, columns))


def workspace_size(s: int, k: int, n: int, task: int) -> int:
    """Return how many numbers are enough: ``s`` struts of ``k`` joints, ``n`` actuators.

    Of estimates, structures of at most six rows a strut, and kinematics of at most ``6 + n``
    motions several are in use at the same time, and all joints once; ``task`` coordinates.
    """
    estimate = 64 + (60 + 8 * k) * s + (20 + 2 * n) * n
    structure = 200 + 160 * s
    kinematics = (6 + n) * (42 + 9 * n + 2 * task)
    return 2 * estimate + 7 * s * k + 3 * structure + 8 * kinematics
