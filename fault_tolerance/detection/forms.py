# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The bank of filters as machine code, where numba works; the same source as Python elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from fault_tolerance.detection import bank


@cache
def best_advance() -> Callable[..., float]:
    """Return `bank.advance`, compiled if possible.

    Returns
    -------
    callable
    """
    try:
        import numba
    except ImportError:
        return bank.advance
    names: dict[str, Any] = dict(vars(bank))
    for name in ('_uncertainty', '_load_step', '_predict', 'advance'):
        source = names[name]
        copy = FunctionType(source.__code__, names, name)
        names[name] = numba.njit(copy)
    advance: Callable[..., float] = names['advance']
    return advance
