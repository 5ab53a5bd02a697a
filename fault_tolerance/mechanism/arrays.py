# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What every stored array passes through, and numbers as text."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fault_tolerance.errors import ArrayError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
_Array = TypeVar('_Array', bound=NDArray[Any])


def frozen(array: _Array) -> _Array:
    """Return ``array`` itself, read-only from now on: for one that has just been made."""
    array.setflags(write=False)
    return array


def frozen_array(
    value: ArrayLike, shape: tuple[int | None, ...], name: str, *, finite: bool = True
) -> FloatArray:
    """Return a read-only float64 copy of ``value``, called ``name`` in errors.

    ArrayError if it is not of ``shape`` (None leaves an extent open), or if an element is not a
    number, or not a finite one where ``finite`` is asked for.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArrayError(name, f'is not an array of numbers ({error})') from None
    fits = array.ndim == len(shape) and all(
        wanted in (None, extent) for extent, wanted in zip(array.shape, shape, strict=True)
    )
    if not fits:
        wanted_text = ' x '.join('any' if extent is None else str(extent) for extent in shape)
        raise ArrayError(name, f'has shape {array.shape}, expected {wanted_text}')
    if finite and not np.isfinite(array).all():
        raise ArrayError(name, 'holds a number that is not finite')
    return frozen(array)


def decimal(value: float) -> str:
    """Return ``value`` as text with nine significant digits and no exponent."""
    if abs(value) < 1e-15:
        return '0'
    return np.format_float_positional(value, precision=9, fractional=False, trim='-')
