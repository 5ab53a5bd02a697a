# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Making machine code of Python functions, where numba is there to do it."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

_Function = TypeVar('_Function', bound=Callable[..., Any])

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

NUMBER, COUNT, FLAG = types.float64, types.intp, types.boolean


def numbers(axes: int) -> types.Array:
    """Return the type of arrays of numbers: whatever their layout, and never written to."""
    return types.Array(NUMBER, axes, 'A', readonly=True)


def counts() -> types.Array:
    """Return the type of places, (n,)."""
    return types.Array(COUNT, 1, 'A', readonly=True)


def flags() -> types.Array:
    """Return the type of masks, (n,)."""
    return types.Array(FLAG, 1, 'A', readonly=True)


def results() -> types.Array:
    """Return the type of an array that is written into."""
    return types.Array(NUMBER, 1, 'C')


def compiled(function: _Function) -> _Function:
    """Return ``function`` for use in others that are compiled."""
    return _compiled(function, None)


def entry(*arguments: types.Type) -> Callable[[_Function], _Function]:
    """Return what compiles a function at once, for arguments of these types and no others.

    Nothing is left to be compiled when it is called: that would take seconds.
    """
    return lambda function: _compiled(function, [arguments])


def _compiled(function: _Function, signatures: list[tuple[types.Type, ...]] | None) -> _Function:
    # Divisions by zero give infinities, as numpy's do, instead of exceptions.
    def made(*, cache: bool) -> Any:
        return numba.njit(signatures, error_model='numpy', cache=cache)(function)

    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(folder())  # type: ignore[attr-defined]
    try:
        return made(cache=True)  # type: ignore[no-any-return]
    except (OSError, RuntimeError):  # it cannot write there
        return made(cache=False)  # type: ignore[no-any-return]
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


@cache
def folder() -> Path:
    """Return where machine code is kept: another place whenever any of the code here changes.

    numba itself would notice a change of the function, but not of those it calls.
    """
    digest = sha256()
    for file in sorted(Path(__file__).parent.glob('*.py')):
        digest.update(file.read_bytes())
    home = os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache'
    return Path(home) / 'fault_tolerance' / digest.hexdigest()[:16]
