# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What every stored array passes through."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fault_tolerance.errors import ArrayError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def frozen(array: FloatArray) -> FloatArray:
    """Return ``array`` itself, read-only from now on: for one that has just been made."""
    array.setflags(write=False)
    return array


def frozen_array(
    value: ArrayLike,
    shape: tuple[int | None, ...],
    name: str,
    *,
    finite: bool = True,
) -> FloatArray:
    """Return a read-only copy of ``value`` as float64, checked.

    Parameters
    ----------
    value : array_like
        What is to be stored.
    shape : tuple of int or None
        The shape it must have; None leaves an extent open.
    name : str
        What it is, for the error.
    finite : bool
        Whether every element must be finite.

    Raises
    ------
    ArrayError
        If the shape differs, or an element is not a (finite) number.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArrayError(name, f'is not an array of numbers ({error})') from None
    fits = array.ndim == len(shape) and all(
        wanted is None or extent == wanted
        for extent, wanted in zip(array.shape, shape, strict=True)
    )
    if not fits:
        wanted_text = ' x '.join('any' if extent is None else str(extent) for extent in shape)
        raise ArrayError(name, f'has shape {array.shape}, expected {wanted_text}')
    if finite and not np.isfinite(array).all():
        raise ArrayError(name, 'holds a number that is not finite')
    return frozen(array)
