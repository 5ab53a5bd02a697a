# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether the compiled path is used: not before somebody asks for it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

SWITCH = 'FAULT_TOLERANCE_COMPILED'
"""The variable that switches the compiled path off when it is 0."""


@dataclass(frozen=True)
class Kernels:
    """The functions that are compiled."""

    begin: Callable[..., int]
    command: Callable[..., tuple[int, int]]
    follow: Callable[..., Any]
    reconfigure: Callable[..., Any]
    invert_task: Callable[..., Any]
    hard_of_few: Callable[..., Any]
    position_of_few: Callable[..., Any]
    torque_of_few: Callable[..., Any]
    within: Callable[..., bool]


class Active:
    """Where the code that has a compiled counterpart looks for it.

    Attributes
    ----------
    kernels : Kernels or None
        None: use numpy.
    """

    kernels: Kernels | None = None


def activate(announce: Callable[[str], object] | None = None) -> str:
    """Compile what can be, or load it, and use it from now on; return why not, if not.

    Where it has never been done it takes half a minute, and half a second after that.

    Parameters
    ----------
    announce : callable, optional
        Is told when it is going to take long.
    """
    if os.environ.get(SWITCH) == '0':
        return f'switched off by {SWITCH}=0'
    try:
        from fault_tolerance.compiled.compiler import folder

        if announce is not None and not folder().exists():
            announce(f'compiling for this machine, once: about half a minute ({folder()})')
        from fault_tolerance.compiled.beginning import begin
        from fault_tolerance.compiled.commanding import command
        from fault_tolerance.compiled.following import follow
        from fault_tolerance.compiled.measuring import (
            hard_of_few,
            position_of_few,
            torque_of_few,
        )
        from fault_tolerance.compiled.resolving import invert_task, reconfigure, within
    except ImportError as error:
        return f'numba is not there ({error}): commands take longer'
    except Exception as error:  # a numba too old or too new for numpy fails in many ways
        return f'numba does not work here ({type(error).__name__}: {error}): commands take longer'
    Active.kernels = Kernels(
        begin, command, follow, reconfigure, invert_task, hard_of_few, position_of_few,
        torque_of_few, within,
    )
    return ''


def deactivate() -> None:
    """Use numpy from now on."""
    Active.kernels = None
